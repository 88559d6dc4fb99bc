"""API keys: which tenant a caller acts for, and how much it may use.

A key is `mpe_<id>_<secret>`. The id finds the row; the secret has 256 random bits, of which only
the SHA-256 is stored. A slow or salted hash would gain nothing: it protects passwords that can be
guessed from a list, and no list covers 2^256 equally likely secrets.
"""

from __future__ import annotations

import hashlib
import hmac
import re
import secrets
import time
from dataclasses import asdict, dataclass, fields
from typing import Any

from sqlalchemy import Row, insert, select, update

from service.database.engine import Database
from service.database.tables import api_keys

DEFAULT_TENANT = "default"
"""Tenant of all requests without a key."""
TENANT_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}")
_KEY = re.compile(r"mpe_(?P<id>[0-9a-f]{16})_(?P<secret>[A-Za-z0-9_-]{43})", re.ASCII)


@dataclass(frozen=True, slots=True)
class KeyLimits:
    """What a key may use. None in a stored key: the default of the settings; else: unlimited."""

    requests_per_s: float | None = None
    queue_limit: int | None = None
    """Registrations of the tenant that may wait."""
    stored_bytes: int | None = None
    """Bytes that the tenant may have stored."""


@dataclass(frozen=True, slots=True)
class ApiKey:
    """A key without its secret; times in seconds since the epoch, UTC."""

    id: str
    tenant: str
    name: str
    secret_sha256: str
    created_at: float
    revoked_at: float | None
    limits: KeyLimits

    def verify_secret(self, secret: str) -> bool:
        """Tell whether the key is valid and this is its secret, in constant time."""
        is_equal = hmac.compare_digest(_hash(secret), self.secret_sha256)
        return is_equal and self.revoked_at is None


def split_key(key: str) -> tuple[str, str] | None:
    """Return id and secret of a key; None for text of another form."""
    match = _KEY.fullmatch(key)
    return None if match is None else (match["id"], match["secret"])


class KeyStore:
    """Keys in the database."""

    def __init__(self, database: Database) -> None:
        self._database = database

    def create(self, tenant: str, name: str, limits: KeyLimits) -> str:
        """Create a key and return it; its secret is not stored and cannot be read again.

        Raises
        ------
        ValueError
            The tenant's name is not valid.
        """
        if not TENANT_NAME.fullmatch(tenant):
            raise ValueError(
                "a tenant's name must have 1 to 64 letters, digits, dots, hyphens and underscores, "
                f"beginning with a letter or a digit; got {tenant[:80]!r}"
            )
        key_id, secret = secrets.token_hex(8), secrets.token_urlsafe(32)
        row = {"id": key_id, "tenant": tenant, "name": name, "secret_sha256": _hash(secret)}
        with self._database.write() as connection:
            connection.execute(
                insert(api_keys).values(**row, created_at=time.time(), **asdict(limits))
            )
        return f"mpe_{key_id}_{secret}"

    def all(self) -> list[ApiKey]:
        """Return every key, revoked ones included, oldest first."""
        with self._database.read() as connection:
            rows = connection.execute(select(api_keys).order_by(api_keys.c.created_at))
            return [_key_of(row) for row in rows]

    def find(self, key_id: str) -> ApiKey | None:
        """Return the key of this id, or None."""
        with self._database.read() as connection:
            row = connection.execute(select(api_keys).where(api_keys.c.id == key_id)).one_or_none()
        return None if row is None else _key_of(row)

    def any_exist(self) -> bool:
        """Tell whether a key was ever created, revoked ones included."""
        with self._database.read() as connection:
            return connection.execute(select(api_keys.c.id).limit(1)).first() is not None

    def revoke(self, key_id: str) -> bool:
        """Revoke a key; return False when no valid key has this id."""
        valid = (api_keys.c.id == key_id, api_keys.c.revoked_at.is_(None))
        with self._database.write() as connection:
            change = update(api_keys).where(*valid).values(revoked_at=time.time())
            return connection.execute(change).rowcount == 1


def _hash(secret: str) -> str:
    return hashlib.sha256(secret.encode()).hexdigest()


def _key_of(row: Row[Any]) -> ApiKey:
    values = dict(row._mapping)
    limits = KeyLimits(**{item.name: values.pop(item.name) for item in fields(KeyLimits)})
    return ApiKey(**values, limits=limits)
