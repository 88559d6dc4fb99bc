"""Inlier lists are streamed: the same document however many rows are rendered at once."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from service.schemas import InlierList, serialize_result
from service.schemas.inlier_file import INLIER_DTYPE
from service.schemas.serialize_result import (
    count_pairs,
    iter_inliers_json,
    read_summary,
    split_pairs,
)


@pytest.mark.parametrize("count", [0, 1, 3, 10])
@pytest.mark.parametrize("chunk", [1, 3, 50_000])
def test_the_list_of_inliers(count: int, chunk: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(serialize_result, "ROWS_PER_CHUNK", chunk)
    rows = np.zeros(count, INLIER_DTYPE)
    rows["source"] = np.arange(count)
    rows["target"] = 2 * np.arange(count)
    rows["distance"] = np.arange(count) / 3
    document = InlierList.model_validate_json("".join(iter_inliers_json(rows, 0.25)))
    assert document.count == count
    assert document.threshold == 0.25
    assert document.pairs == [[i, 2 * i] for i in range(count)]
    assert document.distances == [i / 3 for i in range(count)]
    assert json.loads("".join(iter_inliers_json(rows, 0.25)))["count"] == count


@pytest.mark.parametrize("count", [0, 1, 50_000])
def test_a_summary_is_the_result_without_its_pairs(
    count: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Only little of the text is parsed, as no other thread runs meanwhile."""
    inliers = {"count": count, "pairs": [[i, i] for i in range(count)]}
    result = {"warnings": ['a file said "pairs":[[1,2]]'], "inliers": inliers, "rmse": 0.5}
    document = json.dumps(result, separators=(",", ":"))
    lengths: list[int] = []
    parse = json.loads

    def parse_counted(text: bytes) -> Any:
        lengths.append(len(text))
        return parse(text)

    monkeypatch.setattr(json, "loads", parse_counted)
    assert read_summary(document.encode()) == result | {
        "inliers": {"count": count, "pairs": None if count else []}
    }
    assert max(lengths) < 200


@pytest.mark.parametrize("count", [1, 2, 5000])
def test_pairs_are_counted_in_steps(count: int) -> None:
    pairs = json.dumps([[i, 7 * i] for i in range(count)], separators=(",", ":")).encode()
    document, text = split_pairs(b'{"inliers":{"pairs":' + pairs + b'},"rmse":1}')
    assert json.loads(document) == {"inliers": {"pairs": None}, "rmse": 1}
    assert text == pairs
    assert count_pairs(text) == count


@pytest.mark.parametrize(
    "row",
    [
        "[1]",
        "[1,2,3]",
        "[1,-2]",
        "[1,2.5]",
        "[1,2",
        "1,2]",
        '["1",2]',
        "[[1,2]]",
        " ",
        "null",
        "{}",
    ],
)
@pytest.mark.parametrize("before", [0, 5000])
def test_what_is_no_pair_is_refused(row: str, before: int) -> None:
    text = "[" + ",".join(["[1,2]"] * before + [row]) + "]"
    with pytest.raises(ValueError, match="no pairs"):
        count_pairs(text.encode())
