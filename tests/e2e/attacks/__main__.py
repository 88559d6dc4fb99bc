"""How fast /livez answers under attack; `python -m tests.e2e.attacks`.

Each attack by itself, then all together, beside what a server that does nothing takes at the same
time: on a busy machine both wait for a processor. Ends with 1 where the 99th percentile of /livez
is more than 100 ms above that, or the service logs an error.
"""

from __future__ import annotations

import argparse
import os
import random
import sys
import tempfile
import threading
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import httpx

from tests.e2e.answer_times import Calls, measured, percentiles_ms
from tests.e2e.attacks.catalog import ATTACKS
from tests.e2e.attacks.target import Target
from tests.e2e.attacks.traps import open_traps
from tests.factories.logs import logged_errors
from tests.factories.scans import arms, as_npy
from tests.factories.server import Server, registered, running_server
from tests.factories.tenants import caller, new_key

ATTACKERS = 4
"""Attackers that do the same at once, each a tenant of its own."""
MAX_P99_MS = 100.0
POINTS = 30_000
NICENESS = 5
"""Attackers come from other machines: here they leave the processor to the service."""
SETTINGS = {
    "require_keys": True,
    "webhook_hosts": "127.0.0.1",
    "webhook_secret": "attacks",
    "private_networks": "127.0.0.0/8",
    "min_free_disk_bytes": 64 * 2**20,
}


def measure(server: Server, targets: Sequence[Target], names: Sequence[str], seconds: float) -> str:
    """Attack for a while; a line of figures, which begins with `!` where the promise is broken."""
    is_over = threading.Event()
    threads = [
        threading.Thread(target=_attack, args=(replace(target, is_over=is_over), name, number))
        for number, target in enumerate(targets)
        for name in names
    ]
    with measured(server.port) as (livez, bare):
        for thread in threads:
            thread.start()
        is_over.wait(seconds)
        is_over.set()
    for thread in threads:
        thread.join()
    return _describe(livez, bare)


def _attack(target: Target, name: str, number: int) -> None:
    os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), NICENESS)
    rng = random.Random(f"{name} {number}")
    while not target.is_over.is_set():
        with suppress(httpx.TransportError, OSError):
            ATTACKS[name](target, rng)


def _describe(livez: Calls, bare: Calls) -> str:
    (p50, p99), (bare_p50, bare_p99) = percentiles_ms(livez), percentiles_ms(bare)
    unanswered = sum(not call.is_answered for call in livez)
    mark = " " if not unanswered and p99 <= bare_p99 + MAX_P99_MS else "!"
    return (
        f"{mark} {len(livez):5} calls, {unanswered} unanswered; /livez p50 {p50:7.1f} ms, "
        f"p99 {p99:7.1f} ms; bare server p50 {bare_p50:7.1f} ms, p99 {bare_p99:7.1f} ms"
    )


def _attackers(server: Server, tenant: str) -> tuple[str, str]:
    """A key with the usual limits, and a registration of it that has succeeded."""
    key = new_key(server, tenant, requests_per_s=50, queue_limit=200)
    cloud = as_npy(arms(1, POINTS))
    with caller(server, key) as client:
        return key, registered(client, cloud, cloud)["id"]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", help=f"some of {', '.join(ATTACKS)}; default: all")
    parser.add_argument("--seconds", type=float, default=10, help="of each attack by itself")
    given = parser.parse_args()
    names = given.names or list(ATTACKS)
    is_kept = True
    with (
        tempfile.TemporaryDirectory() as directory,
        open_traps() as traps,
        running_server(Path(directory), **SETTINGS) as server,
    ):
        targets = []
        for number in range(ATTACKERS):
            key, job = _attackers(server, f"attacker-{number}")
            targets.append(Target(server.port, key, traps, job))
        runs = [["nothing"], *([name] for name in names), names]
        for attacks in runs:
            chosen = [name for name in attacks if name in ATTACKS]
            length_s = given.seconds * (3 if len(chosen) > 1 else 1)
            line = measure(server, targets, chosen, length_s)
            is_kept &= not line.startswith("!")
            print(f"{'all together' if len(chosen) > 1 else attacks[0]:24}{line}", flush=True)
        errors = logged_errors(server.log)
        print("errors logged:", dict(errors))
    return 0 if is_kept and not errors else 1


if __name__ == "__main__":
    sys.exit(main())
