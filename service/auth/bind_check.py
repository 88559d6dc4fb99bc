"""Where the service may listen: strangers reach it only with keys, or when that is wanted."""

from __future__ import annotations

import socket
from ipaddress import ip_address

from service.auth.keys import KeyStore
from service.database.engine import open_database
from service.settings import Settings


class UnprotectedBindError(Exception):
    """Others could reach the address, and no key would keep them out."""


def check_binding(host: str, settings: Settings) -> None:
    """OpenToStrangersError unless only this machine reaches the address, or keys are needed."""
    if settings.allow_open or settings.require_keys or is_loopback(host):
        return
    settings.data_dir.mkdir(parents=True, exist_ok=True)
    database = open_database(settings.store_url)
    try:
        closed = KeyStore(database).exist()
    finally:
        database.close()
    if not closed:
        raise UnprotectedBindError(
            f"others can reach {host or 'every address'}, and there is no key to keep them out: "
            "make one with `mpe keys create --tenant NAME`, or set MPE_ALLOW_OPEN=true to serve "
            "whoever comes"
        )


def is_loopback(host: str) -> bool:
    """Whether only this machine reaches the address, or every address of the name."""
    try:
        found = socket.getaddrinfo(host or None, 0, flags=socket.AI_PASSIVE)
    except OSError:
        return False
    return all(ip_address(str(place[0]).partition("%")[0]).is_loopback for *_, place in found)
