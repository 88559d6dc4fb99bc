"""Short runs of `make chaos`: of one service, and of a cluster."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.e2e import chaos, cluster_chaos
from tests.factories.postgres import Postgres


@pytest.mark.slow
def test_no_job_is_lost(tmp_path: Path) -> None:
    figures = chaos.run(tmp_path, jobs=12, kills=6, seed=1)
    assert figures["jobs accepted"] == 12
    happened = figures["killed, suspended, clock set"]
    assert sum(happened.values()) >= 6
    assert {"suspension", "clock"} <= set(happened)


@pytest.mark.slow
def test_no_job_of_a_cluster_is_lost(tmp_path: Path, postgres: Postgres) -> None:
    """A worker, the store and a database of its own are killed; then the network is cut."""
    figures = cluster_chaos.run(
        tmp_path,
        postgres.programs,
        jobs=6,
        kills=3,
        seed=35,
        clients=3,
        apis=1,
        workers=2,
        cut_points=15_000,
        lease_s=2,
        blob_grace_s=1,
    )
    assert figures["jobs accepted"] == 7
    assert sum(figures["killed"].values()) >= 3
    assert figures["late result after a cut of the network"] == "refused"
