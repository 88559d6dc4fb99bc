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
    """Keys whose first request is not stored yet; the database knows those of others.

    Belongs to one event loop.
    """

    def __init__(self) -> None:
        self._holders: dict[tuple[str, str], object] = {}

    @contextmanager
    def lock(self, tenant: str, key: str | None) -> Iterator[None]:
        """Lock the tenant's key until `release`, or the end of the context; None locks nothing.

        Raises
        ------
        IdempotencyInFlightError
            Another request holds the key.
        """
        if key is None:
            yield
            return
        if (tenant, key) in self._holders:
            raise IdempotencyInFlightError(
                "The first request with this Idempotency-Key is still being accepted; retry later."
            )
        holder = object()
        self._holders[tenant, key] = holder
        try:
            yield
        finally:
            if self._holders.get((tenant, key)) is holder:  # not that of a request after `release`
                self.release(tenant, key)

    def release(self, tenant: str, key: str) -> None:
        """Free a locked key, because its request is stored: who repeats it gets the same answer."""
        self._holders.pop((tenant, key), None)
