"""Text in any dialect gives the same cloud, or is refused with a reason.

``MPE_DIALECTS`` is the number of dialects; 5,000 take about a minute.
"""

from __future__ import annotations

import os
from pathlib import Path
from random import Random

import numpy as np
import pytest
from numpy.typing import NDArray

from service.formats import CloudFileError, read_points, text_table
from tests.factories.text_dialects import TextDialect

COUNT = int(os.environ.get("MPE_DIALECTS", "400"))


def cloud_of(dialect: TextDialect) -> NDArray[np.float64]:
    points = np.round(np.random.default_rng(1).uniform(-90, 90, (30, 3)), 3)
    if dialect.missing is not None:
        points[[4, 17]] = np.nan
    return points


def read_or_reason(path: Path) -> NDArray[np.floating] | str:
    try:
        return read_points(path).points
    except CloudFileError as error:
        return str(error)


def same(found: NDArray[np.floating], points: NDArray[np.float64]) -> bool:
    found, points = (a[np.isfinite(a).all(axis=1)].astype(float) for a in (found, points))
    return found.shape == points.shape and np.allclose(found, points, rtol=0, atol=0.06)


def test_a_dialect_is_read_rightly_or_refused(tmp_path: Path) -> None:
    random, refused = Random(7), 0
    for number in range(COUNT):
        dialect = TextDialect.draw(random)
        content, points = dialect.write(cloud_of(dialect)), cloud_of(dialect)
        (tmp_path / "a").write_bytes(content)
        found = read_or_reason(tmp_path / "a")
        refused += isinstance(found, str)
        is_right = not dialect.is_clear if isinstance(found, str) else same(found, points)
        assert is_right, (number, dialect, content[:300], found)
    assert refused < COUNT / 4


def test_the_kernel_reads_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What is read by the kernel is read to the same bits without it, or left to the others."""
    random = Random(11)
    for number in range(COUNT // 4):
        dialect = TextDialect.draw(random)
        (tmp_path / "a").write_bytes(dialect.write(cloud_of(dialect)))
        found = []
        for least in (0, 1 << 60):
            monkeypatch.setattr(text_table, "MIN_KERNEL_BYTES", least)
            found.append(read_or_reason(tmp_path / "a"))
        np.testing.assert_array_equal(found[0], found[1], err_msg=f"{number} {dialect}")
