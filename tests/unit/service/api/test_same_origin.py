"""Without a key, only this machine's names and the service's own pages may call."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from service.api.same_origin import check_origin
from service.problems import HostRefusedError, OriginRefusedError
from service.settings import Settings
from tests.factories.api import request_of

LOCAL = ("localhost", "LOCALHOST:80", "127.0.0.1:8000", "127.8.0.1", "[::1]:8000")
FOREIGN = ("evil.example", "localhost.evil.example", "127.0.0.1.evil.example", "10.0.0.1", "", "[")


def check(root: Path, *, method: str = "GET", settings: Any = None, **headers: str) -> None:
    request = request_of([], headers, method=method)
    check_origin(request, Settings(data_dir=root, **(settings or {})))


@pytest.mark.parametrize("host", LOCAL)
def test_names_of_this_machine_are_accepted(tmp_path: Path, host: str) -> None:
    check(tmp_path, host=host)


@pytest.mark.parametrize("host", FOREIGN)
def test_other_names_are_refused(tmp_path: Path, host: str) -> None:
    with pytest.raises(HostRefusedError, match="MPE_ALLOWED_HOSTS"):
        check(tmp_path, host=host)


@pytest.mark.parametrize("host", ["scans.example.org", "Scans.Example.org:443"])
def test_listed_names_are_accepted(tmp_path: Path, host: str) -> None:
    check(tmp_path, host=host, settings={"allowed_hosts": "scans.example.org"})


def test_an_open_service_accepts_any_name_unless_some_are_listed(tmp_path: Path) -> None:
    check(tmp_path, host="any.example", settings={"allow_anonymous_remote": True})
    listed = {"allow_anonymous_remote": True, "allowed_hosts": "scans.example.org"}
    with pytest.raises(HostRefusedError):
        check(tmp_path, host="any.example", settings=listed)


@pytest.mark.parametrize("method", ["GET", "HEAD", "OPTIONS"])
def test_any_page_may_send_what_changes_nothing(tmp_path: Path, method: str) -> None:
    check(tmp_path, method=method, host="localhost", origin="https://evil.example")


@pytest.mark.parametrize("method", ["POST", "PUT", "PATCH", "DELETE"])
@pytest.mark.parametrize(
    "origin", ["https://evil.example", "null", "http://localhost:81", "http://localhost.evil"]
)
def test_pages_of_other_origins_may_change_nothing(
    tmp_path: Path, method: str, origin: str
) -> None:
    with pytest.raises(OriginRefusedError, match="MPE_CORS_ORIGINS"):
        check(tmp_path, method=method, host="localhost", origin=origin)


@pytest.mark.parametrize("origin", ["http://localhost:80", "HTTPS://localhost:80", ""])
def test_the_services_own_pages_may(tmp_path: Path, origin: str) -> None:
    check(tmp_path, method="POST", host="localhost:80", origin=origin)


@pytest.mark.parametrize("origins", ["https://lab.example.org", "*"])
def test_pages_of_listed_origins_may(tmp_path: Path, origins: str) -> None:
    settings = {"cors_origins": origins}
    check(
        tmp_path,
        method="POST",
        settings=settings,
        host="localhost",
        origin="https://lab.example.org",
    )
