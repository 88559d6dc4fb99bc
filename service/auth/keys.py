"""API keys: who may call, for which tenant, and how much.

A key is `mpe_<id>_<secret>`; the id finds its row, the secret has 256 random bits. Its SHA-256 is
all that is stored. A slow hash or a salt would gain nothing: they defend words that people choose
against lists of guesses, and of 2^256 equally likely secrets there is no list.
"""

from __future__ import annotations

import hashlib
import hmac
import re
import secrets
import time
from dataclasses import asdict, dataclass
from typing import Any

from sqlalchemy import Row, insert, select, update

from service.database.engine import Database
from service.database.tables import api_keys

DEFAULT_TENANT = "default"
"""Whose everything is that is sent without a key."""
TENANT_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}")
_KEY = re.compile(r"mpe_(?P<id>[0-9a-f]{16})_(?P<secret>[A-Za-z0-9_-]{43})", re.ASCII)


@dataclass(frozen=True, slots=True)
class Limits:
    """What may be used with a key; None: no limit, or that of the settings."""

    requests_per_s: float | None = None
    queue_limit: int | None = None
    """Registrations of the tenant that may wait."""
    stored_bytes: int | None = None
    """Bytes that may be kept for the tenant."""


@dataclass(frozen=True, slots=True)
class ApiKey:
    """A key without its secret; times in seconds since the epoch, UTC."""

    id: str
    tenant: str
    name: str
    secret_sha256: str
    created_at: float
    revoked_at: float | None
    limits: Limits

    def admits(self, secret: str) -> bool:
        """Whether it is in force, and this its secret; takes the same time for every secret."""
        same = hmac.compare_digest(_hash(secret), self.secret_sha256)
        return same and self.revoked_at is None


def split_key(key: str) -> tuple[str, str] | None:
    """Id and secret of a key; None when it does not look like one."""
    found = _KEY.fullmatch(key)
    return None if found is None else (found["id"], found["secret"])


class KeyStore:
    """Keys in the database."""

    def __init__(self, database: Database) -> None:
        self._database = database

    def create(self, tenant: str, name: str, limits: Limits) -> str:
        """A new key: the only time that it is seen whole. ValueError when no tenant can be so."""
        if not TENANT_NAME.fullmatch(tenant):
            raise ValueError(
                "a tenant is named by up to 64 letters, digits, dots, hyphens and underscores, "
                "the first a letter or a digit"
            )
        key_id, secret = secrets.token_hex(8), secrets.token_urlsafe(32)
        row = {"id": key_id, "tenant": tenant, "name": name, "secret_sha256": _hash(secret)}
        with self._database.write() as connection:
            connection.execute(
                insert(api_keys).values(**row, created_at=time.time(), **asdict(limits))
            )
        return f"mpe_{key_id}_{secret}"

    def all(self) -> list[ApiKey]:
        """Every key, revoked ones too, oldest first."""
        with self._database.read() as connection:
            rows = connection.execute(select(api_keys).order_by(api_keys.c.created_at))
            return [_key_of(row) for row in rows]

    def find(self, key_id: str) -> ApiKey | None:
        """The key of this id, or None."""
        with self._database.read() as connection:
            row = connection.execute(select(api_keys).where(api_keys.c.id == key_id)).one_or_none()
        return None if row is None else _key_of(row)

    def exist(self) -> bool:
        """Whether a key was ever made; from then on the service is closed to callers without."""
        with self._database.read() as connection:
            return connection.execute(select(api_keys.c.id).limit(1)).first() is not None

    def revoke(self, key_id: str) -> bool:
        """Put a key out of force; False when there is none of this id, or not any more."""
        valid = (api_keys.c.id == key_id, api_keys.c.revoked_at.is_(None))
        with self._database.write() as connection:
            change = update(api_keys).where(*valid).values(revoked_at=time.time())
            return connection.execute(change).rowcount == 1


def _hash(secret: str) -> str:
    return hashlib.sha256(secret.encode()).hexdigest()


def _key_of(row: Row[Any]) -> ApiKey:
    values = dict(row._mapping)
    limits = Limits(**{name: values.pop(name) for name in Limits.__dataclass_fields__})
    return ApiKey(**values, limits=limits)
