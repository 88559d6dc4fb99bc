"""A real PostgreSQL server for the tests: as a process of its own, in a directory of its own."""

from __future__ import annotations

import contextlib
import os
import pwd
import shutil
import signal
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from uuid import uuid4

import psutil
import psycopg

from tests.factories.waiting import until

DEBIAN = Path("/usr/lib/postgresql")
SETTINGS = {
    "listen_addresses": "",
    "shared_buffers": "16MB",
    # of five services and a crowd of tests
    "max_connections": "200",
    # nothing is lost unless the machine itself fails
    "fsync": "off",
}


def find_programs() -> Path | None:
    """The folder with initdb and postgres: of the newest Debian package, or of the PATH."""
    found = sorted(DEBIAN.glob("*/bin/initdb"), key=lambda path: float(path.parts[-3]))
    on_path = shutil.which("initdb")
    if found:
        return found[-1].parent
    return None if on_path is None else Path(on_path).resolve().parent


class Postgres:
    """A server that is reached by its socket; `start` and `stop` may be called again and again."""

    def __init__(self, programs: Path, directory: Path, **settings: str) -> None:
        self._settings = SETTINGS | settings
        self.programs = programs
        self._directory = directory
        self._owner = _owner()
        self._server: subprocess.Popen[bytes] | None = None
        os.chown(directory, self._owner.pw_uid, self._owner.pw_gid)
        made = self._run(
            "initdb", "--auth=trust", "--no-sync", "--no-locale", "--encoding=UTF8"
        ).wait()
        assert made == 0, self.log

    def url(self, database: str) -> str:
        return f"postgresql://{self._owner.pw_name}@/{database}?host={self._directory}"

    def new_database(self) -> str:
        """URL of a database with nothing in it."""
        name = f"mpe_{uuid4().hex}"
        with psycopg.connect(self.url("postgres"), autocommit=True) as connection:
            connection.execute(f"CREATE DATABASE {name}".encode())
        return self.url(name)

    @property
    def log(self) -> str:
        return (self._directory / "log").read_text()

    def start(self) -> None:
        settings = [f"-c{name}={value}" for name, value in self._settings.items()]
        self._server = self._run("postgres", f"-k{self._directory}", *settings)
        until(self._answers)

    def stop(self) -> None:
        """At once, whoever is connected."""
        self._end(signal.SIGINT)

    def kill(self) -> None:
        """As by a crash: the next start replays the log."""
        self._end(signal.SIGQUIT)

    @property
    def socket(self) -> Path:
        """Where it listens."""
        return self._directory / ".s.PGSQL.5432"

    @property
    def cpu_s(self) -> float:
        """Processor time of the server and all its connections, in seconds.

        The time of a connection that has ended counts as its parent's children's.
        """
        assert self._server is not None
        server = psutil.Process(self._server.pid)
        ended = server.cpu_times()
        total = ended.user + ended.system + ended.children_user + ended.children_system
        for connection in server.children(recursive=True):
            with contextlib.suppress(psutil.NoSuchProcess):
                times = connection.cpu_times()
                total += times.user + times.system
        return float(total)

    def _end(self, number: signal.Signals) -> None:
        assert self._server is not None
        self._server.send_signal(number)
        self._server.wait()

    def _answers(self) -> bool:
        assert self._server is not None
        assert self._server.poll() is None, self.log
        try:
            psycopg.connect(self.url("postgres")).close()
        except psycopg.OperationalError:
            return False
        return True

    def _run(self, program: str, *arguments: str) -> subprocess.Popen[bytes]:
        """As the owner of the directory: PostgreSQL refuses root. Ends with this process."""
        owner = self._owner
        command = ["setpriv", "--pdeathsig=QUIT"]
        if os.getuid() == 0:
            command += [f"--reuid={owner.pw_uid}", f"--regid={owner.pw_gid}", "--clear-groups"]
        command += [str(self.programs / program), "-D", str(self._directory / "data"), *arguments]
        with (self._directory / "log").open("ab") as log:
            return subprocess.Popen(
                command,
                cwd=self._directory,
                env={"PATH": os.environ["PATH"]},
                stdout=log,
                stderr=log,
            )


@contextmanager
def running_postgres(programs: Path, **settings: str) -> Iterator[Postgres]:
    """A server in a new directory; both are gone afterwards. `settings` go before SETTINGS."""
    with tempfile.TemporaryDirectory(prefix="mpe-postgres-") as directory:
        postgres = Postgres(programs, Path(directory), **settings)
        postgres.start()
        try:
            yield postgres
        finally:
            postgres.stop()


def _owner() -> pwd.struct_passwd:
    """Who runs it: this user, or for root the one that Debian's package made."""
    if os.getuid() != 0:
        return pwd.getpwuid(os.getuid())
    try:
        return pwd.getpwnam("postgres")
    except KeyError:
        return pwd.getpwnam("nobody")
