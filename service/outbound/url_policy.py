"""What may be called."""

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
    """Hosts, ports and networks of one kind of calls."""

    hosts: tuple[str, ...] = ()
    """Names or addresses; none: all."""
    hosts_setting: str = "MPE_URL_HOSTS"
    """The variable that names them."""
    ports: tuple[int, ...] = ()
    """None: 80, 443 and all from 1024."""
    networks: tuple[Network, ...] = ()
    """Networks that may be reached though they are not public."""


def check_url(url: Url, rules: UrlPolicy) -> None:
    """AddressRefusedError unless the URL may be called, as far as that shows without asking DNS."""
    if rules.hosts and url.host not in rules.hosts:
        raise AddressRefusedError(f"{rules.hosts_setting} does not name the URL's host.")
    if not _is_port_open(url.port, rules.ports):
        raise AddressRefusedError("The URL's port may not be called.")
    try:
        address = ip_address(url.host)
    except ValueError:
        return
    if not is_allowed(address, rules.networks):
        raise refused_address()


def refused_address() -> AddressRefusedError:
    """Says the same whatever the address is, and whether anything is there or not."""
    return AddressRefusedError(
        "The URL's host is not on the public network; MPE_PRIVATE_NETWORKS opens others."
    )


def _is_port_open(port: int, ports: tuple[int, ...]) -> bool:
    return port in (ports or ORDINARY_PORTS) or (not ports and port >= FIRST_UNPRIVILEGED_PORT)
