"""Clouds that the service fetches from real servers beside it."""

from __future__ import annotations

import hashlib
import ssl
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import psutil
import pytest
import trustme

from tests.factories.processes import workers
from tests.factories.scans import arms, as_npy
from tests.factories.scans_online import CLOUD, post, scans_online
from tests.factories.server import Server, finished, running_server
from tests.factories.waiting import until
from tests.factories.web import Handler, Web

SECRET = "X-Amz-Signature=0123456789abcdef"


@pytest.fixture(scope="module")
def web() -> Iterator[Web]:
    with scans_online() as running:
        yield running


@pytest.fixture(scope="module")
def safe_web() -> Iterator[tuple[Web, trustme.CA]]:
    authority = trustme.CA()
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    authority.issue_cert("localhost").configure_cert(context)
    with scans_online(context) as running:
        yield running, authority


@pytest.fixture(scope="module")
def fetching(
    tmp_path_factory: pytest.TempPathFactory, safe_web: tuple[Web, trustme.CA]
) -> Iterator[Server]:
    directory = tmp_path_factory.mktemp("fetching")
    authorities = directory / "authorities.pem"
    safe_web[1].cert_pem.write_to_path(str(authorities))
    with pytest.MonkeyPatch.context() as environment:
        environment.setenv("SSL_CERT_FILE", str(authorities))
        with running_server(directory, private_networks="127.0.0.0/8, ::1/128") as server:
            yield server


def aligned(response: httpx.Response) -> dict[str, Any]:
    job = dict(response.json())
    assert response.status_code == 200, job
    assert job["status"] == "succeeded", job["error"]
    assert job["source"]["sha256"] == hashlib.sha256(CLOUD).hexdigest()
    assert job["source"]["size"] == len(CLOUD)
    assert job["timing"]["fetch_s"] > 0
    assert job["result"]["overlap"] == 1
    return job


@pytest.mark.parametrize("path", ["/cloud.npy", "/moved", "/cut"])
def test_both_clouds_are_fetched(fetching: Server, web: Web, path: str) -> None:
    job = aligned(post(fetching, web.url(path, "127.0.0.1"), web.url("/cloud.npy", "localhost")))
    assert job["options"]["seed"] == 3


def test_over_tls(fetching: Server, safe_web: tuple[Web, trustme.CA]) -> None:
    aligned(post(fetching, safe_web[0].url("/cloud.npy", "localhost")))


def test_a_cloud_and_a_url(fetching: Server, web: Web) -> None:
    fetching.client.put("/v1/clouds/arms", content=CLOUD)
    response = fetching.client.post(
        "/v1/registrations",
        json={"source": {"url": web.url("/cloud.npy", "127.0.0.1")}, "target": {"cloud": "arms"}},
        headers={"Prefer": "wait=60"},
    )
    assert aligned(response)["target"]["cloud"] == "arms"


def test_a_reference_that_has_not_changed_is_not_sent_again(fetching: Server, web: Web) -> None:
    url = web.url("/known", "127.0.0.1")
    first, second = aligned(post(fetching, url)), aligned(post(fetching, url))
    asked = [headers for path, headers in web.requests if path == "/known"]
    assert ["if-none-match" in headers for headers in asked] == [
        False,
        True,
    ]  # once for both clouds
    assert first["result"]["transform"] == second["result"]["transform"]


def test_the_way_in_is_not_shown_or_logged(fetching: Server, web: Web) -> None:
    good = web.url(f"/cloud.npy?{SECRET}", "127.0.0.1")
    bad = web.url(f"/missing?{SECRET}", "127.0.0.1")
    job = aligned(post(fetching, good))
    assert job["source"]["url"] == good.partition("?")[0]
    failed = post(fetching, good, bad)
    assert failed.status_code == 422
    jobs = fetching.client.get("/v1/registrations").text
    assert f"/cloud.npy?{SECRET}" in [path for path, _ in web.requests]
    assert SECRET not in jobs + failed.text + fetching.log


def test_a_deadline_ends_a_fetch(fetching: Server, web: Web) -> None:
    url = {"url": web.url("/drip", "127.0.0.1")}
    response = fetching.client.post(
        "/v1/registrations",
        json={"source": url, "target": url, "deadline_s": 1},
        headers={"Prefer": "wait=60"},
    )
    assert response.json()["error"]["type"] == "urn:mpe:problem:deadline-passed"
    until(lambda: not workers(fetching))


def test_children_are_filtered_and_what_is_here_is_not_fetched_again(
    fetching: Server, web: Web
) -> None:
    big, go_on = as_npy(arms(4, 100_000)), threading.Event()

    def give_later(handler: Handler) -> None:
        go_on.wait(100)
        handler.give(big)

    web.behaviours["/big"] = give_later
    url = {"url": web.url("/big", "127.0.0.1")}
    job = fetching.client.post("/v1/registrations", json={"source": url, "target": url}).json()
    (fetches,) = until(lambda: filtered(fetching))
    go_on.set()
    registers = until(lambda: [found for found in filtered(fetching) if found != fetches])
    registers[0].kill()
    done = finished(fetching.client, job["id"])
    assert (done["status"], done["attempt"]) == ("succeeded", 2)
    assert [path for path, _ in web.requests].count("/big") == 1


def filtered(server: Server) -> list[psutil.Process]:
    return [found for found in workers(server) if seccomp(found) == "2"]


def seccomp(process: psutil.Process) -> str | None:
    """2: its calls are filtered; 0: they are not; None: it has ended."""
    try:
        lines = Path(f"/proc/{process.pid}/status").read_text().splitlines()
    except OSError:
        return None
    return next(line.split()[1] for line in lines if line.startswith("Seccomp:"))
