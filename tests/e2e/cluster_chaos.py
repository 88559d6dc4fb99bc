"""Jobs in a cluster whose parts are killed; `python -m tests.e2e.cluster_chaos`.

Services, database and store are killed at random and started again: every job must end exactly
once, in the right result, and every callback must come. Then the network between a worker and the
database is cut: another worker takes its job, and its own late result must be refused.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import statistics
import sys
import tempfile
import time
from collections import Counter, defaultdict
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx
import psutil
from sqlalchemy import select

from service.auth.keys import KeyLimits, KeyStore
from service.database.engine import Database, open_database
from service.database.tables import deliveries, events, jobs
from service.jobs.model import TERMINAL_STATUSES
from tests.factories.chaos_jobs import Wanted, check_end, wanted, was_lost
from tests.factories.cluster import Cluster, running_cluster
from tests.factories.cluster_kills import Killer, Loss
from tests.factories.logs import logged_errors, without_requests
from tests.factories.postgres import find_programs
from tests.factories.processes import all_of, suspended, workers
from tests.factories.receiver import Receiver, receiving
from tests.factories.scans import arms, as_npy
from tests.factories.server import submit
from tests.factories.waiting import until

SETTINGS = {
    "webhook_hosts": "127.0.0.1",
    "webhook_secret": "chaos",
    "private_networks": "127.0.0.0/8",
    "webhook_backoff_s": 0.2,
    "maintenance_interval_s": 0.5,
}
TENANTS = ("lab", "field")
UNLIMITED = KeyLimits(0, 0, 0)
REPORT_EVERY = 50
"""Jobs accepted between two lines of a run's progress."""
LATER = (409, 429, 503)
EMPTY_S = 240.0
"""Wait for an empty bucket: the clean-up's grace, and what a busy machine takes."""
CUT_POINTS = 40_000
"""Points of the cloud whose registration is under way when the network is cut: seconds of work."""


@dataclass
class ClusterChaos:
    """One run; fixed by its seed up to the timing of the machine."""

    cluster: Cluster
    database: Database
    receiver: Receiver
    jobs: int
    kills: int
    seed: int
    cut_points: int
    keys: list[str] = field(default_factory=list)
    accepted: dict[str, Wanted] = field(default_factory=dict)

    def run(self, clients: int) -> dict[str, Any]:
        store = KeyStore(self.database)
        self.keys = [store.create(tenant, "chaos", UNLIMITED) for tenant in TENANTS]
        self._started = time.monotonic()
        self._killer = Killer(self.cluster, self.kills, self.seed)
        with ThreadPoolExecutor(clients) as pool:
            submitted = pool.map(self._submit, range(self.jobs))
            self._killer.run()
            list(submitted)
        self._report("all are accepted, and everything is up again")
        ended = self._check_ends()
        self._report("all have ended")
        self._check_callbacks(ended)
        seconds = time.monotonic() - self._started
        recovery_s = find_recoveries(self.database, self._killer.losses)
        self._report(f"killed workers: {describe(recovery_s)} s to the next attempt")
        refused = self._cut_network()
        self._report("the late result was refused")
        self._check_nothing_is_left()
        return {
            "jobs accepted": len(self.accepted),
            "succeeded": sum(job["status"] == "succeeded" for job in ended.values()),
            "failed for their input": sum(w.is_bad for w in self.accepted.values()),
            "failed after three lost attempts": sum(map(was_lost, ended.values())),
            "killed": dict(self._killer.killed),
            "attempts needed: jobs": dict(
                sorted(Counter(j["attempt"] for j in ended.values()).items())
            ),
            "callbacks: planned, received": (len(ended), len(self.receiver.received)),
            "seconds from a worker's SIGKILL to the next attempt": describe(recovery_s),
            "late result after a cut of the network": refused,
            "errors logged": count_kinds(logged_errors(self.cluster.log)),
            "seconds": round(seconds, 1),
        }

    def _submit(self, number: int) -> None:
        """Until it is accepted; the key makes sure that it is accepted once."""
        in_step = self.kills * number // self.jobs - 1
        until(lambda: self._killer.total >= in_step, within_s=600)
        one, rng = wanted(self.seed, number, some_slow=True), random.Random(number)
        self.accepted[until(lambda: self._try(one, rng), within_s=300)] = one
        if not len(self.accepted) % REPORT_EVERY:
            self._report(f"{len(self.accepted)} jobs accepted, {self._killer.total} kills")

    def _report(self, text: str) -> None:
        print(f"{time.monotonic() - self._started:6.0f} s  {text}", file=sys.stderr, flush=True)

    def _try(self, one: Wanted, rng: random.Random) -> str:
        """Id of the job; empty when the service did not answer, or with "later"."""
        headers = {"Idempotency-Key": f"job-{one.number}", **self._auth(one.number)}
        url = rng.choice(self.cluster.apis).url
        files = as_npy(one.source), as_npy(one.target)
        with httpx.Client(base_url=url, timeout=30, trust_env=False) as client:
            try:
                answer = submit(client, *files, headers=headers, callback_url=self.receiver.url)
            except httpx.TransportError:
                return ""
        if answer.status_code in LATER:
            return ""
        # 200 or 422: it had ended before the repetition
        assert answer.status_code in (200, 202, 422), answer.text
        return str(answer.json()["job" if answer.status_code == 422 else "id"])

    def _auth(self, number: int) -> dict[str, str]:
        return {"Authorization": f"Bearer {self.keys[number % len(TENANTS)]}"}

    def _check_ends(self) -> dict[str, dict[str, Any]]:
        """Ask another service than the one that accepted it, half of the time."""
        assert len(self.accepted) == self.jobs, "a job was accepted twice, or forgotten"
        ended = {}
        for job_id, one in self.accepted.items():
            ended[job_id] = self._finished(job_id, one.number)
            check_end(ended[job_id], one)
        with self.database.read() as connection:
            ends = Counter(
                connection.scalars(
                    select(events.c.job_id).where(events.c.status.in_(TERMINAL_STATUSES))
                )
            )
        assert dict(ends) == dict.fromkeys(self.accepted, 1), "a job ended twice, or never"
        return ended

    def _finished(self, job_id: str, number: int) -> dict[str, Any]:
        client = self.cluster.apis[number % len(self.cluster.apis)].client
        headers = {"Prefer": "wait=5", **self._auth(number)}

        def ended() -> dict[str, Any] | None:
            job = client.get(f"/v1/registrations/{job_id}", headers=headers).json()
            return job if job["status"] in TERMINAL_STATUSES else None

        job = until(ended, within_s=300)
        assert job is not None
        return job

    def _check_callbacks(self, ended: dict[str, dict[str, Any]]) -> None:
        """Each job has one message, which was delivered; it may have come more than once."""
        until(lambda: set(self._statuses()) == {"delivered"}, within_s=300)
        messages: dict[str, set[str]] = defaultdict(set)
        for headers, body in list(self.receiver.received):
            event = json.loads(body)
            assert event["type"] == f"registration.{ended[event['data']['id']]['status']}"
            messages[event["data"]["id"]].add(headers["webhook-id"])
        assert {job_id: len(ids) for job_id, ids in messages.items()} == dict.fromkeys(ended, 1)

    def _statuses(self) -> list[str]:
        with self.database.read() as connection:
            return list(connection.scalars(select(deliveries.c.status)))

    def _cut_network(self) -> str:
        """Cut a worker off until another one has done its job; return what became of its result.

        It is suspended meanwhile, so that it has its result only when the other one has ended,
        however busy the machine is; the network comes back after that.
        """
        first, *others = self.cluster.workers
        cloud = as_npy(arms(self.seed + 1, self.cut_points))
        headers = self._auth(0)
        with ExitStack() as first_waits:
            with ExitStack() as others_wait:
                for each in others:
                    others_wait.enter_context(suspended(each))
                answer = submit(self.cluster.apis[0].client, cloud, cloud, headers=headers)
                job_id = answer.json()["id"]
                until(lambda: workers(first))
                self.cluster.network.cut()
                first_waits.enter_context(suspended(first))
            ended = self._finished(job_id, 0)
        assert (ended["status"], ended["attempt"]) == ("succeeded", 2), ended
        before = self._row(job_id)
        until(lambda: not workers(first), within_s=300)
        self.cluster.network.mend()
        until(lambda: "came too late and was refused" in first.log)
        assert self._row(job_id) == before
        self.accepted[job_id] = wanted(self.seed, 0)
        return "refused"

    def _row(self, job_id: str) -> tuple[Any, ...]:
        with self.database.read() as connection:
            return tuple(connection.execute(select(jobs).where(jobs.c.id == job_id)).one())

    def _objects_left(self) -> list[str]:
        walk = os.walk(self.cluster.store.bucket)  # folders vanish meanwhile
        return [f"{folder}/{name}" for folder, _, names in walk for name in names]

    def _check_nothing_is_left(self) -> None:
        client = self.cluster.apis[0].client
        for job_id, one in self.accepted.items():
            path = f"/v1/registrations/{job_id}"
            assert client.delete(path, headers=self._auth(one.number)).status_code == 204
        self._report("all are deleted")
        deadline = time.monotonic() + EMPTY_S
        while (left := self._objects_left()) and time.monotonic() < deadline:
            time.sleep(0.5)
        assert not left, f"{len(left)} objects are left in the bucket: {left[:5]}"
        for service in self.cluster.services:
            if service.is_running:
                until(lambda: not list((service.data_dir / "scratch").iterdir()))  # noqa: B023
                service.stop()
            _, alive = psutil.wait_procs(all_of(service.data_dir), timeout=60)
            assert not alive, f"processes are left: {alive}"


def find_recoveries(database: Database, losses: list[Loss]) -> list[float]:
    """Seconds from each kill of a worker to the next attempt at what it was at."""
    found = []
    with database.read() as connection:
        for loss in losses:
            later = select(events).where(events.c.job_id == loss.job_id, events.c.at > loss.at)
            rows = connection.execute(later.order_by(events.c.number)).all()
            statuses = [row.status for row in rows]
            if "queued" in statuses and "running" in statuses:
                found.append(rows[statuses.index("running")].at - loss.at)
    return found


def count_kinds(messages: Counter[str]) -> dict[str, int]:
    """The numbers of messages that begin alike, up to their first colon."""
    kinds: Counter[str] = Counter()
    for message, number in messages.items():
        kinds[message.partition(":")[0]] += number
    return dict(kinds)


def describe(seconds: list[float]) -> str:
    if not seconds:
        return "no worker was at a job"
    return f"median {statistics.median(seconds):.1f}, most {max(seconds):.1f}, of {len(seconds)}"


def run(
    directory: Path,
    programs: Path,
    *,
    jobs: int,
    kills: int,
    seed: int,
    clients: int = 16,
    apis: int = 2,
    workers: int = 3,
    cut_points: int = CUT_POINTS,
    **settings: object,
) -> dict[str, Any]:
    settings = SETTINGS | settings
    with (
        receiving() as receiver,
        running_cluster(directory, programs, apis=apis, workers=workers, **settings) as cluster,
    ):
        database = open_database(cluster.database_url)
        try:
            chaos = ClusterChaos(cluster, database, receiver, jobs, kills, seed, cut_points)
            return chaos.run(clients)
        except (AssertionError, httpx.HTTPError) as error:
            error.add_note(without_requests(cluster.log)[-20_000:])
            raise
        finally:
            database.close()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--jobs", type=int, default=500)
    parser.add_argument("--kills", type=int, default=35)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    programs = find_programs() or parser.error("there is no PostgreSQL server")
    with tempfile.TemporaryDirectory() as directory:
        counts = {"jobs": given.jobs, "kills": given.kills, "seed": given.seed}
        figures = run(Path(directory), programs, **counts, blob_grace_s=20)
    for name, value in figures.items():
        print(f"{name:52} {value}")


if __name__ == "__main__":
    main()
