"""Clouds that are stored once and referred to by many registrations."""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from sqlalchemy import ColumnElement, Row, and_, delete, insert, select, update

from service.clouds.inputs import CloudInput
from service.database.engine import Database
from service.database.pagination import Place, select_page
from service.database.tables import clouds
from service.formats import UnknownFormatError, sniff_file
from service.problems import InvalidRequestError, UnknownCloudError
from service.storage.blobs import Blob, BlobStore


@dataclass(frozen=True, slots=True)
class StoredCloud:
    """A cloud; times in seconds since the epoch, UTC."""

    tenant: str
    id: str
    sha256: str
    size: int
    """Length of the file in bytes."""
    format: str
    declared: bool
    """Whether the caller named the format; else the content did."""
    created_at: float
    expires_at: float


class CloudStore:
    """Clouds in the database; a cloud that is not used for `retention_s` is dropped."""

    def __init__(self, database: Database, blobs: BlobStore, *, retention_s: float) -> None:
        self._database = database
        self._blobs = blobs
        self._retention_s = retention_s

    def put(
        self, tenant: str, cloud_id: str, blob: Blob, declared: str | None = None
    ) -> StoredCloud:
        """Store the blob as the tenant's cloud of this id, in place of a former one.

        `declared` is its format where the content does not tell.
        """
        now = time.time()
        cloud = StoredCloud(
            tenant=tenant,
            id=cloud_id,
            sha256=blob.sha256,
            size=blob.size,
            format=detect_format("cloud", blob, self._blobs, declared),
            declared=declared is not None,
            created_at=now,
            expires_at=now + self._retention_s,
        )
        with self._database.write(exclusive=True) as connection:
            connection.execute(delete(clouds).where(_named(tenant, cloud_id)))
            connection.execute(insert(clouds).values(**asdict(cloud)))
        return cloud

    def adopt(
        self, tenant: str, cloud_id: str, path: Path, declared: str | None = None
    ) -> StoredCloud:
        """Store a finished file as `put` does; the file is moved away."""
        return self.put(tenant, cloud_id, self._blobs.adopt(path), declared)

    def get(self, tenant: str, cloud_id: str) -> StoredCloud:
        """The tenant's cloud; UnknownCloudError when there is none."""
        query = select(clouds).where(_named(tenant, cloud_id))
        with self._database.read() as connection:
            return _known(connection.execute(query).one_or_none())

    def use(self, tenant: str, cloud_id: str) -> CloudInput:
        """The cloud as the input of a job, and one more period to live."""
        expires_at = time.time() + self._retention_s
        used = update(clouds).where(_named(tenant, cloud_id)).values(expires_at=expires_at)
        with self._database.write() as connection:
            cloud = _known(connection.execute(used.returning(clouds)).one_or_none())
        self._blobs.touch(cloud.sha256)
        reading = {"format": cloud.format} if cloud.declared else {}
        return CloudInput(cloud.sha256, cloud.size, cloud=cloud.id, reading=reading)

    def page(self, tenant: str, *, limit: int, before: Place | None) -> list[StoredCloud]:
        """Up to `limit` clouds, newest first, from the place where the page before ended."""
        query = select_page(clouds, before=before, limit=limit).where(clouds.c.tenant == tenant)
        with self._database.read() as connection:
            return [_known(row) for row in connection.execute(query)]

    def remove(self, tenant: str, cloud_id: str) -> None:
        """Forget the tenant's cloud; UnknownCloudError when there is none."""
        with self._database.write() as connection:
            if connection.execute(delete(clouds).where(_named(tenant, cloud_id))).rowcount == 0:
                _known(None)


def detect_format(role: str, blob: Blob, blobs: BlobStore, declared: str | None = None) -> str:
    """Name of the format that is declared or that the file begins like; nothing is decoded here.

    Raises
    ------
    InvalidRequestError
        The file is empty.
    UnknownFormatError
        It begins like none of the formats.
    """
    if blob.size == 0:
        raise InvalidRequestError(f"{role}: the file is empty.")
    if declared is not None:
        return declared
    try:
        return sniff_file(blobs.path(blob.sha256))
    except UnknownFormatError as error:
        raise UnknownFormatError(f"{role}: {error}") from None


def _named(tenant: str, cloud_id: str) -> ColumnElement[bool]:
    return and_(clouds.c.tenant == tenant, clouds.c.id == cloud_id)


def _known(row: Row[Any] | None) -> StoredCloud:
    if row is None:
        raise UnknownCloudError("No cloud has this id; it may have expired.")
    return StoredCloud(**row._mapping)
