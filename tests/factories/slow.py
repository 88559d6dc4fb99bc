"""Work that keeps a worker busy in native code until it is stopped."""

from __future__ import annotations

from tests.factories.scans import arms, as_npy

SLOW = '{"method": "mpe", "field": "exact", "max_iterations": 10000}'


def slow_pair() -> tuple[bytes, bytes]:
    """Two clouds whose exact double sums take two threads most of a minute."""
    return as_npy(arms(1, 200_000)), as_npy(arms(2, 200_000))
