"""Decoded clouds are kept for the tenant that referred to them, and for nobody else."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from service.formats import DecodedCloud, ReadLimits
from service.storage.decoded_cache import DecodedCache, decoded_path, load_or_decode

HASH = "ab" * 32
LIMITS = ReadLimits()
POINTS = np.random.default_rng(0).normal(size=(50, 3))


@pytest.fixture
def prepared(tmp_path: Path) -> DecodedCache:
    (tmp_path / "scratch").mkdir()
    return DecodedCache(tmp_path)


def decodings(
    prepared: DecodedCache, scratch: Path, *tenants: str, limits: ReadLimits = LIMITS
) -> int:
    """How often the file is decoded when these tenants refer to it in turn."""
    count = 0

    def decode() -> DecodedCloud:
        nonlocal count
        count += 1
        return DecodedCloud(POINTS, "ply", ("odd",))

    for tenant in tenants:
        cloud = load_or_decode(decoded_path(scratch.parent, tenant, HASH), decode, scratch, limits)
        prepared.adopt(tenant, HASH, scratch)
        np.testing.assert_array_equal(cloud.points, POINTS)
        assert (cloud.format, cloud.warnings) == ("ply", ("odd",))
    return count


def test_once_for_each_tenant(prepared: DecodedCache, tmp_path: Path) -> None:
    assert decodings(prepared, tmp_path / "scratch", "lab", "lab", "lab-2", "lab") == 2


def test_nothing_is_kept_where_it_leaves_too_little_of_the_disk(
    prepared: DecodedCache, tmp_path: Path
) -> None:
    short = ReadLimits(min_free_disk_bytes=2**60)
    assert decodings(prepared, tmp_path / "scratch", "lab", "lab", limits=short) == 2
    assert not list((tmp_path / "scratch").iterdir())


def test_what_one_tenant_needs_no_more_is_dropped(prepared: DecodedCache, tmp_path: Path) -> None:
    scratch = tmp_path / "scratch"
    assert decodings(prepared, scratch, "lab", "lab-2") == 2
    prepared.collect({("lab-2", HASH), ("lab", "cd" * 32)})
    assert decodings(prepared, scratch, "lab-2") == 0
    assert decodings(prepared, scratch, "lab") == 1


def test_the_folder_may_be_removed_at_any_time(prepared: DecodedCache, tmp_path: Path) -> None:
    (tmp_path / "prepared").rmdir()
    prepared.collect(set())
    assert decodings(prepared, tmp_path / "scratch", "lab", "lab") == 1


def test_a_link_is_not_taken_up(prepared: DecodedCache, tmp_path: Path) -> None:
    final = decoded_path(tmp_path, "lab", HASH)
    (tmp_path / "secret").write_text("secret")
    (tmp_path / "scratch" / final.name).symlink_to(tmp_path / "secret")
    prepared.adopt("lab", HASH, tmp_path / "scratch")
    assert not final.exists()
