"""The real server as a process of its own, on a free port, with a data directory of its own."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx

PROJECT = Path(__file__).parent.parent
START_S = 60.0


class Server:
    """One server process; `start`, `stop` and `kill` may be called again and again."""

    def __init__(self, data_dir: Path, **settings: object) -> None:
        self.data_dir = data_dir
        self.port = free_port()
        self.url = f"http://127.0.0.1:{self.port}"
        self.client = httpx.Client(base_url=self.url, timeout=60, trust_env=False)
        self._environment = _environment(data_dir, settings)
        self._process: subprocess.Popen[bytes] | None = None

    @property
    def pid(self) -> int:
        assert self._process is not None
        return self._process.pid

    @property
    def log(self) -> str:
        return (self.data_dir.parent / "server.log").read_text()

    def start(self, *, ready: bool = True) -> None:
        with (self.data_dir.parent / "server.log").open("ab") as log:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "service.cli", "serve", "--port", str(self.port)],
                cwd=PROJECT,
                env=self._environment,
                stdout=log,
                stderr=log,
            )
        self._await("/readyz" if ready else "/livez")

    def stop(self) -> None:
        """SIGTERM, and wait for the end."""
        self.terminate()
        self.wait()

    def terminate(self) -> None:
        """SIGTERM."""
        assert self._process is not None
        self._process.terminate()

    def wait(self) -> None:
        assert self._process is not None
        self._process.wait(timeout=60)

    def kill(self) -> None:
        """SIGKILL."""
        assert self._process is not None
        self._process.kill()
        self._process.wait()

    def submit(self, source: bytes, target: bytes, **kwargs: Any) -> httpx.Response:
        """POST two files; `wait` seconds, form fields and headers as named arguments."""
        return submit(self.client, source, target, **kwargs)

    def _await(self, path: str) -> None:
        deadline = time.monotonic() + START_S
        while time.monotonic() < deadline:
            assert self._process is not None
            assert self._process.poll() is None, f"the server ended:\n{self.log}"
            try:
                if self.client.get(path).status_code == 200:
                    return
            except httpx.TransportError:
                pass
            time.sleep(0.05)
        raise AssertionError(f"the server did not become ready:\n{self.log}")


def submit(
    client: httpx.Client,
    source: bytes,
    target: bytes,
    *,
    wait: float | None = None,
    headers: dict[str, str] | None = None,
    **fields: str,
) -> httpx.Response:
    files = {"source": ("source", source), "target": ("target", target)}
    prefer = {} if wait is None else {"Prefer": f"wait={wait}"}
    return client.post(
        "/v1/registrations", files=files, data=fields, headers=prefer | (headers or {})
    )


def finished(client: httpx.Client, job_id: str, *, within_s: float = 60) -> dict[str, Any]:
    """The job once it has ended."""
    deadline = time.monotonic() + within_s
    while time.monotonic() < deadline:
        job = client.get(f"/v1/registrations/{job_id}", headers={"Prefer": "wait=5"}).json()
        if job["status"] in ("succeeded", "failed", "cancelled"):
            return dict(job)
    raise AssertionError(f"{job_id} has not ended: {job['status']}, {job['progress']}")


@contextmanager
def running_server(directory: Path, **settings: object) -> Iterator[Server]:
    """A server that is ready; settings by their names without MPE_, in lower case."""
    server = Server(directory / "data", **settings)
    server.data_dir.mkdir(parents=True)
    server.start()
    try:
        yield server
    finally:
        server.client.close()
        if server._process is not None and server._process.poll() is None:
            server.stop()


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def _environment(data_dir: Path, settings: dict[str, object]) -> dict[str, str]:
    inherited = {k: v for k, v in os.environ.items() if not k.startswith("MPE_")}
    given = {f"MPE_{name.upper()}": str(value) for name, value in settings.items()}
    return {**inherited, "MPE_DATA_DIR": str(data_dir), "PYTHONUNBUFFERED": "1", **given}
