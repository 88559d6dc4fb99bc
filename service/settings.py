"""Every setting of the service; each is read from the environment variable MPE_<NAME>."""

from __future__ import annotations

import os
from importlib.util import find_spec
from ipaddress import IPv4Network, IPv6Network
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BeforeValidator, Field, SecretStr, field_validator, model_validator
from pydantic_settings import BaseSettings, NoDecode, SettingsConfigDict

MEBIBYTE = 2**20
DAY_S = 86_400.0


def available_cores() -> int:
    """Cores that this process may run on."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _default_workers() -> int:
    return min(4, available_cores())


def _default_job_memory() -> int:
    physical = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    return max(1024 * MEBIBYTE, int(0.8 * physical) // _default_workers())


def _parts(value: object) -> object:
    if isinstance(value, str):
        return tuple(part.strip() for part in value.split(",") if part.strip())
    return value


CommaSeparated = (NoDecode, BeforeValidator(_parts))
Ports = Annotated[tuple[Annotated[int, Field(ge=1, le=65535)], ...], *CommaSeparated]
Networks = Annotated[tuple[IPv4Network | IPv6Network, ...], *CommaSeparated]
Names = Annotated[tuple[str, ...], *CommaSeparated]


class Settings(BaseSettings):
    """Settings of one service process, checked at the start."""

    model_config = SettingsConfigDict(env_prefix="MPE_", frozen=True, hide_input_in_errors=True)

    data_dir: Path = Field(
        default_factory=lambda: Path.home() / ".local" / "share" / "mpe",
        description="Directory that holds the job store and the clouds. One service per directory, "
        "unless MPE_DATABASE_URL is set.",
    )
    database_url: SecretStr | None = Field(
        default=None,
        description="PostgreSQL for the job store, postgresql://user:password@host/database; "
        "unset: SQLite in the data directory.",
    )
    workers: int = Field(
        default_factory=_default_workers,
        ge=1,
        description="Registrations that run at once. Default: the cores, at most 4.",
    )
    threads_per_worker: int = Field(
        default=0,
        ge=0,
        description="Threads of one registration; 0: the cores divided by the workers.",
    )
    max_body_bytes: int = Field(
        default=512 * MEBIBYTE,
        ge=1,
        description="Largest request body in bytes; more is answered 413.",
    )
    max_wait_s: float = Field(
        default=60, ge=0, description="Longest wait in seconds that `Prefer: wait` is granted."
    )
    queue_limit: int = Field(
        default=1000, ge=1, description="Most registrations that may wait; more are answered 429."
    )
    job_timeout_s: float = Field(
        default=600, gt=0, description="Wall-clock seconds after which a running attempt is killed."
    )
    job_memory_bytes: int = Field(
        default_factory=_default_job_memory,
        ge=256 * MEBIBYTE,
        description="Address space of one worker in bytes. Default: 80 % of the memory, shared.",
    )
    shutdown_grace_s: float = Field(
        default=30, ge=0, description="Seconds that running jobs may go on for after SIGTERM."
    )
    result_retention_s: float = Field(
        default=7 * DAY_S, gt=0, description="Seconds that a result and its clouds are kept."
    )
    job_retention_s: float = Field(
        default=30 * DAY_S, gt=0, description="Seconds that a registration that ended is kept."
    )
    cloud_retention_s: float = Field(
        default=7 * DAY_S, gt=0, description="Seconds that a stored cloud is kept unless used."
    )
    upload_retention_s: float = Field(
        default=DAY_S, gt=0, description="Seconds that an upload in pieces may lie still."
    )
    blob_grace_s: float = Field(
        default=600,
        gt=0,
        description="Seconds that files are kept after they were written or last needed.",
    )
    upkeep_interval_s: float = Field(
        default=30, gt=0, description="Seconds between looks for what has expired."
    )
    min_free_disk_bytes: int = Field(
        default=512 * MEBIBYTE,
        ge=0,
        description="With less disk left, submissions are answered 503.",
    )
    min_free_memory_bytes: int = Field(
        default=256 * MEBIBYTE, ge=0, description="With less memory left, they are answered 503."
    )
    url_fetching: bool = Field(default=True, description="Whether clouds are fetched from URLs.")
    url_hosts: Annotated[tuple[str, ...], NoDecode] = Field(
        default=(),
        description="Hosts, comma-separated, that clouds may be fetched from; empty: all public.",
    )
    url_ports: Ports = Field(
        default=(),
        description="Ports, comma-separated, of those hosts; empty: 80, 443 and all from 1024.",
    )
    private_networks: Networks = Field(
        default=(),
        description="Networks, comma-separated (10.1.0.0/16), that URLs and callbacks may reach "
        "though they are not public.",
    )
    url_timeout_s: float = Field(
        default=300, gt=0, description="Seconds within which a cloud must have been fetched."
    )
    url_stall_s: float = Field(
        default=20,
        gt=0,
        description="Longest wait for its next bytes, in seconds; the time to measure its speed.",
    )
    url_min_bytes_s: float = Field(
        default=1000, ge=0, description="Least speed of a cloud that is fetched, in bytes a second."
    )
    s3_buckets: Names = Field(
        default=(),
        description="Buckets, comma-separated, that s3:// addresses may name; empty: none. Needs "
        "the extra `s3`.",
    )
    s3_endpoint: str | None = Field(
        default=None,
        pattern="^https?://",
        description="Address of the server that holds them; unset: Amazon's.",
    )
    s3_region: str = Field(default="us-east-1", description="Region of the buckets.")
    s3_access_key_id: str | None = Field(
        default=None, description="Key to read them with; unset: as the AWS_ variables say."
    )
    s3_secret_access_key: SecretStr | None = Field(default=None, description="Secret of that key.")
    require_keys: bool = Field(
        default=False, description="Whether callers need a key even before the first was made."
    )
    allow_open: bool = Field(
        default=False,
        description="Whether to serve at an address that others can reach while there is no key.",
    )
    allowed_hosts: Annotated[
        tuple[Annotated[str, Field(pattern=r"^[a-z0-9._-]+$")], ...], NoDecode
    ] = Field(
        default=(),
        description="Names, comma-separated, without ports, that callers without a key may call "
        "the service by, beside localhost and loopback addresses; empty: none, or with "
        "MPE_ALLOW_OPEN any.",
    )
    key_requests_per_s: float = Field(
        default=50,
        ge=0,
        description="Requests a second with one key, if it has no number of its own; 0: any. "
        "More are answered 429.",
    )
    key_queue_limit: int = Field(
        default=200,
        ge=0,
        description="Registrations of one tenant that may wait, likewise.",
    )
    key_stored_bytes: int = Field(
        default=20 * 1024 * MEBIBYTE,
        ge=0,
        description="Bytes that may be kept for one tenant, likewise.",
    )
    cors_origins: Annotated[tuple[str, ...], NoDecode] = Field(
        default=(),
        description="Origins, comma-separated, whose pages may call (https://lab.example.org); "
        "`*`: all; empty: none.",
    )
    log_level: Literal["DEBUG", "INFO", "WARNING", "ERROR"] = Field(
        default="INFO", description="Least level of what is logged."
    )
    otlp_endpoint: str | None = Field(
        default=None,
        description="Where spans go, OTLP over HTTP (http://host:4318/v1/traces); unset: nowhere.",
    )
    webhook_hosts: Annotated[tuple[str, ...], NoDecode] = Field(
        default=(),
        description="Hosts, comma-separated, that `callback_url` may name; empty: no callbacks.",
    )
    webhook_secret: SecretStr | None = Field(
        default=None, description="Secret that callbacks are signed with; needed for them."
    )
    webhook_retry_s: float = Field(
        default=5, gt=0, description="Seconds before a callback is tried again; then doubled."
    )
    webhook_tries: int = Field(default=12, ge=1, description="Most tries of one callback.")

    @field_validator("url_hosts", "webhook_hosts", "cors_origins", "allowed_hosts", mode="before")
    @classmethod
    def _split(cls, value: object) -> object:
        if isinstance(value, str):
            return tuple(host.strip().lower() for host in value.split(",") if host.strip())
        return value

    @field_validator("database_url")
    @classmethod
    def _is_postgresql(cls, value: SecretStr | None) -> SecretStr | None:
        # the message must not repeat the value: there is a password in it
        if value is not None and not value.get_secret_value().startswith("postgresql://"):
            raise ValueError("expected postgresql://user:password@host/database")
        if value is not None and find_spec("psycopg") is None:
            raise ValueError("install the driver: pip install 'mpe[postgres]'")
        return value

    @model_validator(mode="after")
    def _fit_the_cores(self) -> Settings:
        cores = available_cores()
        if self.workers * max(1, self.threads_per_worker) > max(cores, self.workers):
            raise ValueError(
                f"MPE_WORKERS={self.workers} times MPE_THREADS_PER_WORKER="
                f"{self.threads_per_worker} exceeds the {cores} cores; lower one of them"
            )
        return self

    @model_validator(mode="after")
    def _sign_callbacks(self) -> Settings:
        if self.webhook_hosts and self.webhook_secret is None:
            raise ValueError("MPE_WEBHOOK_HOSTS allows callbacks: set MPE_WEBHOOK_SECRET too")
        return self

    @model_validator(mode="after")
    def _can_sign(self) -> Settings:
        if self.s3_buckets and find_spec("obstore") is None:
            raise ValueError("MPE_S3_BUCKETS names buckets: install the extra s3 (obstore)")
        if (self.s3_access_key_id is None) != (self.s3_secret_access_key is None):
            raise ValueError("MPE_S3_ACCESS_KEY_ID and MPE_S3_SECRET_ACCESS_KEY: set both or none")
        return self

    @property
    def store_url(self) -> str:
        """Where the job store is, as SQLAlchemy writes it."""
        if self.database_url is None:
            return f"sqlite:///{self.data_dir / 'jobs.sqlite3'}"
        return self.database_url.get_secret_value()

    @property
    def threads(self) -> int:
        """Threads of one registration."""
        return self.threads_per_worker or max(1, available_cores() // self.workers)
