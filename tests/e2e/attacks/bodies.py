"""Attacks by bodies: what costs much to parse, to sniff, to expand or to keep."""

from __future__ import annotations

import functools
import gzip
import json
import random

import numpy as np

from tests.e2e.attacks.target import Target
from tests.factories.hostile_files import ALL, HUGE, LIES, flipped
from tests.factories.scans import arms, as_npy
from tests.factories.server import submit

JOBS = "/v1/registrations"
BOUNDARY = "b0undary"
DIGITS = b"1\n1\n" + b"11111111 11111111 11111111\n" * 4 + b"x" * 40
HEADS = (DIGITS, b"1" * 1_000_000, b"{" * 100_000, b"123456 123456 123456 1\n" * 70, bytes(4096))
"""Content that is hard to sniff."""
NEAR_BOUNDARIES = f"\r\n--{BOUNDARY[:-1]}".encode() * 300_000
JSON_BODIES = (
    b"[" * 260_000,
    b'{"a":' * 50_000,
    json.dumps({f"f{i}": i for i in range(20_000)}).encode(),
    b'{"source": ' + b"9" * 200_000 + b"}",
)
LABELS = json.dumps({"x" * 60: "y" * 60_000})
SMALL = as_npy(arms(0, 30))


def confuse_sniffers(target: Target, rng: random.Random) -> None:
    """Send clouds whose format is hard to tell."""
    with target.client() as client:
        for content in HEADS:
            client.put("/v1/clouds/evil", content=content)
            submit(client, content, SMALL)


def repeat_near_boundaries(target: Target, rng: random.Random) -> None:
    """Send a form whose file is full of what is almost its boundary."""
    head = f'--{BOUNDARY}\r\nContent-Disposition: form-data; name="source"; filename="a"\r\n\r\n'
    headers = {"Content-Type": f"multipart/form-data; boundary={BOUNDARY}"}
    with target.client() as client:
        client.post(JOBS, content=head.encode() + NEAR_BOUNDARIES, headers=headers)


def nest_json(target: Target, rng: random.Random) -> None:
    """Send deep, wide and long JSON."""
    with target.client() as client:
        for body in JSON_BODIES:
            client.post(JOBS, content=body, headers={"Content-Type": "application/json"})


def keep_long_labels(target: Target, rng: random.Random) -> None:
    """Submit the same work with long labels: the result is known, the rows are kept."""
    with target.client() as client:
        for _ in range(5):
            submit(client, SMALL, SMALL, labels=LABELS)
            submit(client, SMALL, SMALL, labels=json.dumps({f"l{i}": "z" for i in range(16)}))


def lie_in_files(target: Target, rng: random.Random) -> None:
    """Submit files that announce what they do not hold, or that chance has damaged."""
    lies = list((LIES | HUGE).values())
    damaged = flipped(rng.choice(list(ALL.values())), _numpy_rng(rng))
    with target.client() as client:
        for content in (*rng.sample(lies, 3), damaged):
            submit(client, content, SMALL)


def expand_archives(target: Target, rng: random.Random) -> None:
    """Submit an archive that expands 99 times."""
    with target.client() as client:
        submit(client, _bomb(), SMALL, options=json.dumps({"seed": rng.randrange(10**6)}))


@functools.cache
def _bomb() -> bytes:
    rows = b"".join(
        f"{i % 7919 / 7:.3f} {i % 6007 / 3:.3f} 0.5\n".encode() * 60 for i in range(9000)
    )
    return gzip.compress(rows, 6, mtime=0)


def _numpy_rng(rng: random.Random) -> np.random.Generator:
    return np.random.default_rng(rng.randrange(2**32))
