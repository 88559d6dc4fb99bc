"""Attacks by numbers: many calls that are right, each of which holds something."""

from __future__ import annotations

import json
import random
from contextlib import ExitStack, suppress

from tests.e2e.attacks.bodies import JOBS, SMALL
from tests.e2e.attacks.target import HOLD_S, Target
from tests.factories.server import submit

EXPORTS = (
    "aligned?format=laz&merged=true",
    "aligned?format=ply&distances=true",
    "aligned?format=e57",
    "preview?role=source",
    "preview?role=target&max_points=1000",
    "preview.png",
    "deviation?tolerance=0.1",
    "report?tolerance=0.1",
)
AT_ONCE = 14
"""Requests that one attacker begins before it reads an answer."""
LISTS = ("?limit=200", "?limit=200&label=a:b", "?status=succeeded&limit=200", "?cursor=abc")
READS = ("/v1/capacity", "/v1/formats", "/v1/clouds?limit=200", "/metrics", "/openapi.json", "/")


def flood_exports(target: Target, rng: random.Random) -> None:
    """Ask for many files that are written on demand, at once."""
    if target.job:
        _ask_at_once(target, [f"{JOBS}/{target.job}/{rng.choice(EXPORTS)}"] * AT_ONCE)


def flood_inliers(target: Target, rng: random.Random) -> None:
    """Ask for all pairs as JSON."""
    if target.job:
        with target.client() as client:
            client.get(f"{JOBS}/{target.job}/inliers", headers={"Accept": "application/json"})


def flood_reads(target: Target, rng: random.Random) -> None:
    """Read lists and documents, each as often as it goes."""
    with target.client() as client:
        for path in (*(JOBS + query for query in LISTS), *READS):
            client.get(path)


def hold_waits(target: Target, rng: random.Random) -> None:
    """Wait for a registration that does not end, and follow its events, many times."""
    with target.client() as client:
        response = submit(client, SMALL, SMALL, options=json.dumps({"seed": rng.randrange(10**6)}))
    job = response.json().get("id", target.job)
    paths = [f"{JOBS}/{job}", f"{JOBS}/{job}/events"] * (AT_ONCE // 2)
    _ask_at_once(target, paths, "Prefer: wait=60")


def fill_queue(target: Target, rng: random.Random) -> None:
    """Queue much work before everybody else's."""
    with target.client() as client:
        for _ in range(10):
            options = json.dumps({"seed": rng.randrange(10**6)})
            submit(client, SMALL, SMALL, options=options, priority="100")


def name_slow_urls(target: Target, rng: random.Random) -> None:
    """Submit clouds of a host that sends them byte by byte."""
    url = f"{target.traps.dripping}?{rng.randrange(10**9)}"
    with target.client() as client:
        for _ in range(5):
            client.post(JOBS, json={"source": {"url": url}, "target": {"url": url}})


def replay_callbacks(target: Target, rng: random.Random) -> None:
    """Have a host called that does not answer, again and again."""
    with target.client() as client:
        fields = {"callback_url": target.traps.silent, "labels": f'{{"n": "{rng.random()}"}}'}
        job = submit(client, SMALL, SMALL, wait=1, **fields).json().get("id")
        for _ in range(5 if job else 0):
            client.post(f"{JOBS}/{job}/deliveries")


def _ask_at_once(target: Target, paths: list[str], *headers: str) -> None:
    """Send all requests, read what comes for a while, and leave."""
    with ExitStack() as opened, suppress(OSError):
        connections = []
        for path in paths:
            connections.append(opened.enter_context(target.connect()))
            connections[-1].sendall(target.head(f"GET {path}", "Connection: close", *headers))
        target.is_over.wait(HOLD_S)
        for connection in connections:
            connection.settimeout(HOLD_S)
            connection.recv(2**20)
