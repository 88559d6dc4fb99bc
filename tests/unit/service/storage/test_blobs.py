"""Blobs appear whole or not at all, in a directory and in a bucket."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path

import pytest

from service.storage.blobs import Blob, BlobStore
from tests.factories.clock_of_tests import GRACE_S, Clock

UNKNOWN = hashlib.sha256(b"unknown").hexdigest()


@pytest.fixture(params=["directory", "bucket"])
def store(request: pytest.FixtureRequest, tmp_path: Path) -> BlobStore:
    if request.param == "directory":
        return BlobStore(tmp_path / "here")
    made: BlobStore = request.getfixturevalue("open_s3")()
    return made


def collect(store: BlobStore, clock: Clock, *needed: Blob, after_s: float) -> None:
    clock.wait(after_s)
    names = {blob.sha256 for blob in needed}
    store.collect(lambda: names, now=clock.now, grace_s=GRACE_S)
    store.collect_shared(lambda: names, grace_s=GRACE_S)


def test_blob_is_named_by_its_content(store: BlobStore) -> None:
    blob = store.put([b"ab", b"c"])
    assert blob == Blob(hashlib.sha256(b"abc").hexdigest(), 3)
    assert store.exists(blob.sha256)
    assert store.is_whole(blob.sha256)
    assert store.fetch(blob.sha256).read_bytes() == b"abc"
    with store.hold(blob.sha256) as path:
        assert path.read_bytes() == b"abc"


def test_a_finished_file_is_moved(store: BlobStore, tmp_path: Path) -> None:
    path = tmp_path / "finished"
    path.write_bytes(b"abc")
    assert store.fetch(store.adopt(path).sha256).read_bytes() == b"abc"
    assert not path.exists()


def test_the_same_content_is_one_blob(store: BlobStore) -> None:
    assert store.put([b"abc"]) == store.put([b"a", b"bc"])


def test_what_is_not_committed_leaves_nothing(store: BlobStore) -> None:
    with store.writer() as writer:
        writer.write(b"half")
    assert not store.exists(hashlib.sha256(b"half").hexdigest())
    assert not list(store.incoming.iterdir())


def test_what_is_not_stored_is_said_to_be_missing(store: BlobStore) -> None:
    assert not store.exists(UNKNOWN)
    for call in (store.fetch, store.touch, store.is_whole):
        with pytest.raises(FileNotFoundError):
            call(UNKNOWN)
    with pytest.raises(FileNotFoundError), store.hold(UNKNOWN):
        pass


def test_only_old_blobs_that_nobody_needs_are_collected(store: BlobStore, clock: Clock) -> None:
    needed, unneeded = (store.put([content]) for content in (b"a", b"b"))
    collect(store, clock, needed, after_s=0)
    collect(store, clock, needed, after_s=GRACE_S - 60)
    assert store.exists(unneeded.sha256)
    young = store.put([b"c"])
    for _ in range(2):
        collect(store, clock, needed, young, after_s=GRACE_S + 1)
    assert not store.exists(unneeded.sha256)
    for blob in (needed, young):
        assert store.is_whole(blob.sha256)


def test_a_blob_that_was_needed_a_moment_ago_is_spared(store: BlobStore, clock: Clock) -> None:
    """However old it is: who has read the row that named it must be able to open it."""
    blob = store.put([b"a"])
    collect(store, clock, blob, after_s=3600)
    collect(store, clock, after_s=60)
    collect(store, clock, after_s=GRACE_S - 60)
    collect(store, clock, blob, after_s=0)
    collect(store, clock, after_s=120)
    assert store.fetch(blob.sha256).read_bytes() == b"a"
    collect(store, clock, after_s=GRACE_S + 60)
    assert not store.exists(blob.sha256)


@pytest.mark.parametrize("again", [lambda s, b: s.put([b"a"]), lambda s, b: s.touch(b.sha256)])
def test_a_blob_that_is_stored_or_touched_again_is_young(
    store: BlobStore, clock: Clock, again: Callable[[BlobStore, Blob], object]
) -> None:
    blob = store.put([b"a"])
    collect(store, clock, blob, after_s=3600)
    collect(store, clock, after_s=1)
    again(store, blob)
    collect(store, clock, after_s=GRACE_S / 2)
    assert store.is_whole(blob.sha256)


def test_what_a_dead_process_left_is_removed(store: BlobStore) -> None:
    kept = store.put([b"kept"])
    (store.incoming / "blob-left").write_bytes(b"half")
    store.discard_incoming()
    assert not list(store.incoming.iterdir())
    assert store.fetch(kept.sha256).read_bytes() == b"kept"


def test_what_another_service_is_writing_is_left_alone(store: BlobStore) -> None:
    with store.writer() as writer:
        writer.write(b"half")
        BlobStore(store.root).discard_incoming()
        blob = writer.commit()
    assert store.fetch(blob.sha256).read_bytes() == b"half"
