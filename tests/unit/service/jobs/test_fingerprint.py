"""Which registrations are the same work."""

from __future__ import annotations

from dataclasses import replace

import pytest

from service.clouds.inputs import CloudInput
from service.jobs.fingerprint import hash_json, hash_work

SOURCE, TARGET = CloudInput("ab", 1), CloudInput("cd", 2)
OPTIONS = {"seed": 1, "method": "mpl"}


def test_the_same_content_is_the_same_work_however_it_was_named() -> None:
    named = replace(SOURCE, cloud="door", url=None)
    fetched = replace(TARGET, url="https://a/b.ply")
    work = hash_work(SOURCE, TARGET, OPTIONS)
    assert work is not None
    assert work == hash_work(named, fetched, {"method": "mpl", "seed": 1})


@pytest.mark.parametrize(
    ("source", "target", "options"),
    [
        (TARGET, SOURCE, OPTIONS),
        (SOURCE, TARGET, {**OPTIONS, "seed": 2}),
        (replace(SOURCE, reading={"scan": 1}), TARGET, OPTIONS),
        (SOURCE, replace(TARGET, reading={"scan": 1}), OPTIONS),
    ],
)
def test_other_clouds_options_or_reading_are_other_work(
    source: CloudInput, target: CloudInput, options: dict[str, object]
) -> None:
    assert hash_work(source, target, options) != hash_work(SOURCE, TARGET, OPTIONS)


def test_work_is_unknown_before_both_clouds_are_stored() -> None:
    url = CloudInput(url="https://a/b.ply")
    assert hash_work(url, TARGET, OPTIONS) is None
    assert hash_work(SOURCE, url, OPTIONS) is None


def test_the_order_of_lists_counts_and_that_of_keys_does_not() -> None:
    assert hash_json({"a": 1, "b": 2}) == hash_json({"b": 2, "a": 1})
    assert hash_json([1, 2]) != hash_json([2, 1])
