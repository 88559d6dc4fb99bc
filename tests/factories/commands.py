"""The command `mpe` as a process of its own."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from tests.factories.server import PROJECT


def mpe(data_dir: Path, *words: str, **settings: str) -> subprocess.CompletedProcess[str]:
    """The command, to its end."""
    inherited = {name: v for name, v in os.environ.items() if not name.startswith("MPE_")}
    given = {f"MPE_{name.upper()}": value for name, value in settings.items()}
    return subprocess.run(
        [sys.executable, "-m", "service.cli", *words],
        cwd=PROJECT,
        env=inherited | {"MPE_DATA_DIR": str(data_dir)} | given,
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
