"""The queue alone, on both databases: 100,000 rows, turns of tenants, many workers that sleep."""

from __future__ import annotations

import statistics
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import psycopg
from sqlalchemy import insert, literal, select

from benchmarks.experiment import Experiment, Result, markdown
from service.database.engine import Database, open_database
from service.database.tables import events, jobs, turns
from service.jobs.missing_workers import MissingWorkers
from service.jobs.model import JobRow
from service.jobs.queries import JobFilter, JobQueries
from service.jobs.search import render_search_text
from service.jobs.transitions import JobTransitions
from service.jobs.worker_slots import WorkerSlots
from service.telemetry.metrics import Metrics
from tests.factories.jobs import OUTCOME, new_job, open_transitions
from tests.factories.postgres import Postgres, find_programs, running_postgres

ROWS, TENANTS = 100_000, 10
CALLS = 100
LEASE_S = 30.0
SLEEP_S = 0.1
"""Time of a registration that is replaced by a sleep: that of two small clouds."""
WORKERS = (1, 2, 4, 8, 50, 200)
JOBS_PER_WORKER, MAX_JOBS = 20, 1000
A_JOBS, B_JOBS, FAIR_WORKERS = 500, 5, 2


def run() -> Result:
    """Measure, and return the figures that the page shows."""
    results: Result = {}
    for name, new_url in _databases():
        url = new_url()
        with closing(open_database(url)) as database:
            fill(database)
            settle(url)
            results[name] = {"rows": measure_rows(database)}
        with closing(open_database(new_url())) as database:
            results[name]["fairness"] = measure_fairness(database)
        results[name]["workers"] = {}
        for number in WORKERS:
            with closing(open_database(new_url())) as database:
                results[name]["workers"][str(number)] = drain(database, number)
    return results


def _databases() -> Iterator[tuple[str, Callable[[], str]]]:
    """Yield the name of each database, and what returns the URL of a new one."""
    with tempfile.TemporaryDirectory() as directory:
        numbers = iter(range(1000))
        yield "SQLite", lambda: f"sqlite:///{Path(directory)}/{next(numbers)}.sqlite3"
    programs = find_programs()
    if programs is not None:
        with _durable_postgres(programs) as postgres:
            yield "PostgreSQL", postgres.new_database


@contextmanager
def _durable_postgres(programs: Path) -> Iterator[Postgres]:
    with running_postgres(programs, fsync="on", shared_buffers="128MB") as postgres:
        yield postgres


def fill(database: Database, rows: int = ROWS, tenants: int = TENANTS) -> None:
    """Half of the rows are queued, half have succeeded; of `tenants` tenants in turn."""
    began_at = JobQueries(database).present() - rows
    with database.write() as connection:
        for start in range(0, rows, 5000):
            made = [_row(number, tenants, began_at) for number in range(start, start + 5000)]
            rows_of_jobs = [asdict(row) | {"search_text": render_search_text(row)} for row in made]
            connection.execute(insert(jobs), rows_of_jobs)
        for number in range(tenants):
            connection.execute(insert(turns).values(tenant=f"t{number}", queue="register", turn=0))
        state = (jobs.c.id, literal(1), jobs.c.created_at, jobs.c.status, jobs.c.stage)
        rows_of_events = select(*state, jobs.c.fraction)
        connection.execute(insert(events).from_select(list(events.c), rows_of_events))


def settle(url: str) -> None:
    """Do what autovacuum does after a while; SQLite has nothing of the kind."""
    if url.startswith("postgresql"):
        with psycopg.connect(url, autocommit=True) as connection:
            connection.execute("VACUUM ANALYZE")


def _row(number: int, tenants: int, began_at: float) -> JobRow:
    created_at = began_at + number
    row = new_job(tenant=f"t{number % tenants}", created_at=created_at)
    row = replace(row, priority=number % 3, labels={"part": f"p{number % 7}"})
    if number >= ROWS // 2:
        return row
    ended = {"status": "succeeded", "started_at": created_at, "finished_at": created_at + 1}
    times = {"result_expires_at": created_at + 1e7, "expires_at": created_at + 2e7}
    return replace(row, attempt=1, confidence=0.9, result_sha256="r", **ended, **times)


def measure_rows(database: Database) -> Result:
    """Measure the milliseconds of each kind of call among ROWS rows."""
    queries, transitions = JobQueries(database), open_transitions(database, queue_limit=10 * ROWS)
    metrics = Metrics()
    slots = WorkerSlots(database, 1)
    slots.announce()
    metrics.watch(queries, slots, MissingWorkers(queries, slots), lambda: True)
    middle = queries.page("t1", limit=1, only=JobFilter(status="succeeded"))[0]
    place = (middle.created_at, middle.id)

    def claim() -> None:
        job = transitions.claim(lease_s=LEASE_S)
        assert job is not None

    calls: dict[str, Callable[[], object]] = {
        "list, first page": lambda: queries.page("t1", limit=50),
        "list, a page in the middle": lambda: queries.page("t1", limit=50, before=place),
        "list of a status": lambda: queries.page("t1", limit=50, only=JobFilter(status="failed")),
        "list of a label": lambda: queries.page(
            "t1", limit=50, only=JobFilter(label=("part", "p1"))
        ),
        "search": lambda: queries.page("t1", limit=50, only=JobFilter(words=("p1", "none"))),
        "submit": lambda: transitions.add(new_job(tenant="t2"), tenant_queue_limit=10 * ROWS),
        "look for work": lambda: transitions.is_claimable("register"),
        "claim": claim,
        "/metrics": metrics.exposition,
        "leases and deadlines": lambda: (transitions.expire_leases(), transitions.fail_overdue()),
    }
    return {name: _spread_ms(call) for name, call in calls.items()}


def _spread_ms(call: Callable[[], object]) -> dict[str, float]:
    times = []
    call()
    for _ in range(CALLS):
        started = time.perf_counter()
        call()
        times.append(1000 * (time.perf_counter() - started))
    return {"median": statistics.median(times), "p99": float(np.percentile(times, 99))}


def measure_fairness(database: Database) -> Result:
    """Measure the seconds until the last of B's jobs ends, alone and behind A's queue."""
    transitions = open_transitions(database, queue_limit=10_000)
    alone_s = _wait_of_b(transitions)
    for _ in range(A_JOBS):
        transitions.add(new_job(tenant="a"))
    return {"alone_s": alone_s, "behind_s": _wait_of_b(transitions)}


def _wait_of_b(transitions: JobTransitions) -> float:
    left, done = [B_JOBS], threading.Event()

    def ended(job: JobRow) -> None:
        left[0] -= job.tenant == "b"
        if not left[0]:
            done.set()

    with sleeping_workers(transitions, FAIR_WORKERS, ended):
        time.sleep(SLEEP_S / 2)  # workers are at work, if there is any
        started = time.perf_counter()
        for _ in range(B_JOBS):
            transitions.add(new_job(tenant="b"))
        done.wait()
        return time.perf_counter() - started


def drain(database: Database, workers: int) -> Result:
    """Measure the jobs a second of workers that sleep for SLEEP_S in place of a registration."""
    transitions = open_transitions(database, queue_limit=10_000)
    number = min(MAX_JOBS, JOBS_PER_WORKER * workers)
    for place in range(number):
        transitions.add(new_job(tenant=f"t{place % TENANTS}"))
    left, done, lock = [number], threading.Event(), threading.Lock()

    def ended(_: JobRow) -> None:
        with lock:
            left[0] -= 1
        if not left[0]:
            done.set()

    started = time.perf_counter()
    with sleeping_workers(transitions, workers, ended):
        done.wait()
    seconds = time.perf_counter() - started
    return {"jobs_per_s": number / seconds, "ideal": workers / SLEEP_S}


@contextmanager
def sleeping_workers(
    transitions: JobTransitions, number: int, ended: Callable[[JobRow], None]
) -> Iterator[None]:
    """Claim, sleep, record progress as a registration does, and commit, in `number` threads."""
    stopping = threading.Event()

    def work() -> None:
        while not stopping.is_set():
            job = transitions.claim(lease_s=LEASE_S)
            if job is None:
                time.sleep(0.005)
                continue
            transitions.record_progress(job, "search", 0.5)
            time.sleep(SLEEP_S)
            transitions.succeed(job, OUTCOME, None)
            ended(job)

    threads = [threading.Thread(target=work) for _ in range(number)]
    for thread in threads:
        thread.start()
    try:
        yield
    finally:
        stopping.set()
        for thread in threads:
            thread.join()


def table(result: Result) -> str:
    """Return the page's text and tables in Markdown."""
    names = list(result)
    rows = [
        (call, *(result[name]["rows"][call][key] for name in names for key in ("median", "p99")))
        for call in next(iter(result.values()))["rows"]
    ]
    heads = [f"{name} {key} ms" for name in names for key in ("median", "p99")]
    fairness = [(name, *result[name]["fairness"].values()) for name in names]
    workers = [
        (
            number,
            *(result[name]["workers"][str(number)]["jobs_per_s"] for name in names),
            number / SLEEP_S,
        )
        for number in WORKERS
    ]
    return (
        f"**Rows.** {ROWS:,} registrations of {TENANTS} tenants, half of them queued; {CALLS} "
        "calls of each kind, without HTTP.\n\n"
        + markdown(("call", *heads), rows)
        + f"\n\n**Turns.** Tenant B's {B_JOBS} registrations, {FAIR_WORKERS} workers, seconds "
        f"until the last has ended: alone, and behind {A_JOBS} of tenant A.\n\n"
        + markdown(("database", "alone", f"behind {A_JOBS}"), fairness)
        + f"\n\n**Workers.** Registrations a second, where each is replaced by a sleep of "
        f"{SLEEP_S} s: claim, one message of progress, commit, from threads of one process. The "
        "last column is what they would do without a queue.\n\n"
        + markdown(("workers", *(f"{name}, 1/s" for name in names), "without a queue"), workers)
    )


QUEUE = Experiment("queue", "The queue alone", run, table)
