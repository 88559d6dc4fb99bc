"""Clouds that are stored once and referred to by many jobs."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from sqlalchemy import ColumnElement, Row, and_, delete, insert, select, update

from service.clouds.inputs import CloudInput
from service.database.clock import now, read_time
from service.database.engine import Database
from service.database.pagination import Place, select_page
from service.database.tables import clouds
from service.formats import UnknownFormatError, sniff_file
from service.problems import ExpiredError, InvalidRequestError, UnknownCloudError
from service.storage.blobs import Blob, BlobStore


@dataclass(frozen=True, slots=True)
class StoredCloud:
    """A row of the clouds table; times in seconds since the epoch, UTC."""

    tenant: str
    id: str
    sha256: str
    size: int
    """Length of the file in bytes."""
    format: str
    """Name of the format, one of `service.formats.FORMATS`."""
    declared: bool
    """Whether the caller named the format; otherwise the content shows it."""
    created_at: float
    expires_at: float


class CloudStore:
    """Stored clouds of all tenants; one that is not used for `retention_s` seconds expires."""

    def __init__(self, database: Database, blobs: BlobStore, *, retention_s: float) -> None:
        self._database = database
        self._blobs = blobs
        self._retention_s = retention_s

    def put(
        self, tenant: str, cloud_id: str, blob: Blob, declared: str | None = None
    ) -> StoredCloud:
        """Store a blob as the tenant's cloud of this id, and replace an earlier one.

        Parameters
        ----------
        declared
            Name of the file's format; None: by content.

        Raises
        ------
        InvalidRequestError
            The file is empty.
        UnknownFormatError
            The content matches no format.
        """
        with self._database.read() as connection:
            moment = read_time(connection)
        cloud = StoredCloud(
            tenant=tenant,
            id=cloud_id,
            sha256=blob.sha256,
            size=blob.size,
            format=detect_format("cloud", blob, self._blobs, declared),
            declared=declared is not None,
            created_at=moment,
            expires_at=moment + self._retention_s,
        )
        with self._database.write(exclusive=True) as connection:
            connection.execute(delete(clouds).where(_is(tenant, cloud_id)))
            connection.execute(insert(clouds).values(**asdict(cloud)))
        return cloud

    def adopt(
        self, tenant: str, cloud_id: str, path: Path, declared: str | None = None
    ) -> StoredCloud:
        """Move a finished file into the store and `put` it."""
        return self.put(tenant, cloud_id, self._blobs.adopt(path), declared)

    def get(self, tenant: str, cloud_id: str) -> StoredCloud:
        """Return the tenant's cloud.

        Raises
        ------
        UnknownCloudError
            There is none of this id.
        """
        query = select(clouds).where(_is(tenant, cloud_id))
        with self._database.read() as connection:
            row = connection.execute(query).one_or_none()
        if row is None:
            raise _unknown()
        return _from_row(row)

    def use(self, tenant: str, cloud_id: str) -> CloudInput:
        """Return the tenant's cloud as an input of a job, and postpone its expiry.

        Raises
        ------
        UnknownCloudError
            There is none of this id.
        ExpiredError
            Its file is missing in the store.
        """
        expires_at = now() + self._retention_s
        postpone = update(clouds).where(_is(tenant, cloud_id)).values(expires_at=expires_at)
        with self._database.write() as connection:
            row = connection.execute(postpone.returning(clouds)).one_or_none()
        if row is None:
            raise _unknown()
        cloud = _from_row(row)
        try:
            self._blobs.touch(cloud.sha256)
        except FileNotFoundError as error:
            raise ExpiredError(
                f"The file of the cloud {cloud.id} is missing in the store; store the cloud again."
            ) from error
        reading = {"format": cloud.format} if cloud.declared else {}
        return CloudInput(cloud.sha256, cloud.size, cloud=cloud.id, reading=reading)

    def page(self, tenant: str, *, limit: int, before: Place | None) -> list[StoredCloud]:
        """Return up to `limit` clouds, newest first, after the place where the last page ended."""
        query = select_page(clouds, before=before, limit=limit).where(clouds.c.tenant == tenant)
        with self._database.read() as connection:
            return [_from_row(row) for row in connection.execute(query)]

    def remove(self, tenant: str, cloud_id: str) -> None:
        """Delete the tenant's cloud; jobs that refer to it keep its blob.

        Raises
        ------
        UnknownCloudError
            There is none of this id.
        """
        with self._database.write() as connection:
            if connection.execute(delete(clouds).where(_is(tenant, cloud_id))).rowcount == 0:
                raise _unknown()


def detect_format(role: str, blob: Blob, blobs: BlobStore, declared: str | None = None) -> str:
    """Return the declared format, or that of the file's first bytes; nothing is decoded.

    Parameters
    ----------
    role
        Which cloud this is, for the text of errors: "source", "target" or "cloud".

    Raises
    ------
    InvalidRequestError
        The file is empty.
    UnknownFormatError
        The content matches no format.
    """
    if blob.size == 0:
        raise InvalidRequestError(f"{role}: the file is empty.")
    if declared is not None:
        return declared
    try:
        return sniff_file(blobs.fetch(blob.sha256))
    except UnknownFormatError as error:
        raise UnknownFormatError(f"{role}: {error}") from None


def _is(tenant: str, cloud_id: str) -> ColumnElement[bool]:
    return and_(clouds.c.tenant == tenant, clouds.c.id == cloud_id)


def _from_row(row: Row[Any]) -> StoredCloud:
    return StoredCloud(**row._mapping)


def _unknown() -> UnknownCloudError:
    return UnknownCloudError("No cloud has this id; it may have expired.")
