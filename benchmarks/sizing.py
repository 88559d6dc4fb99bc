"""How many workers a database and a store carry: measured costs, sleeping workers, a model."""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

from benchmarks.cluster import (
    POINTS,
    SETTINGS,
    bucket_usage,
    database_usage,
    measure_registrations,
)
from benchmarks.experiment import Experiment, Result, markdown
from benchmarks.sizing_model import describe_model
from benchmarks.sleeping_workers import Costs, Load, drain
from mpe_core.machine import available_cores
from service.database.engine import open_database
from service.settings import BlobSettings
from tests.factories.cluster import running_cluster
from tests.factories.postgres import Postgres, find_programs, running_postgres
from tests.factories.s3 import S3Server, running_s3

REAL_WORKERS = 1
"""Workers whose registrations are measured: a core each, beside database, store and clients."""
DURABLE = {"fsync": "on", "shared_buffers": "128MB", "max_connections": "400"}
LOADS = (
    *(Load(workers=number, sleep_s=None, jobs=min(600, 20 * number)) for number in (1, 8, 50, 200)),
    Load(workers=200, sleep_s=5.0, jobs=400),
)
"""Runs of sleeping workers; None: the measured time of the smallest clouds."""


def run() -> Result:
    """Measure, and return the figures that the page shows."""
    programs = find_programs()
    assert programs is not None, "install the Debian package postgresql"
    registrations = _measure_registrations(programs)
    smallest_s = registrations[str(POINTS[0])]["running_s"]
    runs = []
    for load in LOADS:
        with _servers(programs) as (postgres, url, s3):
            settled = load.with_sleep(smallest_s)
            runs.append(_measure_run(settled, postgres, url, s3))
            print(
                f"  {settled.workers} workers: {runs[-1]['per_s']:.1f} registrations/s", flush=True
            )
    return {
        "cores": available_cores(),
        "load_before": os.getloadavg()[0],
        "registrations": registrations,
        "runs": runs,
    }


def _measure_registrations(programs: Path) -> Result:
    with (
        tempfile.TemporaryDirectory() as directory,
        running_cluster(
            Path(directory), programs, apis=1, workers=REAL_WORKERS, **SETTINGS
        ) as cluster,
    ):
        return measure_registrations(cluster.apis[0].client)


@contextmanager
def _servers(programs: Path) -> Iterator[tuple[Postgres, str, S3Server]]:
    """Yield a durable PostgreSQL, the URL of a new database, and a store."""
    with (
        tempfile.TemporaryDirectory() as directory,
        running_postgres(programs, **DURABLE) as postgres,
        running_s3(Path(directory)) as s3,
    ):
        url = postgres.new_database()
        open_database(url).close()  # makes the tables
        yield postgres, url, s3


def _measure_run(load: Load, postgres: Postgres, url: str, s3: S3Server) -> Result:
    given = s3.new_prefix()
    blob = BlobSettings(**{name.removeprefix("blob_"): value for name, value in given.items()})
    before, store_before_s = database_usage(url), s3.cpu_s
    database_before_s, files_before = postgres.cpu_s, bucket_usage(s3.bucket)
    with closing(open_database(url)) as database:
        costs = drain(load, database, url, blob)
    time.sleep(1)  # the statistics of the server are late
    after, files = database_usage(url), bucket_usage(s3.bucket)
    per_job: dict[str, float] = {name: (after[name] - before[name]) / load.jobs for name in after}
    per_job |= {
        "round trips of the worker": costs.round_trips / load.jobs,
        "database, ms of a core": 1000 * (postgres.cpu_s - database_before_s) / load.jobs,
        "store, ms of a core": 1000 * (s3.cpu_s - store_before_s) / load.jobs,
        **{name: (files[name] - files_before[name]) / load.jobs for name in files},
    }
    return {**_described(load, costs), "per_job": per_job}


def _described(load: Load, costs: Costs) -> dict[str, Any]:
    return {
        "workers": load.workers,
        "sleep_s": load.sleep_s,
        "jobs": load.jobs,
        "per_s": load.jobs / costs.seconds,
        "ideal_per_s": load.ideal_per_s,
        "worker_ms": 1000 * costs.cpu_s / load.jobs,
    }


def table(result: Result) -> str:
    """Return the page's text and tables in Markdown."""
    registrations = [
        (points, each["running_s"], 1 / each["running_s"], 1000 * each["overhead_s"])
        for points, each in result["registrations"].items()
    ]
    runs = [
        (run["workers"], run["sleep_s"], run["per_s"], run["ideal_per_s"], run["worker_ms"])
        for run in result["runs"]
    ]
    names = list(result["runs"][0]["per_job"])
    costs = [
        (f"{run['workers']} of {run['sleep_s']:.2f} s", *(run["per_job"][name] for name in names))
        for run in result["runs"]
    ]
    return (
        f"{result['cores']} cores carry everything: clients, service, workers, PostgreSQL "
        "(fsync on) and the S3 store (rclone). The load of other programs was "
        f"{result['load_before']:.1f} at the start.\n\n"
        "**Measured: registrations**, one worker with one thread, pairs of equal clouds.\n\n"
        + markdown(("points", "s", "registrations/s of a core", "overhead ms"), registrations)
        + "\n\n**Simulated: workers that sleep** in place of a registration. Each claims, looks "
        "twice a second whether its attempt is current, extends its lease, records progress, "
        "stores two objects and commits, as a worker does; 16 threads a process. `ideal` is what "
        "they would do without a queue.\n\n"
        + markdown(("workers", "sleep s", "1/s", "ideal 1/s", "ms of a core of the worker"), runs)
        + "\n\n**What one of these registrations costs** database and store:\n\n"
        + markdown(("workers", *names), costs)
        + "\n\n**Extrapolated** from these figures, not measured:\n\n"
        + describe_model(result)
    )


SIZING = Experiment("sizing", "How many workers", run, table)
