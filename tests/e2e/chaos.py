"""Jobs submitted while the server is killed, suspended, its clock set; `python -m tests.e2e.chaos`.

Every accepted job must end exactly once, in the right result or an explained failure; every
callback must come; no process, file or job may be left over.
"""

from __future__ import annotations

import argparse
import json
import random
import tempfile
import threading
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx
import psutil

from tests.factories.chaos_jobs import Wanted, check_end, wanted, was_lost
from tests.factories.logs import logged_errors
from tests.factories.postgres import find_programs, running_postgres
from tests.factories.processes import all_of, forkserver, suspended
from tests.factories.receiver import Receiver, receiving
from tests.factories.scans import as_npy
from tests.factories.server import PROJECT, Server, finished, running_server, submit
from tests.factories.waiting import until

SETTINGS = {
    "webhook_hosts": "127.0.0.1",
    "webhook_secret": "chaos",
    "private_networks": "127.0.0.0/8",
    "webhook_backoff_s": 0.2,
    "blob_grace_s": 20,
    "maintenance_interval_s": 0.5,
    "result_retention_s": 1e6,  # beyond all jumps of the clock
}
KINDS = ("server", "forkserver", "worker", "worker", "suspension", "clock")
CLOCK_JUMP_S = 700.0
"""More than MPE_JOB_TIMEOUT_S and all leases."""
SHORT_S = (0.2, 2.0)
"""Range of the lengths of suspensions, beside the long one."""


@dataclass
class Chaos:
    """One run; fixed by its seed up to the timing of the machine."""

    server: Server
    receiver: Receiver
    jobs: int
    kills: int
    seed: int
    clock: Path
    long_suspension_s: float = 0.0
    """Length of the first suspension; 0: it is as short as the others."""
    accepted: dict[str, Wanted] = field(default_factory=dict)
    killed: Counter[str] = field(default_factory=Counter)

    def run(self, clients: int = 8) -> dict[str, Any]:
        started = time.monotonic()
        killer = threading.Thread(target=self._kill_again_and_again)
        killer.start()
        with ThreadPoolExecutor(clients) as pool:
            list(pool.map(self._submit, range(self.jobs)))
        killer.join()
        ended = self._ends()
        self._check_callbacks(ended)
        attempts = Counter(job["attempt"] for job in ended.values())
        self._check_nothing_is_left()
        return {
            "jobs accepted": len(self.accepted),
            "succeeded": sum(job["status"] == "succeeded" for job in ended.values()),
            "failed for their input": sum(w.is_bad for w in self.accepted.values()),
            "failed after three lost attempts": sum(map(was_lost, ended.values())),
            "killed, suspended, clock set": dict(self.killed),
            "attempts needed: jobs": dict(sorted(attempts.items())),
            "callbacks received": len(self.receiver.received),
            "errors logged": dict(logged_errors(self.server.log)),
            "seconds": round(time.monotonic() - started, 1),
        }

    def _submit(self, number: int) -> None:
        """Until it is accepted; the key makes sure that it is accepted once."""
        in_step = self.kills * number // self.jobs - 1
        until(lambda: sum(self.killed.values()) >= in_step, within_s=600)
        one = wanted(self.seed, number)
        with httpx.Client(base_url=self.server.url, timeout=30, trust_env=False) as client:
            self.accepted[until(lambda: self._try(client, one))] = one

    def _try(self, client: httpx.Client, wanted: Wanted) -> str:
        """Id of the job; empty when nobody answered, or with "later"."""
        files = as_npy(wanted.source), as_npy(wanted.target)
        key = {"Idempotency-Key": f"job-{wanted.number}"}
        try:
            response = submit(client, *files, headers=key, callback_url=self.receiver.url)
        except httpx.TransportError:
            return ""
        if response.status_code in (409, 429, 503):
            return ""
        # 200 or 422: it had ended before the repetition
        assert response.status_code in (200, 202, 422), response.text
        return str(response.json()["job" if response.status_code == 422 else "id"])

    def _kill_again_and_again(self) -> None:
        rng = random.Random(self.seed)
        kinds: list[str] = []
        while sum(self.killed.values()) < self.kills:
            time.sleep(rng.uniform(0.05, 0.6))
            kinds = kinds or rng.sample(KINDS, len(KINDS))
            kind = kinds.pop()
            if kind == "suspension":
                self._suspend(rng)
            elif kind == "clock":
                self.clock.write_text(str(CLOCK_JUMP_S * (self.killed["clock"] + 1)))
            elif kind == "server":
                self.server.kill()
                self.server.start(ready=False)
            elif not self._kill_below(kind, rng):
                continue
            self.killed[kind] += 1

    def _suspend(self, rng: random.Random) -> None:
        is_long = self.long_suspension_s > 0 and not self.killed["suspension"]
        with suspended(self.server):
            time.sleep(self.long_suspension_s if is_long else rng.uniform(*SHORT_S))

    def _kill_below(self, kind: str, rng: random.Random) -> bool:
        """Kill the forkserver, or a worker as soon as there is one; False when there is none."""
        for _ in range(100):
            try:
                parent = forkserver(self.server)
                rng.choice([parent] if kind == "forkserver" else parent.children()).kill()
                return True
            except (psutil.NoSuchProcess, IndexError):
                time.sleep(0.01)
        return False

    def _ends(self) -> dict[str, dict[str, Any]]:
        ended = {}
        for job_id, one in self.accepted.items():
            job = finished(self.server.client, job_id)
            check_end(job, one)
            self._check_ended_once(job_id)
            ended[job_id] = job
        assert len(ended) == self.jobs, "a job was accepted twice, or forgotten"
        return ended

    def _check_ended_once(self, job_id: str) -> None:
        text = self.server.client.get(f"/v1/registrations/{job_id}/events").text
        events = [json.loads(line[6:]) for line in text.splitlines() if line.startswith("data: ")]
        ends = [event for event in events if event["status"] in ("succeeded", "failed")]
        assert len(ends) == 1, events

    def _check_callbacks(self, ended: dict[str, dict[str, Any]]) -> None:
        until(lambda: set(ended) <= {event["data"]["id"] for event in self._events()})
        for event in self._events():
            assert event["type"] == f"registration.{ended[event['data']['id']]['status']}"

    def _events(self) -> list[dict[str, Any]]:
        return [json.loads(body) for _, body in list(self.receiver.received)]

    def _check_nothing_is_left(self) -> None:
        for job_id in self.accepted:
            assert self.server.client.delete(f"/v1/registrations/{job_id}").status_code == 204
        kept = [self.server.data_dir / name for name in ("blobs", "incoming", "scratch")]
        until(lambda: not [p for folder in kept for p in folder.rglob("*") if p.is_file()])
        self.server.stop()
        _, alive = psutil.wait_procs(all_of(self.server.data_dir), timeout=60)
        assert not alive, f"processes are left: {alive}"


def run(
    directory: Path,
    *,
    jobs: int,
    kills: int,
    seed: int,
    long_suspension_s: float = 0.0,
    **settings: object,
) -> dict[str, Any]:
    clock = directory / "clock"
    clock.write_text("0")
    environment = {"PYTHONPATH": PROJECT / "tests/factories/clock", "TEST_CLOCK_FILE": clock}
    settings = SETTINGS | environment | settings
    with receiving() as receiver, running_server(directory, **settings) as server:
        try:
            return Chaos(server, receiver, jobs, kills, seed, clock, long_suspension_s).run()
        except (AssertionError, httpx.HTTPError) as error:
            error.add_note(server.log[-20000:])
            raise


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--jobs", type=int, default=300)
    parser.add_argument("--kills", type=int, default=25)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--postgres", action="store_true", help="keep the jobs in PostgreSQL")
    parser.add_argument("--suspension-s", type=float, default=35, help="length of the first")
    given = parser.parse_args()
    with ExitStack() as stack:
        directory = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        settings = {}
        if given.postgres:
            programs = find_programs() or parser.error("there is no PostgreSQL server")
            postgres = stack.enter_context(running_postgres(programs))
            settings["database_url"] = postgres.new_database()
        counts = {"jobs": given.jobs, "kills": given.kills, "seed": given.seed}
        counts["long_suspension_s"] = given.suspension_s
        figures = run(directory, **counts, **settings)
    for name, value in figures.items():
        print(f"{name:34} {value}")


if __name__ == "__main__":
    main()
