"""Many clients of four tenants, a tenth of them hostile; `python -m tests.e2e.soak`.

Meanwhile the server and its processes are killed and suspended, and its disk fills and empties. No
accepted job may be lost, no tenant may see what is another's, no request may be an error of the
service; memory, descriptors and the time of /livez are printed.
"""

from __future__ import annotations

import argparse
import os
import random
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import psutil

from tests.e2e.hostile_requests import send_something_hostile
from tests.factories.logs import logged_errors
from tests.factories.processes import forkserver, suspended
from tests.factories.scans import arms, as_npy
from tests.factories.server import Server, finished, running_server, submit
from tests.factories.tenants import caller, new_key

TENANTS = ("ada", "bo", "cy", "di")
HOSTILE_EVERY = 10
"""Each tenth client is hostile."""
DISK_BYTES = 400 * 2**20
"""Size of the disk that is filled, where the system lets one be made."""
SETTINGS = {
    "require_keys": True,
    "min_free_disk_bytes": 64 * 2**20,
    "maintenance_interval_s": 1,
    "key_queue_limit": 8,
    "head_timeout_s": 2,
    "body_stall_timeout_s": 4,
}
LATER = (409, 410, 429, 503, 507)
"""Answers after which the same request may succeed later."""
EVENT_INTERVAL_S = (1.0, 4.0)
"""Range of the pauses between kills, suspensions and full disks."""


@dataclass
class Soak:
    """One run."""

    server: Server
    disk: Path | None
    seconds: float
    clients: int
    seed: int
    keys: dict[str, str] = field(default_factory=dict)
    accepted: dict[str, str] = field(default_factory=dict)
    """Tenant of each accepted job that nobody has deleted."""
    answers: Counter[str] = field(default_factory=Counter)
    events: Counter[str] = field(default_factory=Counter)
    faults: list[str] = field(default_factory=list)
    disturbed: list[tuple[float, float]] = field(default_factory=list)
    """When each kill, suspension or full disk began and ended, by `time.time`."""
    use: list[tuple[int, float, int]] = field(default_factory=list)
    """Id of the service's process, its memory in MiB, its descriptors; over time."""
    is_over: threading.Event = field(default_factory=threading.Event)

    def run(self) -> dict[str, Any]:
        self.keys = {tenant: new_key(self.server, tenant, queue_limit=None) for tenant in TENANTS}
        threads = [threading.Thread(target=self._behave, args=(i,)) for i in range(self.clients)]
        threads += [threading.Thread(target=call) for call in (self._disturb, self._probe)]
        with livez_times(self.server.port) as livez:
            for thread in threads:
                thread.start()
            time.sleep(self.seconds)
            self.is_over.set()
            for thread in threads:
                thread.join()
        self._check_ends()
        return self._figures([took for at, took in livez if not self._was_disturbed(at, took)])

    def _was_disturbed(self, at: float, took: float) -> bool:
        return any(begin <= at + took and at <= end for begin, end in self.disturbed)

    def _behave(self, number: int) -> None:
        rng = random.Random(self.seed * 1000 + number)
        tenant = TENANTS[number % len(TENANTS)]
        with caller(self.server, self.keys[tenant]) as client:
            client.timeout = httpx.Timeout(30)
            while not self.is_over.is_set():
                try:
                    if number % HOSTILE_EVERY == 0:
                        send_something_hostile(client, self.server.port, rng)
                    else:
                        self._do_something(client, tenant, rng)
                except httpx.TransportError:  # the server was killed, or is suspended
                    self.answers["no answer"] += 1
                    time.sleep(0.1)

    def _do_something(self, client: httpx.Client, tenant: str, rng: random.Random) -> None:
        mine = [job for job, owner in list(self.accepted.items()) if owner == tenant]
        strange = [job for job, owner in list(self.accepted.items()) if owner != tenant]
        choice = rng.random()
        if choice < 0.2 or not mine:
            self._submit(client, tenant, rng)
        elif choice < 0.3 and strange:
            self._look_at_strange(client, rng.choice(strange))
        elif choice < 0.31:
            self._delete(client, rng.choice(mine))
        elif choice < 0.45:
            name, cloud = f"cloud-{rng.randrange(5)}", as_npy(arms(rng.randrange(4)))
            self._note(client.put(f"/v1/clouds/{name}", content=cloud))
        elif choice < 0.5:
            self._check_list(client.get("/v1/registrations?limit=20"), tenant)
        else:
            part = rng.choice(["", "/inliers", "/aligned", "/events", "/deliveries"])
            self._look_at_own(client, f"/v1/registrations/{rng.choice(mine)}{part}")

    def _look_at_own(self, client: httpx.Client, path: str) -> None:
        with client.stream("GET", path) as response:
            if response.headers.get("content-type", "").startswith("text/event-stream"):
                next(response.iter_lines(), None)  # it goes on until the job ends
            else:
                response.read()
                self._note(response)

    def _submit(self, client: httpx.Client, tenant: str, rng: random.Random) -> None:
        cloud, seed = as_npy(arms(rng.randrange(20))), rng.randrange(10**6)
        wait, options = rng.choice((0, 1)), f'{{"seed": {seed}}}'
        response = submit(client, cloud, cloud, wait=wait, options=options)
        self._note(response)
        if response.is_success:
            self.accepted[response.json()["id"]] = tenant

    def _delete(self, client: httpx.Client, job: str) -> None:
        self.accepted.pop(job, None)  # the answer may be lost
        self._note(client.delete(f"/v1/registrations/{job}"))

    def _look_at_strange(self, client: httpx.Client, job: str) -> None:
        response = client.get(f"/v1/registrations/{job}")
        self._note(response)
        if response.status_code not in (404, *LATER):
            self.faults.append(f"a job of another tenant was answered {response.status_code}")

    def _check_list(self, response: httpx.Response, tenant: str) -> None:
        self._note(response)
        if response.is_success:
            for job in response.json()["items"]:
                if self.accepted.get(job["id"], tenant) != tenant:
                    self.faults.append("a list shows a job of another tenant")

    def _note(self, response: httpx.Response) -> None:
        self.answers[str(response.status_code)] += 1
        if response.status_code >= 500 and response.status_code not in LATER:
            self.faults.append(f"{response.request.method} {response.request.url}: {response.text}")

    def _disturb(self) -> None:
        rng = random.Random(self.seed)
        kinds: list[str] = []
        while not self.is_over.wait(rng.uniform(*EVENT_INTERVAL_S)):
            kinds = kinds or ["server", "worker", "forkserver", "suspension", "disk"]
            kind = kinds.pop(rng.randrange(len(kinds)))
            begin = time.time()
            if self._make_happen(kind, rng):
                self.events[kind] += 1
            self.disturbed.append((begin, time.time()))

    def _make_happen(self, kind: str, rng: random.Random) -> bool:
        if kind == "server":
            self.server.kill()
            self.server.start()
        elif kind == "suspension":
            with suspended(self.server):
                time.sleep(rng.uniform(0.5, 2))
        elif kind == "disk":
            return self._fill_disk()
        else:
            with suppress(psutil.Error, IndexError):
                parent = forkserver(self.server)
                rng.choice([parent] if kind == "forkserver" else parent.children()).kill()
        return True

    def _fill_disk(self) -> bool:
        if self.disk is None:
            return False
        ballast = self.disk / "ballast"
        with suppress(OSError), ballast.open("wb") as file:
            while file.write(bytes(2**20)):
                file.flush()
        time.sleep(2)
        ballast.unlink()
        return True

    def _probe(self) -> None:
        """Look at what the service uses."""
        while not self.is_over.wait(0.5):
            with suppress(psutil.Error):
                process = psutil.Process(self.server.pid)
                used = process.memory_info().rss / 2**20
                self.use.append((process.pid, used, process.num_fds()))

    def _check_ends(self) -> None:
        for job, tenant in self.accepted.items():
            with caller(self.server, self.keys[tenant]) as client:
                if client.get(f"/v1/registrations/{job}").status_code != 200:
                    self.faults.append("an accepted job is lost")
                    continue
                end = finished(client, job)
                if end["status"] == "failed" and end["error"]["status"] < 500:
                    self.faults.append(f"a job failed: {end['error']}")

    def _figures(self, livez_s: list[float]) -> dict[str, Any]:
        by_process = Counter(pid for pid, _, _ in self.use)
        longest = max(by_process, key=by_process.__getitem__, default=None)
        memory = [used for pid, used, _ in self.use if pid == longest]
        descriptors = [count for pid, _, count in self.use if pid == longest]
        half = len(memory) // 2
        p50, p99 = (round(1000 * float(s), 1) for s in np.percentile(livez_s or [np.nan], (50, 99)))
        return {
            "jobs accepted and kept": len(self.accepted),
            "faults": self.faults[:20],
            "answers": dict(sorted(self.answers.items())),
            "killed, suspended, disk filled": dict(self.events),
            "errors logged": dict(logged_errors(self.server.log)),
            "/livez p50, p99 (ms)": (p50, p99),
            "memory of the longest process, halves (MiB)": _medians(memory, half),
            "descriptors of the longest process, halves": _medians(descriptors, half),
        }


def _medians(values: list[Any], half: int) -> tuple[float, float]:
    """Medians of both halves; NaN where there are no values."""
    first, second = values[:half] or [np.nan], values[half:] or [np.nan]
    return float(np.median(first)), float(np.median(second))


@contextmanager
def livez_times(port: int) -> Iterator[list[tuple[float, float]]]:
    """Beginning and seconds of calls of /livez, filled in when the context ends."""
    command = [sys.executable, "-m", "tests.e2e.livez_probe", str(port)]
    probe = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    times: list[tuple[float, float]] = []
    reader = threading.Thread(target=_read_times, args=(probe, times))
    reader.start()
    try:
        yield times
    finally:
        assert probe.stdin is not None
        assert probe.stdout is not None
        probe.stdin.close()
        reader.join()
        probe.stdout.close()
        probe.wait()


def _read_times(probe: subprocess.Popen[str], times: list[tuple[float, float]]) -> None:
    assert probe.stdout is not None
    for line in probe.stdout:
        began_at, took_s = map(float, line.split())
        times.append((began_at, took_s))


@contextmanager
def small_disk(directory: Path) -> Iterator[Path | None]:
    """A disk of its own for the data, which can be filled; None where none can be made."""
    directory.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", f"size={DISK_BYTES}", "tmpfs", str(directory)]
    if os.geteuid() or subprocess.run(command, check=False, capture_output=True).returncode:
        yield None
        return
    try:
        yield directory
    finally:
        subprocess.run(["umount", "-l", str(directory)], check=True)


def run(directory: Path, *, seconds: float, clients: int, seed: int) -> dict[str, Any]:
    with (
        small_disk(directory / "data") as disk,
        running_server(directory, **SETTINGS) as server,
    ):
        return Soak(server, disk, seconds, clients, seed).run()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=3600)
    parser.add_argument("--clients", type=int, default=64)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as directory:
        figures = run(Path(directory), **vars(given))
    for name, value in figures.items():
        print(f"{name:46} {value}")


if __name__ == "__main__":
    main()
