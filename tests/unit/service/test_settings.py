"""Settings come from MPE_ variables and are checked at the start."""

from __future__ import annotations

import base64
import logging
import subprocess
import sys

import pytest
from pydantic import SecretStr

from mpe_core.machine import available_cores
from service.settings import (
    GROUPS,
    RENAMED_VARIABLES,
    InvalidSettingsError,
    S3Settings,
    Settings,
    SettingsGroup,
    WebhookSettings,
    load_settings,
    log_renamed_variables,
    setting_variables,
)


def test_variables_are_read(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MPE_WORKERS", "1")
    monkeypatch.setenv("MPE_URL_HOSTS", "Scans.example.org, files.example.org")
    settings = load_settings()
    assert settings.workers == 1
    assert settings.url.hosts == ("scans.example.org", "files.example.org")


def test_ports_and_networks_are_listed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MPE_URL_PORTS", "443, 8443")
    monkeypatch.setenv("MPE_PRIVATE_NETWORKS", "10.1.0.0/16, fd00:1::/32,192.168.0.7")
    settings = load_settings()
    assert settings.url.ports == (443, 8443)
    networks = ("10.1.0.0/16", "fd00:1::/32", "192.168.0.7/32")
    assert tuple(map(str, settings.private_networks)) == networks


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("MPE_URL_PORTS", "0"),
        ("MPE_URL_PORTS", "https"),
        ("MPE_URL_TIMEOUT_S", "0"),
        ("MPE_PRIVATE_NETWORKS", "intern.example.org"),
        ("MPE_ALLOWED_HOSTS", "mpe:8000"),
        ("MPE_S3_ENDPOINT", "store:9000"),
        ("MPE_QUEUE_LIMIT", "none"),
        ("MPE_WEBHOOK_HOSTS", "hooks.example.org"),
        ("MPE_WEBHOOK_SECRET", "whsec_?"),
    ],
)
def test_an_error_names_the_variable(
    name: str, value: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(name, value)
    with pytest.raises(InvalidSettingsError, match=name):
        load_settings()


def test_half_a_key_of_s3_is_refused() -> None:
    with pytest.raises(ValueError, match="set both or none"):
        S3Settings(access_key_id="scanner")


def test_every_group_keeps_the_names_of_its_variables() -> None:
    names = [name for name, _ in setting_variables()]
    assert len(names) == len(set(names))
    assert {"MPE_S3_ACCESS_KEY_ID", "MPE_KEY_QUEUE_LIMIT", "MPE_QUEUE_LIMIT"} <= set(names)
    fields = Settings.model_fields
    grouped = {
        name
        for name, field in fields.items()
        if isinstance(field.annotation, type) and issubclass(field.annotation, SettingsGroup)
    }
    assert grouped == GROUPS.keys()


def test_every_variable_says_what_it_means() -> None:
    assert [name for name, field in setting_variables() if not field.description] == []


@pytest.mark.parametrize("name", ["MPE_URL", "MPE_S3", "MPE_KEY", "MPE_WEBHOOK"])
def test_the_name_of_a_group_is_no_variable(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(name, "https://mpe.example.org")
    assert load_settings() == Settings()


VALUES = {
    "MPE_MAINTENANCE_INTERVAL_S": ("7", lambda settings: settings.maintenance_interval_s == 7),
    "MPE_ALLOW_ANONYMOUS_REMOTE": ("true", lambda settings: settings.allow_anonymous_remote),
    "MPE_URL_READ_TIMEOUT_S": ("7", lambda settings: settings.url.read_timeout_s == 7),
    "MPE_URL_MIN_BYTES_PER_S": ("7", lambda settings: settings.url.min_bytes_per_s == 7),
    "MPE_WEBHOOK_MAX_ATTEMPTS": ("7", lambda settings: settings.webhook.max_attempts == 7),
    "MPE_WEBHOOK_BACKOFF_S": ("7", lambda settings: settings.webhook.backoff_s == 7),
}


@pytest.mark.parametrize(("old", "new"), RENAMED_VARIABLES.items())
def test_an_old_name_is_accepted_with_a_warning(
    old: str, new: str, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    value, is_read = VALUES[new]
    monkeypatch.setenv(old, value)
    assert is_read(load_settings())
    with caplog.at_level(logging.WARNING):
        log_renamed_variables()
    assert [record.getMessage() for record in caplog.records] == [
        f"{old} is deprecated and will be removed; set {new} instead"
    ]


def test_the_new_name_takes_precedence(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MPE_UPKEEP_INTERVAL_S", "7")
    monkeypatch.setenv("MPE_MAINTENANCE_INTERVAL_S", "8")
    assert load_settings().maintenance_interval_s == 8


def test_the_signing_key_is_the_secret_or_what_its_base64_decodes_to() -> None:
    key = bytes(range(24))
    encoded = f"whsec_{base64.b64encode(key).decode()}"
    assert WebhookSettings(secret=SecretStr(encoded)).signing_key == key
    assert WebhookSettings(secret=SecretStr("spring tide")).signing_key == b"spring tide"


def test_threads_fill_the_cores() -> None:
    assert Settings(workers=1).threads == available_cores()
    settings = Settings()
    assert settings.workers * settings.threads <= available_cores()


def test_more_threads_than_cores_are_refused() -> None:
    with pytest.raises(ValueError, match="MPE_THREADS_PER_WORKER"):
        Settings(workers=available_cores(), threads_per_worker=2)


def test_service_process_loads_no_kernel_and_no_open3d() -> None:
    heavy = "[m for m in sys.modules if m.startswith(('numba', 'mpe_core.kernels', 'open3d'))]"
    program = f"import sys; import service.server; print({heavy})"
    loaded = subprocess.run([sys.executable, "-c", program], capture_output=True, check=True)
    assert loaded.stdout.strip() == b"[]"


def test_another_database_is_refused_without_telling_the_password(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("MPE_DATABASE_URL", "mysql://mpe:sesame@there/mpe")
    with pytest.raises(InvalidSettingsError, match="expected postgresql://") as caught:
        load_settings()
    assert "sesame" not in str(caught.value)
