"""Blobs appear whole or not at all."""

from __future__ import annotations

import hashlib
import os
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from service.storage.blobs import Blob, BlobStore


def files(store: BlobStore) -> list[Path]:
    return [path for path in store.root.glob("*/**/*") if path.is_file()]


def test_blob_is_named_by_its_content(tmp_path: Path) -> None:
    store = BlobStore(tmp_path)
    blob = store.put([b"ab", b"c"])
    assert blob.sha256 == hashlib.sha256(b"abc").hexdigest()
    assert blob.size == 3
    assert store.path(blob.sha256).read_bytes() == b"abc"


def test_the_same_content_is_stored_once(tmp_path: Path) -> None:
    store = BlobStore(tmp_path)
    assert store.put([b"abc"]) == store.put([b"a", b"bc"])
    assert len(files(store)) == 1


def test_what_is_not_committed_leaves_nothing(tmp_path: Path) -> None:
    store = BlobStore(tmp_path)
    with store.writer() as writer:
        writer.write(b"half")
    assert files(store) == []


GRACE_S = 600


def collect(store: BlobStore, *needed: Blob, in_s: float) -> int:
    """Collect as if that much time had passed."""
    names = {blob.sha256 for blob in needed}
    return store.collect(lambda: names, now=time.time() + in_s, grace_s=GRACE_S)


def test_only_old_blobs_that_nobody_needs_are_collected(tmp_path: Path) -> None:
    store = BlobStore(tmp_path)
    needed, unneeded, young = (store.put([content]) for content in (b"a", b"b", b"c"))
    for blob in (needed, unneeded):
        os.utime(store.path(blob.sha256), (0, 0))
    assert collect(store, needed, in_s=-GRACE_S) == 0
    assert collect(store, needed, in_s=1) == 1
    assert set(files(store)) == {
        store.path(needed.sha256),
        store.path(young.sha256),
    }


def test_a_blob_that_was_needed_a_moment_ago_is_spared(tmp_path: Path) -> None:
    """However old it is: who has read the row that named it must be able to open it."""
    store = BlobStore(tmp_path)
    blob = store.put([b"a"])
    hour, moment = 3600, 60
    assert collect(store, blob, in_s=hour) == 0
    assert collect(store, in_s=hour + moment) == 0
    assert collect(store, in_s=hour + GRACE_S) == 0
    assert collect(store, blob, in_s=hour + GRACE_S) == 0
    assert collect(store, in_s=hour + GRACE_S + 2 * moment) == 0
    assert store.path(blob.sha256).read_bytes() == b"a"
    assert collect(store, in_s=hour + 2 * GRACE_S + 3 * moment) == 1
    assert files(store) == []


@pytest.mark.parametrize("again", [lambda s, b: s.put([b"a"]), lambda s, b: s.touch(b.sha256)])
def test_a_blob_that_is_stored_or_touched_again_is_young(
    tmp_path: Path, again: Callable[[BlobStore, Blob], object]
) -> None:
    store = BlobStore(tmp_path)
    blob = store.put([b"a"])
    os.utime(store.path(blob.sha256), (0, 0))
    assert collect(store, in_s=-GRACE_S) == 0
    again(store, blob)
    assert collect(store, in_s=60) == 0
    assert collect(store, in_s=GRACE_S + 120) == 0
    assert collect(store, in_s=2 * GRACE_S + 180) == 1
    with pytest.raises(FileNotFoundError):
        store.touch(blob.sha256)
    assert files(store) == []


def test_what_a_dead_process_left_is_removed(tmp_path: Path) -> None:
    store = BlobStore(tmp_path)
    kept = store.put([b"kept"])
    (store.incoming / "blob-left").write_bytes(b"half")
    store.discard_incoming()
    assert files(store) == [store.path(kept.sha256)]


def test_what_another_service_is_writing_is_left_alone(tmp_path: Path) -> None:
    store = BlobStore(tmp_path)
    with store.writer() as writer:
        writer.write(b"half")
        BlobStore(tmp_path).discard_incoming()
        blob = writer.commit()
    assert store.path(blob.sha256).read_bytes() == b"half"
