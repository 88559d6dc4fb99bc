"""Number of open connections, in all and of each address."""

from __future__ import annotations

import logging
import time
from collections import Counter
from ipaddress import IPv6Address, ip_address

log = logging.getLogger(__name__)

LOG_INTERVAL_S = 60.0
"""Minimum time between two log lines about refused connections, in seconds."""
IPV6_NETWORK_BITS = 64
"""Addresses with these leading bits in common count as one: a host has a whole such network."""


class ConnectionGuard:
    """Counts connections and refuses those above a limit; to be used within one event loop.

    Parameters
    ----------
    max_total, max_per_address : int
        Most connections at once, in all and from one address.
    """

    def __init__(self, max_total: int, max_per_address: int) -> None:
        self._max_total = max_total
        self._max_per_address = max_per_address
        self._open: Counter[str] = Counter()
        self._total = 0
        self._log_again_at = 0.0

    @property
    def total(self) -> int:
        """Connections that are open."""
        return self._total

    def admit(self, address: str) -> str | None:
        """Count a connection and return the key to `release`; None if it must be refused."""
        key = _group(address)
        if self._total >= self._max_total:
            self._log(f"all {self._max_total} connections of MPE_MAX_CONNECTIONS are in use")
            return None
        if self._open[key] >= self._max_per_address:
            self._log(
                f"{key} has {self._max_per_address} connections, as many as "
                "MPE_MAX_CONNECTIONS_PER_ADDRESS allows"
            )
            return None
        self._open[key] += 1
        self._total += 1
        return key

    def release(self, key: str) -> None:
        """Count a connection as closed."""
        self._total -= 1
        self._open[key] -= 1
        if not self._open[key]:
            del self._open[key]

    def _log(self, reason: str) -> None:
        now = time.monotonic()
        if now >= self._log_again_at:
            self._log_again_at = now + LOG_INTERVAL_S
            log.warning("connections are refused: %s", reason)


def _group(address: str) -> str:
    try:
        parsed = ip_address(address.partition("%")[0])
    except ValueError:
        return address
    if not isinstance(parsed, IPv6Address):
        return str(parsed)
    if parsed.ipv4_mapped is not None:
        return str(parsed.ipv4_mapped)
    host_bits = 128 - IPV6_NETWORK_BITS
    return f"{IPv6Address(int(parsed) >> host_bits << host_bits)}/{IPV6_NETWORK_BITS}"
