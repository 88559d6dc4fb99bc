"""Sniffers run in the API process: they take linear time, and no text is taken for a binary."""

from __future__ import annotations

import contextlib
import random
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from service.formats import FORMATS, CloudFileError, UnknownFormatError, read_points, sniff
from service.formats.foreign import foreign_format
from service.formats.read import SNIFFED_BYTES
from service.formats.text_encoding import to_plain_head
from tests.factories.cloud_files import seeds
from tests.factories.decoding import decode, write_file
from tests.factories.scanner_files import kitti, scanner_seeds, stl_binary

TRUSTED_SECONDS = 0.05
"""Processor time of one sniffer for one head below which its growth is not asked for."""
MAX_GROWTH = 8
"""Of the time when a head is four times as long: a linear sniffer has 4, a quadratic one 16."""
MAX_READ_S = 2.0
"""Processor time of three ways to read a small file; the exponential expressions took minutes."""
PREFIXES = (
    *(b"", b"1\n1\n", b"1\n1\n1 1 ", b"x,y,z\n", b"# x y z\n", b"#", b"OFF", b"VERSION", b"{"),
    *(b"solid facet", b"a,b,c,d\n", b"40\n", b"x;y;z\n1", b"(", b"[x"),
)
UNITS = (
    *(
        b"1",
        b"11111111 11111111 11111111\n",
        b"1.",
        b"1 ",
        b"1\n",
        b"1,2\n",
        b"1;1\n",
        b"1,1,1,x\n",
    ),
    *(
        b"a",
        b"a\n",
        b"a b c\n",
        b"x y z\n",
        b"x,y,z\n",
        b"#",
        b"#\n",
        b"# x y z\n",
        b" ",
        b"\n",
        b"\t",
    ),
    *(b"(", b"[", b"[(", b")]", b'"', b",", b";", b"-", b"e", b"1e", b".", b"\r", b"{", b'"asset"'),
    *(b"OFF", b"ncols\n", b"\xff", b"\0", b"_m"),
)
SNIFFERS: dict[str, Callable[[bytes], object]] = {
    **{item.name: item.sniff for item in FORMATS if item.sniff},
    "foreign": foreign_format,
    "archives": to_plain_head,
}


@pytest.mark.parametrize("name", SNIFFERS)
def test_sniffers_take_linear_time(name: str) -> None:
    def seconds(prefix: bytes, unit: bytes, length: int) -> float:
        head = (prefix + unit * length)[: length - 1] + b"x"
        started = time.thread_time()
        SNIFFERS[name](head)
        return time.thread_time() - started

    for prefix in PREFIXES:
        for unit in UNITS:
            whole = seconds(prefix, unit, SNIFFED_BYTES)
            if whole > TRUSTED_SECONDS:
                quarter = seconds(prefix, unit, SNIFFED_BYTES // 4)
                assert whole < MAX_GROWTH * quarter, (prefix, unit)


def test_whole_numbers_after_two_counts_do_not_freeze(tmp_path: Path) -> None:
    """The header of PTX once took exponential time, also for files without any malice."""
    evil = b"1\n1\n" + b"11111111 11111111 11111111\n" * 4 + b"x" * 40
    rng = random.Random(1)
    rows = [tuple(rng.randrange(100_000, 999_999) for _ in range(3)) for _ in range(80)]
    innocent = b"40\n2\n" + b"".join(b"%d %d %d\n" % row for row in rows)
    for content in (evil, innocent, b"1\n1\n1 1 " + b"1" * 60_000 + b"x"):
        started = time.thread_time()
        for format in (None, "ptx", "xyz"):
            with contextlib.suppress(CloudFileError):
                read_points(write_file(tmp_path, content), format=format)
        assert time.thread_time() - started < MAX_READ_S


@given(st.binary(max_size=600))
@settings(max_examples=200, deadline=None)
def test_sniffing_never_fails(head: bytes) -> None:
    assert sniff(head) is None or sniff(head) in {format.name for format in FORMATS}


@given(
    columns=st.integers(3, 24),
    digits=st.sampled_from(["%.15g", "%.6f", "%d", "%g"]),
    delimiter=st.sampled_from([",", ";", "\t", " "]),
    seed=st.integers(0, 2**32 - 1),
)
@settings(max_examples=100, deadline=None)
def test_tables_of_numbers_are_text(columns: int, digits: str, delimiter: str, seed: int) -> None:
    table = np.random.default_rng(seed).normal(0, 50, (60, columns))
    text = "".join(delimiter.join(digits % value for value in row) + "\n" for row in table)
    assert sniff(text.encode()[:SNIFFED_BYTES]) == "xyz"


def test_every_seed_is_sniffed_as_its_own_kind() -> None:
    for kind, content in (seeds() | scanner_seeds()).items():
        expected = {"csv": "xyz", "pts": "xyz", "laz": "las", "npz": "zip", "glb": "gltf"}
        assert sniff(content) == expected.get(kind.split()[0], kind.split()[0])


@pytest.mark.parametrize("name", [b"Exported from Blender", b"solid idler", b""])
def test_rounding_noise_does_not_hide_an_stl(tmp_path: Path, name: bytes) -> None:
    content = bytearray(name.ljust(80, b"\0") + stl_binary()[80:])
    content[84:96] = np.array([0, 6.1e-17, 1], "<f4").tobytes()
    content[96:100] = np.array(2.3e-17, "<f4").tobytes()
    assert sniff(bytes(content)) == "stl"
    assert decode(tmp_path, bytes(content)).format == "stl"


def test_rows_of_floats_are_told_to_be_declared(tmp_path: Path) -> None:
    with pytest.raises(UnknownFormatError, match=r"float32: declare the format 'kitti'"):
        decode(tmp_path, kitti())
