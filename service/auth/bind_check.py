"""Check before listening: other machines may reach the service only with keys, or on request."""

from __future__ import annotations

import socket
from ipaddress import ip_address

from service.auth.keys import KeyStore
from service.database.store import open_store
from service.settings import Settings
from service.storage.store_mark import StoreMark


class UnprotectedBindError(Exception):
    """Other machines could reach the address, and no key is required."""


def check_binding(host: str, settings: Settings) -> None:
    """Check the address to listen at.

    Raises
    ------
    UnprotectedBindError
        Other machines can reach the address, no key exists or is required, and
        MPE_ALLOW_ANONYMOUS_REMOTE is not set.
    StoreLostError
        The job store is missing or empty.
    """
    if settings.allow_anonymous_remote or settings.require_keys or resolves_to_loopback(host):
        return
    database = open_store(settings)
    try:
        has_keys = StoreMark(settings.data_dir).had_keys or KeyStore(database).any_exist()
    finally:
        database.close()
    if not has_keys:
        raise UnprotectedBindError(
            f"other machines can reach {host or 'every address'}, and there is no API key: create "
            "one with `mpe keys create --tenant NAME`, or set MPE_ALLOW_ANONYMOUS_REMOTE=true to "
            "serve everybody"
        )


def is_loopback_address(text: str) -> bool:
    """Tell whether a text is an IP address that only this machine reaches; names are not."""
    try:
        return ip_address(text.partition("%")[0]).is_loopback
    except ValueError:
        return False


def resolves_to_loopback(host: str) -> bool:
    """Tell whether every address of a host, given by name or address, is a loopback address."""
    try:
        found = socket.getaddrinfo(host or None, 0, flags=socket.AI_PASSIVE)
    except OSError:
        return False
    return all(is_loopback_address(str(address[0])) for *_, address in found)
