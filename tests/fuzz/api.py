"""schemathesis against the running service: requests made from its own description."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from tests.server import PROJECT, running_server

ST = Path(sys.executable).parent / "st"
FOLDER = Path(__file__).parent


def requests(directory: Path, *bounds: str) -> subprocess.CompletedProcess[str]:
    """Start a service in the directory and run all checks of schemathesis on it, so far."""
    # what the machine has left is no fault of the requests
    plenty = {"min_free_memory_bytes": 0, "min_free_disk_bytes": 0}
    with running_server(directory, **plenty) as server:
        config = FOLDER / "schemathesis.toml"
        url = f"{server.url}/openapi.json"
        return subprocess.run(
            [ST, "--config-file", config, "run", url, *bounds],
            cwd=directory,
            env=os.environ | {"PYTHONPATH": str(PROJECT)},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            check=False,
        )
