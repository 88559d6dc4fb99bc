"""Where the real clouds are, and what happens when they are not there."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

PROJECT = Path(__file__).parent.parent
DATA = Path(os.environ.get("MPE_DATA", PROJECT.parent / "shared" / "data"))
REQUIRED = os.environ.get("MPE_REQUIRE_REAL_DATA") == "1"


@pytest.fixture(scope="session")
def data() -> Path:
    """Folder of the real clouds; skipped loudly without it, or a failure where CI needs it."""
    if (DATA / "pairs.json").is_file():
        return DATA
    if REQUIRED:
        pytest.fail(f"MPE_REQUIRE_REAL_DATA=1, but there is no {DATA}/pairs.json; set MPE_DATA")
    pytest.skip(f"no real clouds at {DATA}; set MPE_DATA")


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    if not (DATA / "pairs.json").is_file():
        terminalreporter.section("REAL DATA ABSENT", sep="!", red=True)
        terminalreporter.line(f"Nothing was tested on real clouds: there is no {DATA}/pairs.json.")
        terminalreporter.line("Put the data there or set MPE_DATA.")
