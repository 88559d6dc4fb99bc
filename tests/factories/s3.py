"""A real S3 server for the tests (rclone), which checks signatures."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from uuid import uuid4

import httpx
import psutil

from service.settings import BlobSettings
from tests.factories.server import free_port
from tests.factories.waiting import until

KEY, SECRET = "scanner", "tide-and-time"
BUCKET = "mpe-clouds"


class S3Server:
    """A server of the folders below `root`, one a bucket; may be started again and again.

    A bucket must be there before it starts: rclone reads the list of folders once.
    """

    def __init__(self, root: Path) -> None:
        self.root = root
        self.bucket = root / BUCKET
        self.bucket.mkdir()
        self._address = f"127.0.0.1:{free_port()}"
        self.endpoint = f"http://{self._address}"
        self._process: subprocess.Popen[bytes] | None = None

    def new_prefix(self) -> dict[str, str]:
        """Settings of a service whose blobs are below an empty prefix, as `Server` takes them."""
        return {
            "blob_url": f"s3://{BUCKET}/{uuid4().hex}",
            "blob_endpoint": self.endpoint,
            "blob_access_key_id": KEY,
            "blob_secret_access_key": SECRET,
        }

    def start(self) -> None:
        rclone = Path(sys.executable).with_name("rclone")
        command = [rclone, "serve", "s3", self.root, "--addr", self._address]
        quiet = ["--config", "/dev/null", "--log-level", "CRITICAL"]
        self._process = subprocess.Popen([*command, "--auth-key", f"{KEY},{SECRET}", *quiet])
        until(self._answers)

    def kill(self) -> None:
        assert self._process is not None
        self._process.kill()
        self._process.wait()

    @property
    def cpu_s(self) -> float:
        """Processor time since it was started, in seconds."""
        assert self._process is not None
        times = psutil.Process(self._process.pid).cpu_times()
        return float(times.user + times.system)

    def _answers(self) -> bool:
        assert self._process is not None
        assert self._process.poll() is None, "rclone has ended"
        try:
            return httpx.get(f"{self.endpoint}/", trust_env=False).status_code > 0
        except httpx.TransportError:
            return False


def blob_settings(s3: S3Server) -> BlobSettings:
    """The same settings as the service reads them."""
    given = s3.new_prefix()
    return BlobSettings(**{key.removeprefix("blob_"): value for key, value in given.items()})


@contextmanager
def running_s3(root: Path) -> Iterator[S3Server]:
    server = S3Server(root)
    server.start()
    try:
        yield server
    finally:
        server.kill()
