"""A short run of `make chaos`."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.e2e import chaos


@pytest.mark.slow
def test_no_job_is_lost(tmp_path: Path) -> None:
    figures = chaos.run(tmp_path, jobs=12, kills=6, seed=1)
    assert figures["jobs accepted"] == 12
    happened = figures["killed, suspended, clock set"]
    assert sum(happened.values()) >= 6
    assert {"suspension", "clock"} <= set(happened)
