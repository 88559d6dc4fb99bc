"""Settings of the service, each read from the environment variable MPE_<NAME>.

A group holds the variables that begin with its name: `settings.s3.region` is MPE_S3_REGION.
"""

from __future__ import annotations

import base64
import binascii
import logging
import os
from collections.abc import Iterator, Mapping
from importlib.util import find_spec
from ipaddress import IPv4Network, IPv6Network
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    NonNegativeFloat,
    NonNegativeInt,
    PositiveFloat,
    PositiveInt,
    SecretStr,
    StringConstraints,
    ValidationError,
    field_validator,
    model_validator,
)
from pydantic.fields import FieldInfo
from pydantic_settings import (
    BaseSettings,
    EnvSettingsSource,
    NoDecode,
    PydanticBaseSettingsSource,
    SettingsConfigDict,
)

from mpe_core.machine import available_cores, memory_limit

PREFIX = "MPE_"
MEBIBYTE = 2**20
DAY_S = 86_400.0
BASE64_KEY_PREFIX = "whsec_"
RENAMED_VARIABLES = {
    "MPE_UPKEEP_INTERVAL_S": "MPE_MAINTENANCE_INTERVAL_S",
    "MPE_ALLOW_OPEN": "MPE_ALLOW_ANONYMOUS_REMOTE",
    "MPE_URL_STALL_S": "MPE_URL_READ_TIMEOUT_S",
    "MPE_URL_MIN_BYTES_S": "MPE_URL_MIN_BYTES_PER_S",
    "MPE_WEBHOOK_TRIES": "MPE_WEBHOOK_MAX_ATTEMPTS",
    "MPE_WEBHOOK_RETRY_S": "MPE_WEBHOOK_BACKOFF_S",
}
"""Old names and their successors; the old ones are accepted with a warning for one release."""

log = logging.getLogger(__name__)
T = TypeVar("T")


class InvalidSettingsError(ValueError):
    """A variable has a value that is not allowed; the message names the variable."""


def _default_workers() -> int:
    return min(4, available_cores())


def _default_job_memory() -> int:
    return max(1024 * MEBIBYTE, int(0.8 * memory_limit()) // _default_workers())


def _default_connections() -> int:
    import resource  # Unix only, as the service is; `mpe align` reads no settings

    descriptors = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
    if descriptors == resource.RLIM_INFINITY:
        return 1000
    return min(1000, max(16, (descriptors - 128) // 2))


def _split_commas(value: object) -> object:
    if isinstance(value, str):
        return tuple(part.strip() for part in value.split(",") if part.strip())
    return value


CommaSeparated = Annotated[tuple[T, ...], NoDecode, BeforeValidator(_split_commas)]
WorkerLabel = Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9-]{0,31}$")]
LowerCase = Annotated[str, StringConstraints(to_lower=True)]
Hostname = Annotated[LowerCase, Field(pattern=r"^[A-Za-z0-9._-]+$")]
Port = Annotated[int, Field(ge=1, le=65535)]


class SettingsGroup(BaseModel):
    """Variables with one prefix."""

    model_config = ConfigDict(frozen=True, hide_input_in_errors=True, use_attribute_docstrings=True)


class UrlSettings(SettingsGroup):
    """Fetching clouds from URLs (MPE_URL_...)."""

    fetching: bool = True
    """Whether clouds are fetched from URLs."""
    hosts: CommaSeparated[LowerCase] = ()
    """Hosts that clouds may be fetched from, comma-separated; empty: every host on the public
    network.
    """
    ports: CommaSeparated[Port] = ()
    """Ports that URLs and callbacks may name, comma-separated; empty: 80, 443 and all from 1024."""
    concurrency: PositiveInt = 8
    """Registrations whose clouds are fetched at the same time, beside those that workers run. A
    tenant gets no more than what is left free.
    """
    timeout_s: PositiveFloat = 300
    """Time limit of fetching one cloud, in seconds."""
    read_timeout_s: PositiveFloat = 20
    """Time limit of connecting and of each wait for bytes, in seconds; also the interval over which
    the speed is measured.
    """
    min_bytes_per_s: NonNegativeFloat = 1000
    """Minimum speed of a fetch, in bytes per second; a slower one is given up."""


class S3Settings(SettingsGroup):
    """Reading clouds from s3:// addresses (MPE_S3_...)."""

    buckets: CommaSeparated[str] = ()
    """Buckets that s3:// addresses may name, comma-separated; empty: none. Needs the extra `s3`."""
    endpoint: str | None = Field(default=None, pattern="^https?://")
    """URL of the S3 server; unset: Amazon's."""
    region: str = "us-east-1"
    """Region of the buckets."""
    access_key_id: str | None = None
    """Id of the key that reads the buckets; unset: the AWS_ variables."""
    secret_access_key: SecretStr | None = None
    """Secret of that key."""

    @model_validator(mode="after")
    def _check_s3(self) -> S3Settings:
        if self.buckets and find_spec("obstore") is None:
            raise ValueError("MPE_S3_BUCKETS names buckets: install the extra s3 (obstore)")
        if (self.access_key_id is None) != (self.secret_access_key is None):
            raise ValueError("MPE_S3_ACCESS_KEY_ID and MPE_S3_SECRET_ACCESS_KEY: set both or none")
        return self


class BlobSettings(SettingsGroup):
    """Where the files of clouds and results are kept (MPE_BLOB_...)."""

    url: str | None = Field(
        default=None, pattern=r"^s3://[a-z0-9][a-z0-9.-]{1,61}[a-z0-9](/[A-Za-z0-9!_.*'()/-]+)?$"
    )
    """Bucket of an S3 store and a prefix in it, s3://bucket/prefix; unset: the data directory. It
    needs the extra `s3`.
    """
    endpoint: str | None = Field(default=None, pattern="^https?://")
    """URL of the store's server; unset: Amazon's."""
    public_endpoint: str | None = Field(default=None, pattern="^https?://")
    """URL at which callers reach the store's server: large clouds go there and come from there
    directly, by signed URLs. Unset: all bytes pass through the service.
    """
    region: str = "us-east-1"
    """Region of the bucket."""
    access_key_id: str | None = None
    """Id of the key that reads and writes the bucket; unset: the AWS_ variables."""
    secret_access_key: SecretStr | None = None
    """Secret of that key."""
    cache_bytes: PositiveInt = 20 * 1024 * MEBIBYTE
    """Bytes of a bucket's files, and of decoded clouds, that the data directory keeps; those unused
    for longest are removed. Files in use may exceed it.
    """
    grace_s: PositiveFloat = 600
    """Time that an unreferenced file is kept after it was written or last needed, in seconds."""

    @model_validator(mode="after")
    def _check_store(self) -> BlobSettings:
        if self.url is not None and find_spec("obstore") is None:
            raise ValueError("MPE_BLOB_URL names a bucket: install the extra s3 (obstore)")
        if (self.access_key_id is None) != (self.secret_access_key is None):
            raise ValueError(
                "MPE_BLOB_ACCESS_KEY_ID and MPE_BLOB_SECRET_ACCESS_KEY: set both or none"
            )
        return self


class KeySettings(SettingsGroup):
    """Limits of API keys that have none of their own (MPE_KEY_...)."""

    requests_per_s: NonNegativeFloat = 50
    """Requests per second with one key, unless the key has its own limit; 0: unlimited. More are
    answered 429.
    """
    queue_limit: NonNegativeInt = 200
    """Registrations of one tenant that may wait, unless the key has its own limit; 0: unlimited.
    More are answered 429.
    """
    stored_bytes: NonNegativeInt = 20 * 1024 * MEBIBYTE
    """Bytes that one tenant may have stored, unless the key has its own limit; 0: unlimited. More
    are answered 429.
    """


class WebhookSettings(SettingsGroup):
    """Callbacks at the end of registrations (MPE_WEBHOOK_...)."""

    hosts: CommaSeparated[LowerCase] = ()
    """Hosts that `callback_url` may name, comma-separated; empty: no callbacks."""
    secret: SecretStr | None = None
    """Secret that callbacks are signed with, required for them: `whsec_` and the key in base64
    (standardwebhooks.com), or any other text, whose UTF-8 bytes are the key.
    """
    backoff_s: PositiveFloat = 5
    """Seconds until the second attempt of a callback; doubled after each further one, up to an
    hour.
    """
    max_attempts: PositiveInt = 12
    """Maximum attempts of one callback."""

    @model_validator(mode="after")
    def _check_secret(self) -> WebhookSettings:
        if self.hosts and self.secret is None:
            raise ValueError("MPE_WEBHOOK_HOSTS allows callbacks: set MPE_WEBHOOK_SECRET too")
        if self.secret is not None:
            _decode_secret(self.secret.get_secret_value())
        return self

    @property
    def signing_key(self) -> bytes:
        """Key of the signatures; empty without a secret."""
        return b"" if self.secret is None else _decode_secret(self.secret.get_secret_value())


def _decode_secret(text: str) -> bytes:
    if not text.startswith(BASE64_KEY_PREFIX):
        return text.encode()
    try:
        return base64.b64decode(text.removeprefix(BASE64_KEY_PREFIX), validate=True)
    except binascii.Error:
        raise ValueError(
            "MPE_WEBHOOK_SECRET begins with whsec_, but base64 does not follow; make one with "
            "`echo whsec_$(openssl rand -base64 32)`"
        ) from None


class Settings(BaseSettings):
    """Settings of one service process, checked at the start."""

    model_config = SettingsConfigDict(
        env_prefix=PREFIX,
        env_nested_delimiter="_",
        env_nested_max_split=1,
        frozen=True,
        hide_input_in_errors=True,
        use_attribute_docstrings=True,
    )

    data_dir: Path = Field(default_factory=lambda: Path.home() / ".local" / "share" / "mpe")
    """Directory of the job store and the clouds. One service per directory, unless MPE_DATABASE_URL
    is set and MPE_BLOB_URL is not.
    """
    database_url: SecretStr | None = None
    """PostgreSQL database of the job store, postgresql://user:password@host/name; unset: SQLite in
    the data directory.
    """
    workers: PositiveInt = Field(default_factory=_default_workers)
    """Registrations that run at the same time. Default: the number of cores, at most 4."""
    threads_per_worker: NonNegativeInt = 0
    """Threads of one registration; 0: the number of cores divided by the workers."""
    worker_labels: CommaSeparated[WorkerLabel] = ()
    """Labels of the workers of this service, comma-separated; `large`: they have the memory for
    clouds above MPE_LARGE_BYTES. `/v1/capacity` counts the workers of each label.
    """
    large_bytes: PositiveInt | None = None
    """Bytes of both files of a registration above which only workers with the label `large` run it;
    unset: all workers run all. The same for all services on a database.
    """
    max_body_bytes: PositiveInt = 512 * MEBIBYTE
    """Maximum size of a request body and of a fetched cloud, in bytes; larger bodies are answered
    413.
    """
    max_wait_s: NonNegativeFloat = 60
    """Maximum wait that `Prefer: wait` can ask for, in seconds."""
    head_timeout_s: PositiveFloat = 10
    """Time limit of a request's line and headers, in seconds; the connection is closed then."""
    body_stall_timeout_s: PositiveFloat = 20
    """Time without progress after which a request's body, or a response that the caller does not
    read, is given up and the connection closed, in seconds.
    """
    idle_timeout_s: PositiveInt = 5
    """Time that a connection is kept open between two requests, in seconds."""
    max_connections: PositiveInt = Field(default_factory=_default_connections)
    """Maximum number of open connections; more are answered 503. Default: half of the file
    descriptors that the process may open, less 128, at most 1000.
    """
    max_connections_per_address: NonNegativeInt = 0
    """Maximum number of open connections from one address, or from one /64 network of IPv6; 0: half
    of MPE_MAX_CONNECTIONS. Behind a proxy all connections come from its address.
    """
    queue_limit: PositiveInt = 1000
    """Maximum number of registrations that wait; more are answered 429."""
    lease_s: PositiveFloat = 10
    """Time after which the registrations of a service that no longer answers are run again by
    others, in seconds; a service that lives says so five times as often.
    """
    job_timeout_s: PositiveFloat = 600
    """Time limit of one attempt at a registration, in seconds; it is killed then."""
    job_memory_bytes: int = Field(default_factory=_default_job_memory, ge=256 * MEBIBYTE)
    """Maximum address space of one worker, in bytes. Default: 80 % of the memory, or of the
    container's limit, divided by the workers.
    """
    require_sandbox: bool = False
    """Whether to refuse to start where the kernel lacks a part of the sandbox, Landlock or
    seccomp.
    """
    shutdown_delay_s: NonNegativeFloat = 0
    """Time after SIGTERM in which calls are taken as before while /readyz is 503, so that a proxy
    sends them elsewhere before they are refused, in seconds.
    """
    shutdown_grace_s: NonNegativeFloat = 30
    """Time that running registrations have to end after SIGTERM, in seconds."""
    result_retention_s: PositiveFloat = 7 * DAY_S
    """Time that a result and its clouds are kept after the end, in seconds."""
    job_retention_s: PositiveFloat = 30 * DAY_S
    """Time that a registration is kept after its end, in seconds."""
    cloud_retention_s: PositiveFloat = 7 * DAY_S
    """Time that a stored cloud is kept after its last use, in seconds."""
    upload_retention_s: PositiveFloat = DAY_S
    """Time that an unfinished upload is kept after its last byte, in seconds."""
    blob: BlobSettings = BlobSettings()
    maintenance_interval_s: PositiveFloat = 30
    """Interval of the clean-up task, in seconds."""
    min_free_disk_bytes: NonNegativeInt = 512 * MEBIBYTE
    """Free disk space below which submissions are answered 503, in bytes."""
    min_free_memory_bytes: NonNegativeInt = 256 * MEBIBYTE
    """Free memory, of the machine or of the container, below which submissions are answered 503, in
    bytes."""
    url: UrlSettings = UrlSettings()
    private_networks: CommaSeparated[IPv4Network | IPv6Network] = ()
    """Networks that URLs and callbacks may reach although they are not public, comma-separated
    (10.1.0.0/16).
    """
    s3: S3Settings = S3Settings()
    require_keys: bool = False
    """Whether callers need a key even before the first is created."""
    allow_anonymous_remote: bool = False
    """Whether to listen at an address that other machines can reach while no key exists."""
    allowed_hosts: CommaSeparated[Hostname] = ()
    """Host names that requests without a key may use, comma-separated, without ports, in addition
    to localhost and loopback addresses; empty: none, or any with MPE_ALLOW_ANONYMOUS_REMOTE.
    """
    key: KeySettings = KeySettings()
    cors_origins: CommaSeparated[LowerCase] = ()
    """Origins whose pages may call the service, comma-separated (https://lab.example.org); `*`:
    all; empty: none.
    """
    log_level: Literal["DEBUG", "INFO", "WARNING", "ERROR"] = "INFO"
    """Minimum level of the messages that are logged."""
    otlp_endpoint: str | None = None
    """URL that spans are sent to, OTLP over HTTP (http://host:4318/v1/traces); unset: none are
    sent.
    """
    webhook: WebhookSettings = WebhookSettings()

    @classmethod
    def settings_customise_sources(
        cls,
        settings_cls: type[BaseSettings],
        init_settings: PydanticBaseSettingsSource,
        env_settings: PydanticBaseSettingsSource,
        dotenv_settings: PydanticBaseSettingsSource,
        file_secret_settings: PydanticBaseSettingsSource,
    ) -> tuple[PydanticBaseSettingsSource, ...]:
        """Read arguments, then the environment with old names replaced by new ones."""
        environment = EnvSettingsSource(settings_cls)
        environment.env_vars = _rename_variables(environment.env_vars)
        return init_settings, environment

    @field_validator("database_url")
    @classmethod
    def _check_database_url(cls, value: SecretStr | None) -> SecretStr | None:
        # the message must not repeat the value: there is a password in it
        if value is not None and not value.get_secret_value().startswith("postgresql://"):
            raise ValueError("expected postgresql://user:password@host/database")
        if value is not None and find_spec("psycopg") is None:
            raise ValueError("install the driver: pip install 'mpe[postgres]'")
        return value

    @model_validator(mode="after")
    def _check_core_budget(self) -> Settings:
        cores = available_cores()
        if self.workers * max(1, self.threads_per_worker) > max(cores, self.workers):
            raise ValueError(
                f"MPE_WORKERS={self.workers} times MPE_THREADS_PER_WORKER="
                f"{self.threads_per_worker} exceeds the {cores} cores; lower one of them"
            )
        return self

    @property
    def sqlite_path(self) -> Path:
        """File of the job store where MPE_DATABASE_URL is not set."""
        return self.data_dir / "jobs.sqlite3"

    @property
    def store_url(self) -> str:
        """SQLAlchemy URL of the job store."""
        if self.database_url is None:
            return f"sqlite:///{self.sqlite_path}"
        return self.database_url.get_secret_value()

    def check_shared(self) -> None:
        """Check that other services can reach the registrations.

        Raises
        ------
        InvalidSettingsError
            They are in the data directory.
        """
        if self.database_url is None:
            raise InvalidSettingsError(
                "services that share registrations need a database: set MPE_DATABASE_URL"
            )

    @property
    def shares_data_dir(self) -> bool:
        """Whether other services may use the same data directory: it holds the blobs of all."""
        return self.database_url is not None and self.blob.url is None

    @property
    def connections_per_address(self) -> int:
        """Open connections that one address may have."""
        return self.max_connections_per_address or max(1, self.max_connections // 2)

    @property
    def threads(self) -> int:
        """Threads of one registration."""
        return self.threads_per_worker or max(1, available_cores() // self.workers)


GROUPS: dict[str, type[SettingsGroup]] = {
    "url": UrlSettings,
    "s3": S3Settings,
    "blob": BlobSettings,
    "key": KeySettings,
    "webhook": WebhookSettings,
}
"""Groups of `Settings` by the name of their field."""


def load_settings(**given: Any) -> Settings:
    """Read the settings from the environment; those that are given go before it.

    Raises
    ------
    InvalidSettingsError
        A value is not allowed; the message names each variable, and no value.
    """
    try:
        return Settings(**given)
    except ValidationError as error:
        raise InvalidSettingsError("; ".join(map(_describe, error.errors()))) from None


def log_renamed_variables(environment: Mapping[str, str] = os.environ) -> None:
    """Log a deprecation warning for each variable that is set by its old name."""
    for old, new in RENAMED_VARIABLES.items():
        if old in environment:
            log.warning("%s is deprecated and will be removed; set %s instead", old, new)


def setting_variables() -> Iterator[tuple[str, FieldInfo]]:
    """Yield each environment variable and the field that it sets, groups resolved."""
    for name, field in Settings.model_fields.items():
        if (group := GROUPS.get(name)) is None:
            yield f"{PREFIX}{name}".upper(), field
            continue
        for inner, inner_field in group.model_fields.items():
            yield f"{PREFIX}{name}_{inner}".upper(), inner_field


def _rename_variables(values: Mapping[str, str | None]) -> dict[str, str | None]:
    """Give old variables their new names; a new one that is set wins. Names in lower case."""
    renamed = {old.lower(): new.lower() for old, new in RENAMED_VARIABLES.items()}
    successors = {renamed[name]: value for name, value in values.items() if name in renamed}
    whole_groups = {f"{PREFIX}{name}".lower() for name in GROUPS}  # MPE_KEY is no setting
    return {name: v for name, v in (successors | dict(values)).items() if name not in whole_groups}


def _describe(error: Mapping[str, Any]) -> str:
    message = str(error["msg"]).removeprefix("Value error, ")
    path = [str(part) for part in error["loc"]]
    variables = {name for name, _ in setting_variables()}
    for length in (2, 1):  # of a group, or not
        variable = (PREFIX + "_".join(path[:length])).upper()
        if variable in variables:
            return f"{variable}: {message}"
    return message
