"""The service: what it adds to a call, how many jobs it does, how long they wait."""

from __future__ import annotations

import io
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from benchmarks.experiment import DATA, Experiment, Result, markdown, timed
from mpe_core import register
from tests.clouds import bunny, moved
from tests.server import Server, running_server

JOBS = 60
CLIENTS = (1, 2, 8)


def _file(points: np.ndarray) -> bytes:
    buffer = io.BytesIO()
    np.save(buffer, points.astype(np.float32))
    return buffer.getvalue()


def _job(server: Server, pair: tuple[bytes, bytes]) -> float:
    """Seconds from the request to the finished job."""
    response, seconds = timed(lambda: server.submit(*pair, wait=60))
    if response.status_code != 200 or response.json()["status"] != "succeeded":
        raise RuntimeError(response.text)
    return float(seconds)


def run() -> Result:
    cloud = bunny(DATA)
    trials = [moved(cloud, np.random.default_rng(seed)) for seed in range(JOBS * len(CLIENTS))]
    calls = [timed(register, trial.source, trial.target)[1] for trial in trials[: JOBS + 1]][1:]
    files = [(_file(trial.source), _file(trial.target)) for trial in trials]
    rows = []
    with tempfile.TemporaryDirectory() as folder, running_server(Path(folder)) as server:
        for turn, clients in enumerate(CLIENTS):
            start = time.perf_counter()
            with ThreadPoolExecutor(clients) as pool:
                mine = files[turn * JOBS : (turn + 1) * JOBS]
                seconds = list(pool.map(lambda pair: _job(server, pair), mine))
            took = time.perf_counter() - start
            rows.append({"clients": clients, "seconds": seconds, "per_second": JOBS / took})
    return {"rows": rows, "call": float(np.median(calls))}


def table(result: Result) -> str:
    rows = [
        (
            r["clients"],
            r["per_second"],
            *(float(np.quantile(r["seconds"], q)) for q in (0.5, 0.95, 0.99)),
        )
        for r in result["rows"]
    ]
    extra = float(np.median(result["rows"][0]["seconds"])) - result["call"]
    return (
        f"{JOBS} registrations of two clouds of 1,889 points over HTTP, upload to finished job, "
        f"every pair different. The same call in the process takes {result['call']:.3f} s, so one "
        f"client waits {extra:.3f} s for the service itself.\n\n"
        + markdown(("clients at once", "jobs/s", "p50, s", "p95, s", "p99, s"), rows)
    )


SERVICE = Experiment("service", "The service under load", run, table)
