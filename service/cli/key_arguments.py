"""The arguments of `mpe keys`."""

from __future__ import annotations

import argparse


def add_keys(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """The command `keys` with its three actions."""
    keys = commands.add_parser("keys", help="create, list and revoke API keys")
    actions = keys.add_subparsers(dest="action", required=True, metavar="ACTION")
    create = actions.add_parser("create", help="make a key, and print it: it is shown only now")
    create.add_argument("--tenant", required=True, help="whose key it is; made by being named")
    create.add_argument("--name", default="", help="a word to know the key by in the list")
    own = create.add_argument_group("limits of this key; 0: none; default: the MPE_KEY_ settings")
    own.add_argument("--requests-per-s", type=_at_least_0, metavar="NUMBER", help="requests")
    own.add_argument(
        "--queue-limit", type=_count, metavar="COUNT", help="registrations of the tenant that wait"
    )
    own.add_argument(
        "--stored-bytes", type=_count, metavar="BYTES", help="bytes that are kept for the tenant"
    )
    actions.add_parser("list", help="list all keys, without their secrets")
    revoke = actions.add_parser("revoke", help="put a key out of force, within a second")
    revoke.add_argument("id", help="its id, as `mpe keys list` shows it")


def _at_least_0(text: str) -> float:
    number = float(text)
    if not 0 <= number < float("inf"):
        raise argparse.ArgumentTypeError("expected a number, 0 or more")
    return number


def _count(text: str) -> int:
    number = int(text)
    if not 0 <= number < 2**63:
        raise argparse.ArgumentTypeError("expected a whole number, 0 or more")
    return number
