"""Keys of a server's store, and clients that call with them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import httpx

from service.auth.keys import KeyLimits, KeyStore
from service.database.engine import open_database
from service.settings import Settings
from tests.factories.server import CALL_S, Server


@contextmanager
def keys_of(server: Server) -> Iterator[KeyStore]:
    """The server's keys, while it runs or not."""
    database = open_database(Settings(data_dir=server.data_dir).store_url)
    try:
        yield KeyStore(database)
    finally:
        database.close()


def new_key(
    server: Server,
    tenant: str,
    *,
    requests_per_s: float = 0,
    queue_limit: int | None = 0,
    stored_bytes: int = 0,
) -> str:
    """A key, without limits unless they are given; None: as the server's settings say."""
    with keys_of(server) as keys:
        return keys.create(tenant, "test", KeyLimits(requests_per_s, queue_limit, stored_bytes))


def revoke(server: Server, key: str) -> None:
    with keys_of(server) as keys:
        assert keys.revoke(key.split("_")[1])


def caller(server: Server, key: str | None) -> httpx.Client:
    """A client that calls with the key, or without any."""
    headers = {} if key is None else {"Authorization": f"Bearer {key}"}
    return httpx.Client(base_url=server.url, headers=headers, timeout=CALL_S, trust_env=False)
