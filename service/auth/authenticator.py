"""Authentication of requests by API key."""

from __future__ import annotations

import time
from dataclasses import dataclass, fields
from typing import Any

from service.auth.keys import DEFAULT_TENANT, ApiKey, KeyLimits, KeyStore, split_key
from service.problems import UnauthorizedError
from service.settings import KeySettings, Settings
from service.storage.store_mark import StoreMark

CACHE_TTL_S = 1.0
"""Seconds a key look-up is cached; a revoked key may still be accepted for that long."""


@dataclass(frozen=True, slots=True)
class Caller:
    """Sender of a request."""

    tenant: str
    limits: KeyLimits
    """Limits in force; None: unlimited."""
    key_id: str | None = None
    """None: the request has no key."""


ANONYMOUS = Caller(DEFAULT_TENANT, KeyLimits())
"""Caller of a request without a key, which is accepted until the first key is created."""


class Authenticator:
    """Map the Authorization headers of a request to its Caller."""

    def __init__(self, keys: KeyStore, settings: Settings) -> None:
        self._keys = keys
        self._defaults = settings.key
        self._cache: dict[str, tuple[ApiKey, float]] = {}
        """Key and end of its validity in the cache, by id."""
        self._anonymous_until = 0.0
        self._requires_key = settings.require_keys or StoreMark(settings.data_dir).had_keys

    def from_cache(self, authorization: list[str]) -> Caller | None:
        """Return the caller if the cache knows it; None: ask `authenticate`.

        Raises
        ------
        UnauthorizedError
            The header has another form, or the secret is wrong.
        """
        now = time.monotonic()
        if not authorization:
            return ANONYMOUS if now < self._anonymous_until else None
        key_id, secret = _parse(authorization)
        key, until = self._cache.get(key_id, (None, 0.0))
        if key is None or now >= until:
            return None
        return self._verify(key, secret)

    def authenticate(self, authorization: list[str]) -> Caller:
        """Return the caller that the Authorization headers name; reads the database.

        Raises
        ------
        UnauthorizedError
            No key was sent although one is required, or it is not valid.
        """
        now = time.monotonic()
        if not authorization:
            self._requires_key = self._requires_key or self._keys.any_exist()
            if self._requires_key:
                raise _unauthorized("A key is required: send `Authorization: Bearer mpe_...`.")
            self._anonymous_until = now + CACHE_TTL_S
            return ANONYMOUS
        key_id, secret = _parse(authorization)
        key = self._keys.find(key_id)
        if key is not None:
            self._cache[key_id] = (key, now + CACHE_TTL_S)
        return self._verify(key, secret)

    def _verify(self, key: ApiKey | None, secret: str) -> Caller:
        if key is None or not key.verify_secret(secret):
            raise _invalid()
        return Caller(key.tenant, limits_in_force(key.limits, self._defaults), key.id)


def limits_in_force(own: KeyLimits, defaults: KeySettings) -> KeyLimits:
    """Return the limits of a key: its own, else the default; 0 in either means unlimited."""

    def limit(name: str) -> Any:
        value = getattr(own, name)
        return (getattr(defaults, name) if value is None else value) or None

    return KeyLimits(**{item.name: limit(item.name) for item in fields(KeyLimits)})


def _parse(authorization: list[str]) -> tuple[str, str]:
    """Return id and secret of exactly one `Bearer mpe_<id>_<secret>`."""
    scheme, _, key = authorization[0].partition(" ")
    parts = split_key(key) if scheme.lower() == "bearer" and len(authorization) == 1 else None
    if parts is None:
        raise _invalid()
    return parts


def _invalid() -> UnauthorizedError:
    return _unauthorized("The key is not valid, or was revoked.", ' error="invalid_token"')


def _unauthorized(detail: str, reason: str = "") -> UnauthorizedError:
    challenge = f'Bearer realm="mpe"{"," if reason else ""}{reason}'
    return UnauthorizedError(detail, headers={"WWW-Authenticate": challenge})
