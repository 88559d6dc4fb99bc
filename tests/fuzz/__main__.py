"""`make fuzz`: every reader and the API fuzzed for a while; exits with 1 when one was broken."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

from service.formats import FORMATS
from tests.fuzz import api

FOLDER = Path("build/fuzz").resolve()


def main() -> int:
    seconds = sys.argv[1]
    FOLDER.mkdir(parents=True, exist_ok=True)
    broken = [format.name for format in FORMATS if not _holds(format.name, seconds)]
    return 1 if broken or not _api_holds(seconds) else 0


def _holds(name: str, seconds: str) -> bool:
    log = FOLDER / f"{name}.log"
    with log.open("wb") as output:
        command = [sys.executable, "-m", "tests.fuzz.formats", name, seconds]
        done = subprocess.run(command, stdout=output, stderr=output, check=False)
    return _told(name, log, holds=done.returncode == 0)


def _api_holds(seconds: str) -> bool:
    log = FOLDER / "api.log"
    shutil.rmtree(FOLDER / "api", ignore_errors=True)
    done = api.requests(FOLDER / "api", "--max-time", seconds)
    log.write_text(done.stdout)
    return _told("the API", log, holds=done.returncode == 0)


def _told(name: str, log: Path, *, holds: bool) -> bool:
    print(f"{name}: {'held' if holds else f'broken, see {log}'}", flush=True)
    return holds


if __name__ == "__main__":
    sys.exit(main())
