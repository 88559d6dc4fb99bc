"""What tests need beside the project: real clouds, PostgreSQL, a browser; what if they lack."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, sync_playwright

from tests.factories.browser import find_chromium, launch
from tests.factories.postgres import Postgres, find_programs, running_postgres
from tests.factories.s3 import S3Server, running_s3

PROJECT = Path(__file__).parent.parent
DATA = Path(os.environ.get("MPE_DATA", PROJECT.parent / "shared" / "data"))
SERVER_TESTS = [PROJECT / "tests" / folder for folder in ("e2e", "unit/service")]
REQUIRED = os.environ.get("MPE_REQUIRE_REAL_DATA") == "1"

POSTGRES_REQUIRED = os.environ.get("MPE_REQUIRE_POSTGRES") == "1"
NO_POSTGRES = "there is no PostgreSQL server: install the Debian package postgresql"

BROWSER_REQUIRED = os.environ.get("MPE_REQUIRE_BROWSER") == "1"
NO_BROWSER = "there is no browser: install the Debian package chromium"


@pytest.fixture(scope="session")
def data() -> Path:
    """Folder of the real clouds; skipped loudly without it, or a failure where CI needs it."""
    if (DATA / "pairs.json").is_file():
        return DATA
    if REQUIRED:
        pytest.fail(f"MPE_REQUIRE_REAL_DATA=1, but there is no {DATA}/pairs.json; set MPE_DATA")
    pytest.skip(f"no real clouds at {DATA}; set MPE_DATA")


@pytest.fixture(scope="session")
def postgres() -> Iterator[Postgres]:
    """A running PostgreSQL; skipped loudly without it, or a failure where CI needs it."""
    programs = find_programs()
    if programs is None:
        (pytest.fail if POSTGRES_REQUIRED else pytest.skip)(NO_POSTGRES)
    with running_postgres(programs) as running:
        yield running


@pytest.fixture(scope="session")
def s3(tmp_path_factory: pytest.TempPathFactory) -> Iterator[S3Server]:
    """A running S3 server with one bucket."""
    with running_s3(tmp_path_factory.mktemp("s3")) as running:
        yield running


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    """A running browser; skipped loudly without it, or a failure where CI needs it.

    For one module only: while it runs, no other test can start an event loop in this process.
    """
    program = find_chromium()
    if program is None:
        (pytest.fail if BROWSER_REQUIRED else pytest.skip)(NO_BROWSER)
    with sync_playwright() as playwright:
        running = launch(playwright, program)
        yield running
        running.close()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Try tests of servers, children and waits again once; a wrong pose never gets a second chance.

    They have deadlines, which a machine that is busy for a minute misses; `-ra` lists them.
    Files with slow tests come first: begun last, one would keep a single core busy at the end.
    """
    slow = {item.path for item in items if item.get_closest_marker("slow")}
    items.sort(key=lambda item: item.path not in slow)
    for item in items:
        if any(folder in item.path.parents for folder in SERVER_TESTS):
            item.add_marker(pytest.mark.flaky(reruns=1, reruns_delay=5))


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    for report in terminalreporter.getreports("passed"):
        for name, value in report.user_properties:
            terminalreporter.line(f"{report.nodeid}: {name}: {value}")
    if find_programs() is None:
        terminalreporter.section("POSTGRESQL ABSENT", sep="!", red=True)
        terminalreporter.line(f"Nothing was tested on it: {NO_POSTGRES}.")
    if find_chromium() is None:
        terminalreporter.section("BROWSER ABSENT", sep="!", red=True)
        terminalreporter.line(f"The page was not tested in one: {NO_BROWSER}.")
    if not (DATA / "pairs.json").is_file():
        terminalreporter.section("REAL DATA ABSENT", sep="!", red=True)
        terminalreporter.line(f"Nothing was tested on real clouds: there is no {DATA}/pairs.json.")
        terminalreporter.line("Put the data there or set MPE_DATA.")
