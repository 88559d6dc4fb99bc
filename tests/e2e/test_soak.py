"""A short run of `make soak`."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.e2e.soak.run import run


@pytest.mark.slow
def test_nothing_is_lost_or_shown_to_another_tenant(tmp_path: Path) -> None:
    figures = run(tmp_path, seconds=9, clients=16, seed=1)
    assert figures["faults"] == []
    assert figures["jobs accepted and kept"] > 0
    assert figures["killed, suspended, disk filled"]
