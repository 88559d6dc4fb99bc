"""The service does what its OpenAPI description says, for requests made from that description."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.fuzz import api

EXAMPLES = "4"
"""For each operation and phase, beside those at the bounds of the schema; `make fuzz` goes on."""


@pytest.mark.slow
def test_requests_from_the_description(tmp_path: Path) -> None:
    done = api.requests(tmp_path, "--max-examples", EXAMPLES, "--seed", "1", "--no-shrink")
    assert done.returncode == 0, done.stdout
    assert "Stateful" in done.stdout
