"""Numbers in text are those of float(), or the text is unclear."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from mpe_core.kernels.decimal_rows import BLANKS, UNCLEAR, parse_rows


def parsed(
    text: str, delimiter: str | None = None, columns: tuple[int, ...] = (0, 1, 2)
) -> NDArray[np.float64] | None:
    targets = np.full(max(columns) + 1, -1)
    targets[list(columns)] = np.arange(len(columns))
    content = np.frombuffer(text.encode(), np.uint8)
    out = np.full((text.count("\n") + 1, len(columns)), np.nan)
    byte = BLANKS if delimiter is None else ord(delimiter)
    rows = parse_rows(content, byte, targets, len(columns), out)
    return None if rows == UNCLEAR else out[:rows]


@pytest.mark.parametrize("numeral", ["%.3f", "%.9g", "%+.6e", "%d", "%.0f", "%12.5f", "%.15g"])
@pytest.mark.parametrize("delimiter", [None, ",", ";", "\t"])
def test_numbers_are_those_of_python(numeral: str, delimiter: str | None) -> None:
    table = np.random.default_rng(3).normal(0, 1, (300, 5)) * 10.0 ** np.arange(-3, 2)
    words = [[numeral % value for value in row] for row in table]
    text = "\n".join((delimiter or "  ").join(row) for row in words) + "\n"
    expected = np.array([[float(row[i]) for i in (4, 0, 2)] for row in words])
    found = parsed(text, delimiter, (4, 0, 2))
    assert found is not None
    np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize(
    "text", ["1 2 3", "\n\n 1 2 3 \r\n", "1\t2  3 word\n", "+1 2. 3e0\n", ".1e1 20e-1 0.3E+1\n"]
)
def test_rows_of_many_forms(text: str) -> None:
    np.testing.assert_array_equal(parsed(text), [[1, 2, 3]])


@pytest.mark.parametrize(
    "text",
    [
        "1 2\n",
        "1 two 3\n",
        "1 2 3x\n",
        "1 2 nan\n",
        "# 1\n1 2 3\n",
        "1,5 2 3\n",
        "1 2 1e\n",
        "1 2 12345678901234567890\n",
        "1 2 1e300\n",
        "1 2 3\r4 5 6\n",
        "1 2 -\n",
        "1 2 1.2.3\n",
    ],
)
def test_what_is_not_plain_is_unclear(text: str) -> None:
    assert parsed(text) is None


def test_empty_fields_are_unclear_and_rows_are_bounded() -> None:
    assert parsed("1,,3\n", ",") is None
    out = np.empty((1, 1))
    text = np.frombuffer(b"1\n2\n", np.uint8)
    assert parse_rows(text, BLANKS, np.array([0]), 1, out) == 1
