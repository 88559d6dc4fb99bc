"""Prove setup, demo and tests on a bare Debian that has git, make, curl and python3.

python3 -m tools.prove_bare_machine [MAKE TARGET ...]   (default: setup setup demo test)

The committed state is cloned into a fresh debootstrap chroot, and each target is run there and
timed. The real clouds are mounted read-only where they are beside the project (or at MPE_DATA).
What it does not cover: another kernel, another processor, a machine without root.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

from tools.chroots import bare_debian, in_chroot, require, run

PROJECT = Path(__file__).parent.parent
PACKAGES = ["git", "make", "curl", "python3"]
TARGETS = ["setup", "setup", "demo", "test"]


def main() -> int:
    """Run the targets in a fresh machine; 1 when one fails."""
    require("debootstrap", "unshare", "git")
    place = PROJECT / "build" / "bare"
    place.mkdir(parents=True, exist_ok=True)
    root = place / "machine"
    bare_debian(place / "debian", root, PACKAGES)
    run(["git", "clone", "--quiet", str(PROJECT), str(root / "home/mpe")])
    data = Path(os.environ.get("MPE_DATA", PROJECT.parent / "shared" / "data"))
    binds = {"home/shared/data": data} if data.is_dir() else {}
    for target in sys.argv[1:] or TARGETS:
        started = time.monotonic()
        try:
            in_chroot(root, ["make", target], folder="/home/mpe", binds=binds)
        except subprocess.CalledProcessError as error:
            print(f"== make {target} failed with exit code {error.returncode}", flush=True)
            return 1
        print(f"== make {target}: {time.monotonic() - started:.1f} s", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
