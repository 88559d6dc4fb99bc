"""Settings come from MPE_ variables and are checked at the start."""

from __future__ import annotations

import subprocess
import sys

import pytest
from pydantic import ValidationError

from service.settings import Settings, available_cores


def test_variables_are_read(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MPE_WORKERS", "1")
    monkeypatch.setenv("MPE_URL_HOSTS", "Scans.example.org, files.example.org")
    settings = Settings()
    assert settings.workers == 1
    assert settings.url_hosts == ("scans.example.org", "files.example.org")


def test_ports_and_networks_are_listed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MPE_URL_PORTS", "443, 8443")
    monkeypatch.setenv("MPE_PRIVATE_NETWORKS", "10.1.0.0/16, fd00:1::/32,192.168.0.7")
    settings = Settings()
    assert settings.url_ports == (443, 8443)
    networks = ("10.1.0.0/16", "fd00:1::/32", "192.168.0.7/32")
    assert tuple(map(str, settings.private_networks)) == networks


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("URL_PORTS", "0"),
        ("URL_PORTS", "https"),
        ("PRIVATE_NETWORKS", "intern.example.org"),
        ("ALLOWED_HOSTS", "mpe:8000"),
        ("S3_ENDPOINT", "store:9000"),
    ],
)
def test_other_ports_and_networks_are_refused(
    name: str, value: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(f"MPE_{name}", value)
    with pytest.raises(ValidationError, match=name.lower()):
        Settings()


def test_half_a_key_of_s3_is_refused() -> None:
    with pytest.raises(ValidationError, match="set both or none"):
        Settings(s3_access_key_id="scanner")


def test_threads_fill_the_cores() -> None:
    assert Settings(workers=1).threads == available_cores()
    settings = Settings()
    assert settings.workers * settings.threads <= available_cores()


def test_more_threads_than_cores_are_refused() -> None:
    with pytest.raises(ValidationError, match="MPE_THREADS_PER_WORKER"):
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
    with pytest.raises(ValidationError, match="expected postgresql://") as caught:
        Settings()
    assert "sesame" not in str(caught.value)
