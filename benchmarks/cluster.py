"""Registrations a second of 1, 2 and 4 workers: one service with SQLite, and a cluster."""

from __future__ import annotations

import itertools
import statistics
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx
import psycopg

from benchmarks.experiment import Experiment, Result, markdown
from tests.factories.cluster import running_cluster
from tests.factories.postgres import find_programs
from tests.factories.scans import arms, as_npy
from tests.factories.server import finished, running_server, submit

WORKERS = (1, 2, 4)
POINTS = (300, 3_000, 30_000)
JOBS = {300: 40, 3_000: 20, 30_000: 10}
"""Registrations measured, by points."""
CLIENTS = 8
SETTINGS = {"threads_per_worker": 1, "key_requests_per_s": 0}
WARM_UP = 2
_seeds = itertools.count()


def run() -> Result:
    """Measure, and return the figures that the page shows."""
    result: Result = {"embedded": {}, "cluster": {}}
    for number in WORKERS:
        with _embedded(number) as client:
            result["embedded"][str(number)] = measure_registrations(client)
        with _cluster(number) as (client, url, bucket):
            measured = measure_registrations(client)
            measured["cost"] = _measure_cost(client, url, bucket)
            result["cluster"][str(number)] = measured
    return result


@contextmanager
def _embedded(workers: int) -> Iterator[httpx.Client]:
    with (
        tempfile.TemporaryDirectory() as directory,
        running_server(Path(directory), workers=workers, **SETTINGS) as server,
    ):
        yield server.client


@contextmanager
def _cluster(workers: int) -> Iterator[tuple[httpx.Client, str, Path]]:
    programs = find_programs()
    assert programs is not None, "install the Debian package postgresql"
    with (
        tempfile.TemporaryDirectory() as directory,
        running_cluster(Path(directory), programs, apis=1, workers=workers, **SETTINGS) as cluster,
    ):
        yield cluster.apis[0].client, cluster.database_url, cluster.store.bucket


def measure_registrations(client: httpx.Client) -> Result:
    """Measure by points: registrations a second, and the seconds that each spends computing.

    `overhead_s` is the time between two ends less the time between claim and end, for one worker.
    """
    measured: Result = {}
    for points in POINTS:
        cloud = as_npy(arms(1, points))
        _register_all(client, cloud, WARM_UP)
        started = time.perf_counter()
        jobs = _register_all(client, cloud, JOBS[points])
        seconds = time.perf_counter() - started
        computing_s = [job["timing"]["total_s"] - job["timing"]["queued_s"] for job in jobs]
        running_s = statistics.median(computing_s)
        measured[str(points)] = {
            "per_s": len(jobs) / seconds,
            "running_s": running_s,
            "overhead_s": max(0.0, seconds / len(jobs) - running_s),
        }
    return measured


def _register_all(client: httpx.Client, cloud: bytes, number: int) -> list[dict[str, Any]]:
    def register(_: int) -> dict[str, Any]:
        answer = submit(client, cloud, cloud, options=f'{{"seed": {next(_seeds)}}}')
        return finished(client, answer.raise_for_status().json()["id"])

    with ThreadPoolExecutor(CLIENTS) as pool:
        return list(pool.map(register, range(number)))


def _measure_cost(client: httpx.Client, url: str, bucket: Path) -> dict[str, float]:
    """Measure what one registration of new clouds costs database and store."""
    number = 10
    before = _usage(url, bucket)
    for _ in range(number):
        _register_all(client, as_npy(arms(1000 + next(_seeds))), 1)
    time.sleep(2)  # the statistics of the server are late
    after = _usage(url, bucket)
    return {name: (after[name] - before[name]) / number for name in after}


def _usage(url: str, bucket: Path) -> dict[str, float]:
    return {**database_usage(url), **bucket_usage(bucket)}


def database_usage(url: str) -> dict[str, float]:
    """Return what the database has done so far."""
    query = (
        "SELECT xact_commit, tup_inserted, tup_updated,"
        " pg_wal_lsn_diff(pg_current_wal_lsn(), '0/0')"
        " FROM pg_stat_database WHERE datname = current_database()"
    )
    with psycopg.connect(url) as connection:
        row = connection.execute(query).fetchone()
    assert row is not None
    names = ("transactions", "rows inserted", "rows updated", "bytes of the log")
    return dict(zip(names, map(float, row), strict=True))


def bucket_usage(bucket: Path) -> dict[str, float]:
    """Return how many objects the folder of a bucket holds, and their bytes."""
    sizes = [path.stat().st_size for path in bucket.rglob("*") if path.is_file()]
    return {"objects": len(sizes), "bytes of objects": sum(sizes)}


def table(result: Result) -> str:
    """Return the page's text and tables in Markdown."""
    rows = []
    for points, number in itertools.product(POINTS, WORKERS):
        both = [result[form][str(number)][str(points)] for form in ("embedded", "cluster")]
        overheads = [1000 * each["overhead_s"] if number == 1 else "" for each in both]
        rows.append((points, number, *(each["per_s"] for each in both), *overheads))
    heads = ("points", "workers", "embedded, 1/s", "cluster, 1/s")
    heads += ("embedded, overhead ms", "cluster, overhead ms")
    cost = result["cluster"]["1"]["cost"]
    return (
        f"{CLIENTS} clients post pairs of equal clouds over HTTP and wait for the end; each worker "
        "computes with one thread. Embedded: one service with SQLite. Cluster: one service for "
        "the API, workers of their own, PostgreSQL, an S3 store, all on this machine. Overhead: "
        "the time between two ends of one worker, less the time between claim and end.\n\n"
        + markdown(heads, rows)
        + "\n\nWhat one registration of two new clouds of 300 points costs database and store:\n\n"
        + markdown(("", "of one registration"), list(cost.items()))
    )


CLUSTER = Experiment("cluster", "One service and a cluster", run, table)
