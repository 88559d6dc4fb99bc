"""Policy of URLs: which hosts, ports and networks may be called."""

from __future__ import annotations

from dataclasses import dataclass
from ipaddress import ip_address

from service.outbound.errors import AddressRefusedError
from service.outbound.ip_policy import Network, is_allowed
from service.outbound.urls import Url

ORDINARY_PORTS = (80, 443)
FIRST_UNPRIVILEGED_PORT = 1024


@dataclass(frozen=True, slots=True)
class UrlPolicy:
    """Hosts, ports and networks that one kind of call may reach."""

    hosts: tuple[str, ...] = ()
    """Host names or addresses; empty: all."""
    hosts_setting: str = "MPE_URL_HOSTS"
    """Environment variable of `hosts`, for messages."""
    ports: tuple[int, ...] = ()
    """Empty: ORDINARY_PORTS and all from FIRST_UNPRIVILEGED_PORT."""
    networks: tuple[Network, ...] = ()
    """Networks that may be reached although they are not public."""


def check_url(url: Url, policy: UrlPolicy) -> None:
    """Check a URL without resolving its host.

    Raises
    ------
    AddressRefusedError
        The policy does not allow its host or port.
    """
    if policy.hosts and url.host not in policy.hosts:
        raise AddressRefusedError(f"{policy.hosts_setting} does not name the URL's host.")
    if not _is_port_open(url.port, policy.ports):
        raise AddressRefusedError(
            "The URL's port is not allowed: expected one of MPE_URL_PORTS, or without that setting "
            "80, 443 or 1024 and above."
        )
    try:
        address = ip_address(url.host)
    except ValueError:
        return
    if not is_allowed(address, policy.networks):
        raise refused_address()


def refused_address() -> AddressRefusedError:
    """Return the error for an address that is not allowed; it reveals nothing about the address."""
    return AddressRefusedError(
        "The URL's host is not on the public network; MPE_PRIVATE_NETWORKS allows others."
    )


def _is_port_open(port: int, ports: tuple[int, ...]) -> bool:
    return port in (ports or ORDINARY_PORTS) or (not ports and port >= FIRST_UNPRIVILEGED_PORT)
