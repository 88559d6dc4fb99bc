"""How soon a registration starts, and ends when cancelled, on another service.

`python -m tests.e2e.queue_latency` prints medians. Services share PostgreSQL and a bucket.
"""

from __future__ import annotations

import json
import statistics
import sys
import tempfile
import time
from contextlib import ExitStack
from datetime import datetime
from pathlib import Path

from tests.factories.postgres import find_programs, running_postgres
from tests.factories.processes import workers
from tests.factories.s3 import running_s3
from tests.factories.scans import arms, as_npy
from tests.factories.server import Server, finished, running_server
from tests.factories.slow import SLOW, slow_pair
from tests.factories.waiting import until

JOBS = 60
CANCELS = 10
CLOUD = as_npy(arms(1))


def main() -> int:
    programs = find_programs()
    assert programs is not None, "install the Debian package postgresql"
    with ExitStack() as stack:
        root = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="mpe-latency-")))
        for name in ("s3", "api", "worker"):
            (root / name).mkdir()
        database_url = stack.enter_context(running_postgres(programs)).new_database()
        store = stack.enter_context(running_s3(root / "s3"))
        settings = {"database_url": database_url, "workers": 1, **store.new_prefix()}
        api = stack.enter_context(
            running_server(root / "api", command=("serve", "--no-workers"), **settings)
        )
        worker = stack.enter_context(
            running_server(root / "worker", command=("worker",), **settings)
        )
        starts = [_start_s(api, number) for number in range(JOBS)]
        print(f"start after acceptance, {JOBS} jobs: {_describe(starts[1:])}")
        cancels = [_cancel_s(api, worker) for _ in range(CANCELS)]
        print(f"end of the process after a cancel, {CANCELS} jobs: {_describe(cancels)}")
    return 0


def _start_s(api: Server, number: int) -> float:
    job_id = api.submit(CLOUD, CLOUD, options=json.dumps({"seed": number})).json()["id"]
    job = finished(api.client, job_id)
    started, created = (
        datetime.fromisoformat(job[f"{name}_at"]) for name in ("started", "created")
    )
    return (started - created).total_seconds()


def _cancel_s(api: Server, worker: Server) -> float:
    job_id = api.submit(*slow_pair(), options=SLOW).json()["id"]
    until(lambda: workers(worker))
    began_at = time.monotonic()
    api.client.delete(f"/v1/registrations/{job_id}").raise_for_status()
    until(lambda: not workers(worker))
    return time.monotonic() - began_at


def _describe(seconds: list[float]) -> str:
    ordered = sorted(seconds)
    return (
        f"median {1000 * statistics.median(ordered):.0f} ms, "
        f"90 % {1000 * ordered[int(0.9 * len(ordered))]:.0f} ms, worst {1000 * ordered[-1]:.0f} ms"
    )


if __name__ == "__main__":
    sys.exit(main())
