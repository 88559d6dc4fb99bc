"""`mpe keys`: create, list and revoke; the service may run meanwhile."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime

from service.auth.keys import ApiKey, KeyStore, Limits
from service.database.engine import open_database
from service.settings import Settings

COLUMNS = "{:<18}{:<20}{:<20}{:<22}{:<10}{}"
HEAD = ("id", "tenant", "name", "created", "state", "limits of its own")


def run(given: argparse.Namespace) -> None:
    """Do what was asked for; ValueError when it cannot be, RuntimeError when the store cannot."""
    with _keys() as keys:
        if given.action == "create":
            _create(keys, given)
        elif given.action == "list":
            _list(keys)
        else:
            _revoke(keys, given.id)


def _create(keys: KeyStore, given: argparse.Namespace) -> None:
    limits = Limits(given.requests_per_s, given.queue_limit, given.stored_bytes)
    key = keys.create(given.tenant, given.name, limits)
    print("This key is not shown again; send it as `Authorization: Bearer`.", file=sys.stderr)
    print(key)


def _list(keys: KeyStore) -> None:
    print(COLUMNS.format(*HEAD))
    for key in keys.all():
        created = datetime.fromtimestamp(key.created_at, UTC).strftime("%Y-%m-%d %H:%M:%S")
        state = "valid" if key.revoked_at is None else "revoked"
        print(COLUMNS.format(key.id, key.tenant, key.name, created, state, _limits(key)))


def _limits(key: ApiKey) -> str:
    own = {name: getattr(key.limits, name) for name in Limits.__dataclass_fields__}
    return ", ".join(f"{name} {value:g}" for name, value in own.items() if value is not None)


def _revoke(keys: KeyStore, key_id: str) -> None:
    if not keys.revoke(key_id):
        raise ValueError(f"no valid key has the id {key_id}; `mpe keys list` lists them")


@contextmanager
def _keys() -> Iterator[KeyStore]:
    settings = Settings()
    settings.data_dir.mkdir(parents=True, exist_ok=True)
    database = open_database(settings.store_url)
    try:
        yield KeyStore(database)
    finally:
        database.close()
