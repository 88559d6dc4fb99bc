"""Policy of IP addresses: which ones may be connected to."""

from __future__ import annotations

import socket
from collections.abc import Sequence
from ipaddress import (
    IPv4Address,
    IPv4Network,
    IPv6Address,
    IPv6Network,
    ip_address,
    ip_network,
)

import psutil

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
    """Tell whether an address is public or in one of the networks, and serves no metadata.

    A public address of this machine is not public: it leads past the machine's firewall.
    """
    if address in METADATA:
        return False
    if any(address in network for network in networks):
        return True
    return _is_public(address) and not is_own(address)


def is_own(address: Address) -> bool:
    """Tell whether an interface of this machine has the address."""
    own = {
        entry.address.partition("%")[0]
        for entries in psutil.net_if_addrs().values()
        for entry in entries
        if entry.family in (socket.AF_INET, socket.AF_INET6)
    }
    if address in map(ip_address, own):
        return True
    return _routes_to_itself(address)


def _routes_to_itself(address: Address) -> bool:
    """Ask the kernel's routing: it reaches an address of its own from that very address."""
    family = socket.AF_INET if address.version == 4 else socket.AF_INET6
    try:
        with socket.socket(family, socket.SOCK_DGRAM) as probe:
            probe.connect((str(address), 9))  # sends nothing
            return ip_address(probe.getsockname()[0].partition("%")[0]) == address
    except OSError:
        return False  # no route: the connection will say so


def _is_public(address: Address) -> bool:
    if not address.is_global or address.is_multicast or address.is_reserved:
        return False
    if any(address in network for network in _SPECIAL):
        return False
    if isinstance(address, IPv4Address):
        return True
    # the only allocated space; mapped addresses and NAT64 are outside
    return address in _UNICAST and (int(address) >> 32) & 0xFFFFFFFF not in _ISATAP
