"""`make fuzz`: every reader fuzzed for a while; exits with 1 when one was broken."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from service.formats import FORMATS


def main() -> int:
    seconds = sys.argv[1]
    broken = []
    for format in FORMATS:
        log = Path("build/fuzz") / f"{format.name}.log"
        log.parent.mkdir(parents=True, exist_ok=True)
        with log.open("wb") as output:
            command = [sys.executable, "-m", "tests.fuzz.formats", format.name, seconds]
            done = subprocess.run(command, stdout=output, stderr=output, check=False)
        print(f"{format.name}: {'broken, see ' + str(log) if done.returncode else 'held'}")
        if done.returncode:
            broken.append(format.name)
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
