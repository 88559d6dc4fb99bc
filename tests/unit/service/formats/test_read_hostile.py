"""Damaged and malicious files: an error that says so, or the points that the file holds."""

from __future__ import annotations

import pickle
import struct
import tracemalloc
from pathlib import Path

import laspy  # noqa: F401  loaded before memory is measured
import numpy as np
import pye57  # noqa: F401
import pytest
import trimesh.sample  # noqa: F401

from service.formats import (
    CloudFileError,
    DecodedCloud,
    FileLimitError,
    Limits,
    TruncatedFileError,
    UnsupportedFileError,
    read_points,
)
from tests.factories.cloud_files import POINTS, npy, npz, ply, seeds
from tests.factories.hostile_files import ALL, HUGE, LIES, corpus, zip_of
from tests.factories.scanner_files import scanner_seeds

MOST_MEMORY = 8 << 20  # bytes; the files here have a few kilobytes


def attempt(tmp_path: Path, content: bytes, **choices: int) -> DecodedCloud | CloudFileError:
    """Decode, with little memory; any exception other than CloudFileError fails the test."""
    path = tmp_path / "cloud"
    path.write_bytes(content)
    tracemalloc.start()
    try:
        return read_points(path, **choices)
    except CloudFileError as error:
        return error
    finally:
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert peak < MOST_MEMORY + 16 * len(content)


@pytest.mark.parametrize("kind", seeds())
def test_a_cut_file_is_an_error_or_gives_its_points(tmp_path: Path, kind: str) -> None:
    """A text without a count cannot know: it gives the whole rows before the cut and says so."""
    content = seeds()[kind]
    step = max(1, len(content) // 150)
    for size in [*range(0, len(content), step), *range(len(content) - 20, len(content))]:
        found = attempt(tmp_path, content[:size])
        if isinstance(found, CloudFileError):
            assert str(found)
            continue
        points = found.points.astype(np.float32)
        if kind in ("xyz", "csv"):
            whole = len(points) - any("may have been cut" in w for w in found.warnings)
            np.testing.assert_array_equal(points[:whole], POINTS[:whole])
        elif any("may have been cut" in warning for warning in found.warnings):
            np.testing.assert_array_equal(points[:-1], POINTS[:-1])
        else:
            np.testing.assert_array_equal(points, POINTS)


def test_the_whole_corpus_is_an_error_or_points(tmp_path: Path) -> None:
    names = set()
    for name, content in corpus():
        found = attempt(tmp_path, content)
        names.add(name)
        if isinstance(found, DecodedCloud):
            assert found.points.shape[1:] == (3,), name
            assert found.points.dtype in (np.float32, np.float64), name
            assert len(found.points) <= max(len(content), 40), name
    assert len(names) >= 2000


@pytest.mark.parametrize("kind", scanner_seeds())
def test_a_cut_scanner_file_is_an_error_or_gives_its_points(tmp_path: Path, kind: str) -> None:
    """What stands behind the points (faces, the end of a solid) may be cut; text cannot know."""
    content = ALL[kind]
    whole = attempt(tmp_path, content)
    assert isinstance(whole, DecodedCloud)
    for size in np.unique(np.linspace(0, len(content) - 1, 120).astype(int)):
        found = attempt(tmp_path, content[:size])
        if isinstance(found, DecodedCloud):
            count = len(found.points)
            assert count == len(whole.points) or kind == "obj", size
            np.testing.assert_array_equal(found.points[:-1], whole.points[: count - 1])


class _Pickle:
    def __reduce__(self) -> tuple[object, ...]:
        return (open, ("/tmp/mpe-unpickled", "w"))


@pytest.mark.parametrize("case", LIES)
def test_lies_are_errors(tmp_path: Path, case: str) -> None:
    found = attempt(tmp_path, LIES[case])
    assert isinstance(found, CloudFileError), found
    assert str(found)


def test_pickles_are_never_loaded(tmp_path: Path) -> None:
    array = np.array([_Pickle()], dtype=object)
    for content in (npy(array), npz(points=array), pickle.dumps(_Pickle())):
        assert isinstance(attempt(tmp_path, content), CloudFileError)
    assert isinstance(attempt(tmp_path, npy(array)), UnsupportedFileError)
    assert not Path("/tmp/mpe-unpickled").exists()


def test_bombs_are_refused_before_they_expand(tmp_path: Path) -> None:
    zeros = npy(np.zeros((3_000_000, 3)))
    bomb = zip_of("points.npy", zeros)
    assert len(bomb) < len(zeros) / 500
    found = attempt(tmp_path, bomb)
    assert isinstance(found, FileLimitError)
    lying = bytearray(bomb)
    size = struct.pack("<I", len(zeros))
    for at in (bomb.find(size), bomb.rfind(size)):
        lying[at : at + 4] = struct.pack("<I", 1000)
    assert isinstance(attempt(tmp_path, bytes(lying)), CloudFileError)


@pytest.mark.parametrize("case", HUGE)
def test_sizes_of_headers_and_lines_are_bounded(tmp_path: Path, case: str) -> None:
    assert isinstance(attempt(tmp_path, HUGE[case]), CloudFileError)


def test_the_limit_on_points_is_kept(tmp_path: Path) -> None:
    path = tmp_path / "cloud"
    for content in seeds().values():
        path.write_bytes(content)
        with pytest.raises(FileLimitError):
            read_points(path, Limits(max_points=2))


FINDINGS = Path(__file__).parent / "findings"


@pytest.mark.parametrize("name", sorted(path.name for path in FINDINGS.iterdir()))
def test_what_fuzzing_found(tmp_path: Path, name: str) -> None:
    """A name ends in -sampled where the surface is to be sampled."""
    choices = {"surface_samples": 10} if name.endswith("-sampled") else {}
    content = (FINDINGS / name).read_bytes()
    assert isinstance(attempt(tmp_path, content, **choices), CloudFileError)


def test_a_cut_names_the_byte(tmp_path: Path) -> None:
    found = attempt(tmp_path, ply(lists="inside")[:-1])
    assert isinstance(found, TruncatedFileError)
    assert "39 of 40 rows" in str(found)
