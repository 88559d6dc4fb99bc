"""The real server as a process of its own, on a free port, with a data directory of its own."""

from __future__ import annotations

import os
import secrets
import socket
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx

from tests.factories.waiting import until

PROJECT = Path(__file__).parent.parent.parent
PORTS = range(15_000, 32_000)
"""Below those that systems give to outgoing connections, one of which could take the port away."""
CALL_S = 150.0
START_S = 600.0
"""A first start compiles the kernels."""


class Server:
    """One server process; `start`, `stop` and `kill` may be called again and again.

    `command` are the words after `mpe`.
    """

    def __init__(
        self, data_dir: Path, *, command: Sequence[str] = ("serve",), **settings: object
    ) -> None:
        self.data_dir = data_dir
        self._command = command
        self.port = free_port()
        self.url = f"http://127.0.0.1:{self.port}"
        self.client = httpx.Client(base_url=self.url, timeout=CALL_S, trust_env=False)
        self._environment = _environment(data_dir, settings)
        self._process: subprocess.Popen[bytes] | None = None

    @property
    def pid(self) -> int:
        assert self._process is not None
        return self._process.pid

    @property
    def is_running(self) -> bool:
        return self._process is not None and self._process.poll() is None

    @property
    def log(self) -> str:
        return (self.data_dir.parent / "server.log").read_text()

    def start(self, *, ready: bool = True, host: str = "127.0.0.1") -> None:
        with (self.data_dir.parent / "server.log").open("ab") as log:
            place = ["--host", host, "--port", str(self.port)]
            self._process = subprocess.Popen(
                [sys.executable, "-m", "service.cli", *self._command, *place],
                cwd=PROJECT,
                env=self._environment,
                stdout=log,
                stderr=log,
            )
        path = "/readyz" if ready else "/livez"
        try:
            until(lambda: self._answers(path), within_s=START_S, every_s=0.1)
        except AssertionError as error:
            error.add_note(self.log[-20_000:])
            raise

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
        self._process.wait(timeout=120)

    def kill(self) -> None:
        """SIGKILL."""
        assert self._process is not None
        self._process.kill()
        self._process.wait()

    def submit(self, source: bytes, target: bytes, **kwargs: Any) -> httpx.Response:
        """POST two files; `wait` seconds, form fields and headers as named arguments."""
        return submit(self.client, source, target, **kwargs)

    def _answers(self, path: str) -> bool:
        assert self._process is not None
        assert self._process.poll() is None, f"the server ended:\n{self.log}"
        try:
            return self.client.get(path).status_code == 200
        except httpx.TransportError:
            return False


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


def finished(client: httpx.Client, job_id: str) -> dict[str, Any]:
    """The job once it has ended."""

    def ended() -> dict[str, Any] | None:
        job = client.get(f"/v1/registrations/{job_id}", headers={"Prefer": "wait=5"}).json()
        return job if job["status"] in ("succeeded", "failed", "cancelled") else None

    job = until(ended, within_s=200)
    assert job is not None
    return job


def registered(client: httpx.Client, source: bytes, target: bytes, **kwargs: Any) -> dict[str, Any]:
    """The job of two files, as `submit` takes them, once it has succeeded."""
    response = submit(client, source, target, **kwargs)
    assert response.is_success, response.text
    job = finished(client, response.json()["id"])
    assert job["status"] == "succeeded", job
    return job


@contextmanager
def running_server(
    directory: Path, *, ready: bool = True, command: Sequence[str] = ("serve",), **settings: object
) -> Iterator[Server]:
    """A server that is ready, or alive; settings by their names without MPE_, in lower case.

    Other variables of its environment in upper case.
    """
    server = Server(directory / "data", command=command, **settings)
    server.data_dir.mkdir(parents=True, exist_ok=True)
    try:
        server.start(ready=ready)
        yield server
    finally:
        server.client.close()
        if server.is_running:
            server.stop()


def free_port() -> int:
    """A port that nobody listens at; also after the server on it was killed."""
    while True:
        port = secrets.choice(PORTS)
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", port)):
                return port


def _environment(data_dir: Path, settings: dict[str, object]) -> dict[str, str]:
    inherited = {k: v for k, v in os.environ.items() if not k.startswith("MPE_")}
    given = {
        name if name.isupper() else f"MPE_{name.upper()}": str(value)
        for name, value in settings.items()
    }
    return {**inherited, "MPE_DATA_DIR": str(data_dir), "PYTHONUNBUFFERED": "1", **given}
