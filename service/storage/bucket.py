"""A bucket of an S3 store: objects by key, and errors of the store as errors of the service."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from service.problems import BlobsUnavailableError
from service.settings import BlobSettings

if TYPE_CHECKING:
    from obstore.store import S3Config, S3Store

PART_BYTES = 8 << 20
"""Length of a part of an upload in bytes; S3 takes 10,000 parts."""
PARTS_AT_ONCE = 4
"""Parts that one upload sends at the same time; each is in memory."""
CHUNK_BYTES = 1 << 20
"""Least length of a chunk of a download, in bytes."""
CONNECT_TIMEOUT_S = 5
READ_TIMEOUT_S = 20
"""Longest wait for bytes of the store, in seconds."""
RETRIES = 3
RETRY_TIMEOUT_S = 15
"""Time in which a request is repeated, in seconds: shorter than the lease of an attempt."""

log = logging.getLogger(__name__)


class Bucket:
    """Objects below the prefix of MPE_BLOB_URL; safe for threads.

    Methods raise BlobsUnavailableError when the store does not answer or refuses the key.
    """

    def __init__(self, settings: BlobSettings) -> None:
        self._store = _open_store(settings)
        self._signer = None
        if settings.public_endpoint is not None:
            public = settings.model_copy(update={"endpoint": settings.public_endpoint})
            self._signer = _open_store(public)

    @property
    def can_sign(self) -> bool:
        """Whether callers reach the store: MPE_BLOB_PUBLIC_ENDPOINT says where."""
        return self._signer is not None

    def sign(self, method: Literal["GET", "PUT"], key: str, *, seconds: float) -> str:
        """Return a URL by which a caller without a key reads or writes an object for a while."""
        import obstore

        assert self._signer is not None  # noqa: S101
        return obstore.sign(self._signer, method, key, timedelta(seconds=seconds))

    def find_size(self, key: str) -> int:
        """Return the length of an object in bytes.

        Raises
        ------
        FileNotFoundError
            There is none of this key.
        """
        import obstore

        with _translate_errors():
            return obstore.head(self._store, key)["size"]

    def upload(self, key: str, path: Path) -> None:
        """Store a file, in parts where it is long; the store checks the SHA-256 of each part."""
        import obstore

        with _translate_errors():
            obstore.put(
                self._store, key, path, chunk_size=PART_BYTES, max_concurrency=PARTS_AT_ONCE
            )

    def download(self, key: str) -> Iterator[bytes]:
        """Yield the content of an object in chunks.

        Raises
        ------
        FileNotFoundError
            There is none of this key.
        """
        import obstore

        with _translate_errors():
            for chunk in obstore.get(self._store, key).stream(min_chunk_size=CHUNK_BYTES):
                yield bytes(chunk)

    def copy(self, key: str, new_key: str) -> None:
        """Copy an object within the store.

        Raises
        ------
        FileNotFoundError
            There is none of this key.
        """
        import obstore

        with _translate_errors():
            obstore.copy(self._store, key, new_key)

    def find_keys(self, prefix: str) -> list[str]:
        """Return the keys below a prefix, which ends at a slash, in order."""
        return sorted(self.find_sizes(prefix))

    def find_sizes(self, prefix: str) -> dict[str, int]:
        """Return the keys below a prefix, which ends at a slash, with the length of each object."""
        import obstore

        with _translate_errors():
            pages = obstore.list(self._store, prefix)
            return {item["path"]: item["size"] for page in pages for item in page}

    def delete(self, keys: list[str]) -> None:
        """Delete objects; those that do not exist count as deleted."""
        import obstore

        with _translate_errors():
            obstore.delete(self._store, keys)


def _open_store(settings: BlobSettings) -> S3Store:
    from obstore.store import S3Store

    assert settings.url is not None  # noqa: S101
    name, _, prefix = settings.url.removeprefix("s3://").partition("/")
    config: S3Config = {"region": settings.region, "checksum_algorithm": "SHA256"}
    if settings.endpoint is not None:
        config["endpoint"] = settings.endpoint
    if settings.access_key_id is not None and settings.secret_access_key is not None:
        config["access_key_id"] = settings.access_key_id
        config["secret_access_key"] = settings.secret_access_key.get_secret_value()
    return S3Store(
        name,
        prefix=prefix.strip("/") or None,
        config=config,
        client_options={
            "allow_http": True,  # as MPE_BLOB_ENDPOINT says
            "connect_timeout": timedelta(seconds=CONNECT_TIMEOUT_S),
            "read_timeout": timedelta(seconds=READ_TIMEOUT_S),
        },
        retry_config={
            "max_retries": RETRIES,
            "retry_timeout": timedelta(seconds=RETRY_TIMEOUT_S),
        },
    )


@contextmanager
def _translate_errors() -> Iterator[None]:
    import obstore

    try:
        yield
    except obstore.exceptions.BaseError as error:
        log.error("the store of the files does not answer: %s", str(error).partition("\n")[0])
        raise BlobsUnavailableError(
            "The store of the files does not answer; retry later."
        ) from error
