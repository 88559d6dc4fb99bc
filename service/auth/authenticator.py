"""Who is calling: the key of a request, checked, and what its tenant may use."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

from service.auth.keys import DEFAULT_TENANT, ApiKey, KeyStore, Limits, split_key
from service.problems import UnauthorizedError
from service.settings import Settings

REMEMBERED_S = 1.0
"""How long a key is not looked up again, and so how long a revoked one is still taken."""


@dataclass(frozen=True, slots=True)
class Caller:
    """Whoever sent the request."""

    tenant: str
    limits: Limits
    key_id: str | None = None


ANONYMOUS = Caller(DEFAULT_TENANT, Limits())
"""Anybody, as long as there are no keys."""


class Authenticator:
    """Lets callers in; what the database said is remembered for REMEMBERED_S."""

    def __init__(self, keys: KeyStore, settings: Settings) -> None:
        self._keys = keys
        self._settings = settings
        self._defaults = Limits(
            requests_per_s=settings.key_requests_per_s,
            queue_limit=settings.key_queue_limit,
            stored_bytes=settings.key_stored_bytes,
        )
        self._known: dict[str, tuple[ApiKey, float]] = {}
        self._open_until = 0.0
        self._closed = settings.require_keys

    def remembered(self, authorization: list[str]) -> Caller | None:
        """The caller, if that can be told without the database."""
        now = time.monotonic()
        if not authorization:
            return ANONYMOUS if now < self._open_until else None
        key_id, secret = _credentials(authorization)
        key, until = self._known.get(key_id, (None, 0.0))
        if key is None or now >= until:
            return None
        return self._admitted(key, secret)

    def identified(self, authorization: list[str]) -> Caller:
        """The caller that the Authorization headers name; UnauthorizedError for a wrong one.

        Without such a header: anybody, as long as the service is open.
        """
        now = time.monotonic()
        if not authorization:
            self._closed = self._closed or self._keys.exist()
            if self._closed:
                raise _refused("This service needs a key: send `Authorization: Bearer mpe_...`.")
            self._open_until = now + REMEMBERED_S
            return ANONYMOUS
        key_id, secret = _credentials(authorization)
        key = self._keys.find(key_id)
        if key is not None:
            self._known[key_id] = (key, now + REMEMBERED_S)
        return self._admitted(key, secret)

    def _admitted(self, key: ApiKey | None, secret: str) -> Caller:
        if key is None or not key.admits(secret):
            raise _invalid()
        return Caller(key.tenant, self._limits(key.limits), key.id)

    def _limits(self, own: Limits) -> Limits:
        """Those of the key, else of the settings; 0 stands for none."""
        return Limits(
            **{
                name: _first(getattr(own, name), getattr(self._defaults, name))
                for name in Limits.__dataclass_fields__
            }
        )


def _first(own: Any, default: Any) -> Any:
    return (default if own is None else own) or None


def _credentials(authorization: list[str]) -> tuple[str, str]:
    """Id and secret; UnauthorizedError for anything but one `Bearer mpe_<id>_<secret>`."""
    scheme, _, key = authorization[0].partition(" ")
    found = split_key(key) if scheme.lower() == "bearer" and len(authorization) == 1 else None
    if found is None:
        raise _invalid()
    return found


def _invalid() -> UnauthorizedError:
    return _refused("The key is not valid, or not any more.", ' error="invalid_token"')


def _refused(detail: str, reason: str = "") -> UnauthorizedError:
    challenge = f'Bearer realm="mpe"{"," if reason else ""}{reason}'
    return UnauthorizedError(detail, headers={"WWW-Authenticate": challenge})
