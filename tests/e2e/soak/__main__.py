"""Many clients of four tenants, a tenth of them hostile; `python -m tests.e2e.soak`.

Meanwhile the server and its processes are killed and suspended, and its disk fills and empties. No
accepted job may be lost, no tenant may see what is another's, no request may be an error of the
service, memory and descriptors may not grow; all that is printed, with the times of /livez. Ends
with 1 where there is a fault.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

from tests.e2e.soak.run import run


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=3600)
    parser.add_argument("--clients", type=int, default=64)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as directory:
        figures = run(Path(directory), **vars(given))
    for name, value in figures.items():
        print(f"{name:46} {value}")
    return 1 if figures["faults"] else 0


if __name__ == "__main__":
    sys.exit(main())
