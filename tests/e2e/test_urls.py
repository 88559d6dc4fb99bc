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

from service.fetching import FetchRules, check_source
from service.problems import AddressRefusedError
from service.settings import Settings
from tests.e2e.processes import workers
from tests.e2e.scans import arms, as_npy
from tests.server import Server, finished, running_server
from tests.service.fetching.web import Handler, Web, serving
from tests.waiting import until

CLOUD = as_npy(arms(1))
SECRET = "X-Amz-Signature=0123456789abcdef"


def give_if_changed(handler: Handler) -> None:
    if handler.headers.get("If-None-Match") == '"1"':
        handler.head(304, ETag='"1"')
    else:
        handler.give(CLOUD, ETag='"1"')


def cut(handler: Handler) -> None:
    """The first half, then the rest."""
    half, said = len(CLOUD) // 2, {"ETag": '"1"', "Content-Length": str(len(CLOUD))}
    if "Range" not in handler.headers:
        handler.head(**said)
        handler.wfile.write(CLOUD[:half])
        handler.close_connection = True
        return
    said["Content-Range"] = f"bytes {half}-{len(CLOUD) - 1}/{len(CLOUD)}"
    handler.head(206, **said | {"Content-Length": str(len(CLOUD) - half)})
    handler.wfile.write(CLOUD[half:])


def drip(handler: Handler) -> None:
    handler.head(Content_Length=str(len(CLOUD)))
    handler.drip(every_s=0.1)


BEHAVIOURS = {
    "/cloud.npy": lambda handler: handler.give(CLOUD),
    "/moved": lambda handler: handler.give(b"", 302, Location="/cloud.npy"),
    "/to-metadata": lambda handler: handler.give(
        b"", 302, Location="http://169.254.169.254/latest/"
    ),
    "/round": lambda handler: handler.give(b"", 302, Location="/round"),
    "/large": lambda handler: handler.head(Content_Length=str(10**9)),
    "/known": give_if_changed,
    "/cut": cut,
    "/drip": drip,
}


@pytest.fixture(scope="module")
def web() -> Iterator[Web]:
    with serving() as running:
        running.behaviours |= BEHAVIOURS
        yield running


@pytest.fixture(scope="module")
def safe_web() -> Iterator[tuple[Web, trustme.CA]]:
    authority = trustme.CA()
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    authority.issue_cert("localhost").configure_cert(context)
    with serving(tls=context) as running:
        running.behaviours |= BEHAVIOURS
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
        with running_server(
            directory,
            private_networks="127.0.0.0/8, ::1/128",
            max_body_bytes=20_000_000,
        ) as server:
            yield server


@pytest.fixture(scope="module")
def impatient(tmp_path_factory: pytest.TempPathFactory, web: Web) -> Iterator[Server]:
    """It calls one host at one port, and waits for nobody."""
    directory = tmp_path_factory.mktemp("impatient")
    with running_server(
        directory,
        url_hosts="127.0.0.1, nobody.invalid",
        url_ports=web.server_port,
        private_networks="127.0.0.0/8",
        url_stall_s=1,
    ) as server:
        yield server


def post(server: Server, source: str, target: str | None = None) -> httpx.Response:
    return server.client.post(
        "/v1/registrations",
        json={
            "source": {"url": source},
            "target": {"url": target or source},
            "options": {"seed": 3},
        },
        headers={"Prefer": "wait=60"},
    )


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
    assert ["if-none-match" in headers for headers in asked] == [False, True, True, True]
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


@pytest.mark.parametrize(
    ("url", "kind", "words"),
    [
        ("http://127.0.0.1:{port}/missing", "fetch-status", "404"),
        ("http://127.0.0.1:{port}/round", "fetch-failed", "redirects"),
        ("http://127.0.0.1:{port}/large", "fetch-too-large", "20000000 bytes"),
        ("https://127.0.0.1:{port}/cloud.npy", "fetch-tls", "TLS"),
        ("http://127.0.0.1:14999/cloud.npy", "fetch-failed", "reached"),
    ],
)
def test_what_cannot_be_fetched_is_explained(
    fetching: Server, web: Web, url: str, kind: str, words: str
) -> None:
    response = post(fetching, web.url("/cloud.npy", "127.0.0.1"), url.format(port=web.server_port))
    assert response.status_code == 422
    problem = response.json()
    assert problem["type"] == f"urn:mpe:problem:{kind}"
    assert words in problem["detail"]
    assert problem["detail"].startswith("target: ")
    job = fetching.client.get(f"/v1/registrations/{problem['job']}").json()
    assert job["status"] == "failed"
    assert job["error"]["type"] == problem["type"]


def test_a_slow_drip_is_not_waited_for(impatient: Server, web: Web) -> None:
    problem = post(impatient, web.url("/drip", "127.0.0.1")).json()
    assert problem["type"] == "urn:mpe:problem:fetch-too-slow"


def test_a_name_that_nobody_has(impatient: Server, web: Web) -> None:
    problem = post(impatient, web.url("/cloud.npy", "nobody.invalid")).json()
    name, slow = (f"urn:mpe:problem:fetch-{end}" for end in ("name", "too-slow"))
    assert problem["type"] in (name, slow), "or nobody who knows names answered in time"
    assert "resolved" in problem["detail"]


def test_a_certificate_of_nobody_known(fetching: Server) -> None:
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    trustme.CA().issue_cert("localhost").configure_cert(context)
    with serving(tls=context) as impostor:
        response = post(fetching, impostor.url("/file", "localhost"))
        assert response.json()["type"] == "urn:mpe:problem:fetch-tls"
        assert impostor.requests == []


@pytest.mark.parametrize(
    ("url", "status"),
    [
        ("http://user:word@127.0.0.1/cloud.npy", 403),
        ("http://10.0.0.1/cloud.npy", 403),
        ("http://169.254.169.254/latest/meta-data/", 403),
        ("http://[::ffff:127.0.0.1]/cloud.npy", 403),
        ("http://2130706433/cloud.npy", 403),
        ("http://0x7f.1/cloud.npy", 403),
        ("http://127.0.0.1:22/", 403),
        ("s3://bucket/cloud.npy", 403),
        ("file:///etc/passwd", 422),
        ("gopher://127.0.0.1/", 422),
        ("cloud.npy", 422),
    ],
)
def test_other_addresses_are_refused_at_once(
    fetching: Server, web: Web, url: str, status: int
) -> None:
    response = post(fetching, url, web.url("/cloud.npy", "127.0.0.1"))
    assert response.status_code == status
    assert "job" not in response.json()
    assert "passwd" not in response.text


def test_a_redirect_to_what_may_not_be_called(fetching: Server, web: Web) -> None:
    response = post(fetching, web.url("/to-metadata", "127.0.0.1"))
    assert response.status_code == 403
    problem = response.json()
    assert problem["type"] == "urn:mpe:problem:address-refused"
    assert "169.254" not in problem["detail"]
    job = fetching.client.get(f"/v1/registrations/{problem['job']}").json()
    assert job["error"]["type"] == problem["type"]


def test_private_networks_are_closed_by_default(server: Server) -> None:
    with serving() as intern:
        for host in ("127.0.0.1", "localhost"):
            response = post(server, intern.url("/file", host))
            assert response.status_code == 403
            assert response.json()["type"] == "urn:mpe:problem:address-refused"
            assert "public network" in response.json()["detail"]
        assert intern.connections == 0


@pytest.mark.parametrize(
    ("url", "word"),
    [
        ("http://127.0.0.2:{port}/cloud.npy", "MPE_URL_HOSTS"),
        ("http://example.org:{port}/cloud.npy", "MPE_URL_HOSTS"),
        ("http://127.0.0.1/cloud.npy", "port"),
    ],
)
def test_hosts_and_ports_can_be_limited(impatient: Server, web: Web, url: str, word: str) -> None:
    response = post(impatient, url.format(port=web.server_port))
    assert response.status_code == 403
    assert word in response.json()["detail"]


def test_fetching_can_be_turned_off() -> None:
    rules = FetchRules.of(Settings(url_fetching=False, s3_buckets=("scans",)))
    for url in ("https://example.org/", "s3://scans/a"):
        with pytest.raises(AddressRefusedError, match="MPE_URL_FETCHING"):
            check_source(url, rules)


def test_a_deadline_ends_a_fetch(fetching: Server, web: Web) -> None:
    url = {"url": web.url("/drip", "127.0.0.1")}
    response = fetching.client.post(
        "/v1/registrations",
        json={"source": url, "target": url, "deadline_s": 1},
        headers={"Prefer": "wait=60"},
    )
    assert response.json()["error"]["type"] == "urn:mpe:problem:deadline-passed"
    until(lambda: not workers(fetching))


def test_what_decodes_has_no_network_and_what_is_here_is_not_fetched_again(
    fetching: Server, web: Web
) -> None:
    big, go_on = as_npy(arms(4, 100_000)), threading.Event()

    def give_later(handler: Handler) -> None:
        go_on.wait(100)
        handler.give(big)

    web.behaviours["/big"] = give_later
    url = {"url": web.url("/big", "127.0.0.1")}
    job = fetching.client.post("/v1/registrations", json={"source": url, "target": url}).json()
    until(lambda: "0" in map(seccomp, workers(fetching)))
    go_on.set()
    sealed = until(lambda: [found for found in workers(fetching) if seccomp(found) == "2"])
    sealed[0].kill()
    done = finished(fetching.client, job["id"])
    assert (done["status"], done["attempt"]) == ("succeeded", 2)
    assert [path for path, _ in web.requests].count("/big") == 2


def seccomp(process: psutil.Process) -> str | None:
    """2: its calls are filtered; 0: they are not; None: it has ended."""
    try:
        lines = Path(f"/proc/{process.pid}/status").read_text().splitlines()
    except OSError:
        return None
    return next(line.split()[1] for line in lines if line.startswith("Seccomp:"))
