"""Idempotency keys whose first request has not been answered yet."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from service.problems import IdempotencyInFlightError


class InFlightKeys:
    """Belongs to one event loop; the keys of answered requests are in the store."""

    def __init__(self) -> None:
        self._keys: set[tuple[str, str]] = set()

    @contextmanager
    def hold(self, tenant: str, word: str | None) -> Iterator[None]:
        """Keep the tenant's key while its request is under way.

        IdempotencyInFlightError when it is kept already.
        """
        if word is None:
            yield
            return
        key = (tenant, word)
        if key in self._keys:
            raise IdempotencyInFlightError(
                "The first request with this Idempotency-Key has not been answered yet; "
                "retry later."
            )
        self._keys.add(key)
        try:
            yield
        finally:
            self._keys.discard(key)
