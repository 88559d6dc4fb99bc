"""`mpe keys`: create, list and revoke API keys; the service may be running."""

from __future__ import annotations

import argparse
import sys
from dataclasses import asdict
from datetime import UTC, datetime
from typing import TYPE_CHECKING

from service.settings import Settings

if TYPE_CHECKING:
    from service.auth.keys import ApiKey, KeyStore

ROW = "{:<18}{:<20}{:<20}{:<22}{:<10}{}"
HEADER = ("id", "tenant", "name", "created", "state", "limits of its own")


def add_keys(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command `keys` with its three actions."""
    keys = commands.add_parser("keys", help="create, list and revoke API keys")
    actions = keys.add_subparsers(dest="action", required=True, metavar="ACTION")
    create = actions.add_parser("create", help="create a key and print it, which is only done now")
    create.add_argument("--tenant", required=True, help="tenant of the key; need not exist before")
    create.add_argument("--name", default="", help="description of the key, shown in the list")
    own = create.add_argument_group(
        "limits of this key; 0: unlimited; default: the MPE_KEY_ settings"
    )
    own.add_argument(
        "--requests-per-s", type=_non_negative_float, metavar="NUMBER", help="requests per second"
    )
    own.add_argument(
        "--queue-limit",
        type=_non_negative_int,
        metavar="COUNT",
        help="registrations of the tenant that may wait",
    )
    own.add_argument(
        "--stored-bytes",
        type=_non_negative_int,
        metavar="BYTES",
        help="bytes that the tenant may have stored",
    )
    actions.add_parser("list", help="list all keys, without their secrets")
    revoke = actions.add_parser("revoke", help="revoke a key; takes effect within a second")
    revoke.add_argument("id", help="id of the key, as `mpe keys list` shows it")


def run(arguments: argparse.Namespace, settings: Settings) -> None:
    """Carry out one action of `mpe keys`.

    Raises
    ------
    ValueError
        The arguments name no valid tenant or key.
    RuntimeError, OSError, NotReadyError
        The job store cannot be opened or does not answer.
    """
    # SQLAlchemy takes long to load, and `mpe align` does without it
    from service.auth.keys import KeyStore
    from service.database.store import open_store
    from service.storage.store_mark import StoreMark

    database = open_store(settings)
    try:
        keys = KeyStore(database)
        if arguments.action == "create":
            StoreMark(settings.data_dir).record_keys()
            _create(keys, arguments)
        elif arguments.action == "list":
            _list(keys)
        else:
            _revoke(keys, arguments.id)
    finally:
        database.close()


def _create(keys: KeyStore, arguments: argparse.Namespace) -> None:
    from service.auth.keys import KeyLimits

    limits = KeyLimits(arguments.requests_per_s, arguments.queue_limit, arguments.stored_bytes)
    key = keys.create(arguments.tenant, arguments.name, limits)
    print("This key is not shown again; send it as `Authorization: Bearer`.", file=sys.stderr)
    print(key)


def _list(keys: KeyStore) -> None:
    print(ROW.format(*HEADER))
    for key in keys.all():
        created = datetime.fromtimestamp(key.created_at, UTC).strftime("%Y-%m-%d %H:%M:%S")
        state = "valid" if key.revoked_at is None else "revoked"
        print(ROW.format(key.id, key.tenant, key.name, created, state, _limits(key)))


def _limits(key: ApiKey) -> str:
    own = asdict(key.limits)
    return ", ".join(f"{name} {value:g}" for name, value in own.items() if value is not None)


def _revoke(keys: KeyStore, key_id: str) -> None:
    if not keys.revoke(key_id):
        raise ValueError(f"no valid key has the id {key_id}; `mpe keys list` lists them")


def _non_negative_float(text: str) -> float:
    number = float(text)
    if not 0 <= number < float("inf"):
        raise argparse.ArgumentTypeError(f"expected a number, 0 or more; got {text}")
    return number


def _non_negative_int(text: str) -> int:
    number = int(text)
    if not 0 <= number < 2**63:
        raise argparse.ArgumentTypeError(f"expected a whole number, 0 or more; got {text}")
    return number
