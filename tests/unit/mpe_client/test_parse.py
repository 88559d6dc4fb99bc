"""Responses that are not the service's are named."""

from __future__ import annotations

import pytest

from mpe_client.errors import InvalidResponseError
from mpe_client.models import Cloud, Job, Progress
from mpe_client.parse import parse, parse_json
from tests.factories.fake_service import job


@pytest.mark.parametrize("text", [b"<html>", b"[]", b"null", b'{"stage": "x"}', b"\xff"])
def test_other_documents_are_refused(text: bytes) -> None:
    with pytest.raises(InvalidResponseError, match="Progress"):
        parse_json(Progress, text)


@pytest.mark.parametrize("change", [{"attempt": "1"}, {"progress": 3}, {"created_at": "soon"}])
def test_a_member_of_another_type_is_named(change: dict[str, object]) -> None:
    with pytest.raises(InvalidResponseError, match=next(iter(change))):
        parse(Job, job(**change))


def test_a_missing_member_is_named() -> None:
    with pytest.raises(InvalidResponseError, match="'sha256'"):
        parse(Cloud, {"id": "x"})


def test_whole_numbers_are_floats() -> None:
    progress = parse(Progress, {"stage": "finished", "fraction": 1})
    assert isinstance(progress.fraction, float)
