"""Clouds in each form that a caller may have."""

from __future__ import annotations

import io
import os
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest

from mpe_client.inputs import LocalFile, StoredCloud, open_cloud

POINTS = np.arange(12.0).reshape(4, 3)


def content(cloud: object) -> bytes:
    with ExitStack() as stack:
        opened = open_cloud(cloud, stack)
        assert isinstance(opened, LocalFile)
        first, again = opened.rewind().read(), opened.rewind().read()
    assert first == again
    assert len(first) == opened.size
    return first


def test_paths_and_files_are_their_bytes(tmp_path: Path) -> None:
    path = tmp_path / "a.xyz"
    path.write_bytes(b"1 2 3\n")
    assert content(path) == content(str(path)) == b"1 2 3\n"
    with path.open("rb") as file:
        assert content(file) == b"1 2 3\n"
        assert not file.closed


def test_a_file_begins_where_it_stands() -> None:
    file = io.BytesIO(b"skip1 2 3\n")
    file.seek(4)
    assert content(file) == b"1 2 3\n"


def test_a_pipe_is_read_once() -> None:
    read, write = os.pipe()
    os.write(write, b"1 2 3\n")
    os.close(write)
    with os.fdopen(read, "rb") as pipe:
        assert content(pipe) == b"1 2 3\n"


@pytest.mark.parametrize("array", [POINTS, POINTS.astype(np.float32), POINTS.tolist()])
def test_arrays_are_numpy_files(array: object) -> None:
    loaded = np.load(io.BytesIO(content(array)), allow_pickle=False)
    np.testing.assert_array_equal(loaded, POINTS)


@pytest.mark.parametrize(
    ("cloud", "reference"),
    [
        ("https://host/a.ply", {"url": "https://host/a.ply"}),
        ("s3://bucket/a.ply", {"url": "s3://bucket/a.ply"}),
        (StoredCloud("door"), {"cloud": "door"}),
    ],
)
def test_what_the_service_has_is_a_reference(cloud: object, reference: dict[str, str]) -> None:
    with ExitStack() as stack:
        assert open_cloud(cloud, stack) == reference


@pytest.mark.parametrize("cloud", [np.zeros(3), np.zeros((4, 2)), None, io.StringIO("1 2 3")])
def test_other_things_are_named(cloud: object) -> None:
    with ExitStack() as stack, pytest.raises(TypeError, match="expected a"):
        open_cloud(cloud, stack)
