"""schemathesis against the running service: requests made from its own description."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from tests.factories.server import PROJECT, running_server

ST = Path(sys.executable).parent / "st"
FOLDER = Path(__file__).parent


def requests(directory: Path, *bounds: str) -> subprocess.CompletedProcess[str]:
    """Start a service in the directory and run all checks of schemathesis on it, so far.

    What the service logs as an error is a failure too: an answer that has begun cannot tell it.
    """
    # what the machine has left is no fault of the requests
    settings: dict[str, object] = {"min_free_memory_bytes": 0, "min_free_disk_bytes": 0}
    # URLs that are made up call nobody: localhost is not on the public network
    settings["url_hosts"] = "localhost"
    with running_server(directory, **settings) as server:
        config = FOLDER / "schemathesis.toml"
        url = f"{server.url}/openapi.json"
        done = subprocess.run(
            [ST, "--config-file", config, "run", url, *bounds],
            cwd=directory,
            env=os.environ | {"PYTHONPATH": str(PROJECT)},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            check=False,
        )
        errors = [line for line in server.log.splitlines() if '"ERROR"' in line]
        done.stdout += "\n".join(errors)
        done.returncode = done.returncode or len(errors)
        return done
