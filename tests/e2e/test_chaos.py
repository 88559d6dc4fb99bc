"""A short run of `make chaos`."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.e2e import chaos


@pytest.mark.slow
def test_no_job_is_lost(tmp_path: Path) -> None:
    figures = chaos.run(tmp_path, jobs=40, kills=8, seed=1)
    assert figures["jobs accepted"] == 40
    assert sum(figures["killed"].values()) >= 8
