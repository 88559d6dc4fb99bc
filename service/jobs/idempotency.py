"""Idempotency keys: what a caller sends with a request that must not be carried out twice."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from service.problems import IdempotencyInFlightError


@dataclass(frozen=True, slots=True)
class Idempotency:
    """A caller's key, and the hash of the request that came with it."""

    key: str
    fingerprint: str


class InFlightKeys:
    """Keys whose first request has not been answered yet; the database knows those of others.

    Belongs to one event loop.
    """

    def __init__(self) -> None:
        self._keys: set[tuple[str, str]] = set()

    @contextmanager
    def lock(self, tenant: str, key: str | None) -> Iterator[None]:
        """Lock the tenant's key while its request is under way; without a key do nothing.

        Raises
        ------
        IdempotencyInFlightError
            Another request holds the key.
        """
        if key is None:
            yield
            return
        if (tenant, key) in self._keys:
            raise IdempotencyInFlightError(
                "The first request with this Idempotency-Key has not been answered yet; "
                "retry later."
            )
        self._keys.add((tenant, key))
        try:
            yield
        finally:
            self._keys.discard((tenant, key))
