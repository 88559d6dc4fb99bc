"""A cluster on one machine: PostgreSQL, an S3 store, services for the API and for registrations."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

from sqlalchemy import make_url

from tests.factories.postgres import Postgres, running_postgres
from tests.factories.s3 import S3Server, running_s3
from tests.factories.server import Server
from tests.factories.tcp_proxy import TcpProxy, running_proxy

API = ("serve", "--no-workers")
WORKER = ("worker", "--concurrency", "1")


@dataclass(frozen=True)
class Cluster:
    """The services share database and bucket, and no directory."""

    postgres: Postgres
    database_url: str
    store: S3Server
    apis: list[Server]
    workers: list[Server]
    network: TcpProxy
    """Between the first worker and the database."""

    @property
    def services(self) -> list[Server]:
        return [*self.apis, *self.workers]

    @property
    def log(self) -> str:
        return "".join(service.log for service in self.services)


@contextmanager
def running_cluster(
    directory: Path, programs: Path, *, apis: int, workers: int, **settings: object
) -> Iterator[Cluster]:
    """Every service is ready; `settings` are those of all."""
    (directory / "s3").mkdir()
    with ExitStack() as stack:
        postgres = stack.enter_context(running_postgres(programs))
        store = stack.enter_context(running_s3(directory / "s3"))
        network = stack.enter_context(running_proxy(lambda: _dial(postgres)))
        database_url = postgres.new_database()
        settings = {"database_url": database_url, "workers": 1, **store.new_prefix(), **settings}
        far = str(
            make_url(database_url)
            .set(host="127.0.0.1", port=network.port, query={})
            .render_as_string(hide_password=False)
        )
        cluster = Cluster(
            postgres=postgres,
            database_url=database_url,
            store=store,
            apis=[_service(directory / f"api{i}", API, settings) for i in range(apis)],
            workers=[
                _service(
                    directory / f"worker{i}",
                    WORKER,
                    settings | ({} if i else {"database_url": far}),
                )
                for i in range(workers)
            ],
            network=network,
        )
        stack.callback(_stop, cluster)
        cluster.apis[0].start()  # makes the tables
        with ThreadPoolExecutor() as pool:
            list(pool.map(Server.start, cluster.services[1:]))
        yield cluster


def _service(directory: Path, command: tuple[str, ...], settings: dict[str, object]) -> Server:
    service = Server(directory / "data", command=command, **settings)
    service.data_dir.mkdir(parents=True)
    return service


def _dial(postgres: Postgres) -> socket.socket:
    server = socket.socket(socket.AF_UNIX)
    try:
        server.connect(str(postgres.socket))
    except OSError:  # it is killed at this moment
        server.close()
        raise
    return server


def _stop(cluster: Cluster) -> None:
    running = [service for service in cluster.services if service.is_running]
    for service in running:
        service.terminate()
    for service in running:
        service.wait()
    for service in cluster.services:
        service.client.close()
