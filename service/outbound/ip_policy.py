"""Policy of IP addresses: which ones may be connected to."""

from __future__ import annotations

from collections.abc import Sequence
from ipaddress import (
    IPv4Address,
    IPv4Network,
    IPv6Address,
    IPv6Network,
    ip_address,
    ip_network,
)

Address = IPv4Address | IPv6Address
Network = IPv4Network | IPv6Network

METADATA = frozenset(
    map(
        ip_address,
        (
            "169.254.169.254",  # most clouds
            "169.254.170.2",  # credentials of a container, AWS
            "168.63.129.16",  # Azure; a public address
            "100.100.100.200",  # Alibaba
            "192.0.0.192",  # Oracle
            "fd00:ec2::254",  # AWS
            "fd00:ec2::23",  # credentials of a pod, AWS
            "fd20:ce::254",  # Google
        ),
    )
)
"""Addresses at which cloud providers serve credentials of the machine; never allowed."""

# special addresses of IANA's registries that ipaddress.is_global of Python 3.11 calls global
_SPECIAL: tuple[Network, ...] = (
    ip_network("192.88.99.0/24"),  # relays of 6to4
    ip_network("2001::/23"),  # Teredo and other protocols
    ip_network("2002::/16"),  # 6to4: holds an IPv4 address
    ip_network("3fff::/20"),  # documentation
)
_UNICAST = ip_network("2000::/3")
_ISATAP = (0x00005EFE, 0x02005EFE)
"""Upper 32 bits of an interface identifier that embeds an IPv4 address."""


def is_allowed(address: Address, networks: Sequence[Network]) -> bool:
    """Tell whether an address is public or in one of the networks, and serves no metadata."""
    if address in METADATA:
        return False
    return _is_public(address) or any(address in network for network in networks)


def _is_public(address: Address) -> bool:
    if not address.is_global or address.is_multicast or address.is_reserved:
        return False
    if any(address in network for network in _SPECIAL):
        return False
    if isinstance(address, IPv4Address):
        return True
    # the only allocated space; mapped addresses and NAT64 are outside
    return address in _UNICAST and (int(address) >> 32) & 0xFFFFFFFF not in _ISATAP
