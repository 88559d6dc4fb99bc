"""What one key or tenant may use, and that others are not bothered by it."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import httpx
import pytest

from service.jobs.usage import ROW_BYTES
from tests.factories.scans import arms, as_npy
from tests.factories.server import Server, registered, running_server, submit
from tests.factories.slow import SLOW, slow_pair
from tests.factories.tenants import caller, new_key
from tests.factories.waiting import until

CLOUD = as_npy(arms(1))
ONE_CLOUD = len(CLOUD) + ROW_BYTES
TUS = {"Tus-Resumable": "1.0.0"}


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    directory = tmp_path_factory.mktemp("quotas")
    settings = {"key_queue_limit": 2, "key_requests_per_s": 0}
    with running_server(directory, require_keys=True, workers=1, **settings) as running:
        yield running


def refused(response: httpx.Response, kind: str, limit: str) -> dict[str, Any]:
    """The problem document of a 429."""
    assert response.status_code == 429, response.text
    problem: dict[str, Any] = response.json()
    assert problem["type"] == f"urn:mpe:problem:{kind}"
    assert problem["limit"] == limit
    assert int(response.headers["Retry-After"]) >= 1
    return problem


def test_a_key_is_used_so_many_times_a_second(server: Server) -> None:
    with (
        caller(server, new_key(server, "busy", requests_per_s=1)) as busy,
        caller(server, new_key(server, "busy")) as colleague,
    ):
        assert busy.get("/v1/formats").status_code == 200
        answers: list[httpx.Response] = []

        def is_refused() -> bool:
            answers.append(busy.get("/v1/formats"))
            return answers[-1].status_code != 200

        until(is_refused)  # as soon as two come within a second
        assert refused(answers[-1], "rate-limited", "requests_per_s")["allowed"] == 1
        assert colleague.get("/v1/formats").status_code == 200
        until(lambda: busy.get("/v1/formats").status_code == 200)


def test_a_pause_earns_a_burst(server: Server) -> None:
    with caller(server, new_key(server, "burst", requests_per_s=10)) as burst:
        assert [burst.get("/v1/formats").status_code for _ in range(10)] == [200] * 10


def test_a_tenant_has_so_many_waiting(server: Server) -> None:
    with (
        caller(server, new_key(server, "eager", queue_limit=None)) as eager,
        caller(server, new_key(server, "eager", queue_limit=3)) as more,
        caller(server, new_key(server, "other")) as other,
    ):
        first = submit(eager, *slow_pair(), options=SLOW).json()
        until(lambda: eager.get(f"/v1/registrations/{first['id']}").json()["status"] == "running")
        waiting = [submit(eager, CLOUD, CLOUD, options=json.dumps({"seed": s})) for s in range(2)]
        assert [answer.status_code for answer in waiting] == [202, 202]
        problem = refused(submit(eager, CLOUD, CLOUD), "quota-exceeded", "queue_limit")
        assert (problem["used"], problem["allowed"]) == (2, 2)
        share = eager.get("/v1/capacity").json()["share"]
        assert (share["queued"], share["queue_limit"]) == (2, 2)
        third = submit(more, CLOUD, CLOUD)
        assert third.status_code == 202
        strange = submit(other, CLOUD, CLOUD)
        assert strange.status_code == 202
        for answer in (*waiting, third):
            eager.delete(f"/v1/registrations/{answer.json()['id']}")
        assert submit(eager, CLOUD, CLOUD).status_code == 202
        eager.delete(f"/v1/registrations/{first['id']}")


def stored(client: httpx.Client) -> int:
    return int(client.get("/v1/capacity").json()["share"]["stored_bytes"])


def test_what_is_stored_is_counted_once_and_given_back(server: Server) -> None:
    other = as_npy(arms(2))
    with (
        caller(server, new_key(server, "tidy")) as tidy,
        caller(server, new_key(server, "twin")) as twin,
    ):
        assert stored(tidy) == 0
        for name in ("a", "b"):
            tidy.put(f"/v1/clouds/{name}", content=CLOUD).raise_for_status()
        until(lambda: stored(tidy) == len(CLOUD) + 2 * ROW_BYTES)
        twin.put("/v1/clouds/a", content=CLOUD).raise_for_status()
        until(lambda: stored(twin) == ONE_CLOUD)  # that it is there already is nobody's business
        job = registered(tidy, CLOUD, other)
        pairs = tidy.get(f"/v1/registrations/{job['id']}/inliers?format=npy").content
        until(lambda: stored(tidy) > len(CLOUD) + len(other) + len(pairs))
        tidy.delete(f"/v1/registrations/{job['id']}")
        until(lambda: stored(tidy) == len(CLOUD) + 2 * ROW_BYTES)
        tidy.delete("/v1/clouds/a")
        tidy.delete("/v1/clouds/b")
        until(lambda: stored(tidy) == 0)


def test_a_tenant_has_so_much_stored(server: Server) -> None:
    room = ONE_CLOUD + ROW_BYTES + 100
    key = new_key(server, "small", stored_bytes=room)
    with caller(server, key) as small, caller(server, new_key(server, "large")) as large:
        small.put("/v1/clouds/a", content=CLOUD).raise_for_status()
        for client, fits in ((small, False), (large, True)):
            answers = [
                client.put("/v1/clouds/b", content=CLOUD),
                client.post("/v1/clouds", content=CLOUD),
                submit(client, CLOUD, CLOUD),
                client.post("/v1/uploads", headers=TUS | {"Upload-Length": "101"}),
                client.put("/v1/clouds/b", content=iter([CLOUD])),  # does not say how long it is
            ]
            if fits:
                assert [answer.is_success for answer in answers] == [True] * len(answers)
            else:
                problems = [refused(a, "quota-exceeded", "stored_bytes") for a in answers]
                used = [problem["used"] for problem in problems]
                assert used == [ONE_CLOUD] * 4 + [ONE_CLOUD + ROW_BYTES]  # its row was reserved

        def upload_all() -> httpx.Response | None:
            """What a refused body had reserved counts until the next count."""
            answer = small.post("/v1/uploads", headers=TUS | {"Upload-Length": "100"})
            return answer if answer.status_code == 201 else None

        upload = until(upload_all)
        until(lambda: stored(small) == room)
        pair = {"source": {"cloud": "a"}, "target": {"cloud": "a"}}
        refused(small.post("/v1/registrations", json=pair), "quota-exceeded", "stored_bytes")
        small.delete(upload.headers["Location"], headers=TUS)
        until(lambda: small.post("/v1/registrations", json=pair).status_code == 202)


def test_rows_count(server: Server) -> None:
    """Registrations whose result is known cost their labels, too."""
    key = new_key(server, "wordy", stored_bytes=2**20)
    with caller(server, key) as wordy:
        wordy.put("/v1/clouds/a", content=CLOUD).raise_for_status()
        labels = {f"label-{i}": "x" * 200 for i in range(16)}
        pair = {"source": {"cloud": "a"}, "target": {"cloud": "a"}, "labels": labels}
        first = wordy.post("/v1/registrations", json=pair, headers={"Prefer": "wait=60"})
        assert first.json()["status"] == "succeeded"
        answers: list[httpx.Response] = []

        def is_refused() -> bool:
            answers.append(wordy.post("/v1/registrations", json=pair))
            return answers[-1].status_code != 200

        until(is_refused)
        refused(answers[-1], "quota-exceeded", "stored_bytes")
        assert len(answers) < 2**20 / ROW_BYTES


def test_what_is_on_its_way_counts(server: Server) -> None:
    """A body that would fit alone is refused while another one arrives."""
    key = new_key(server, "racing", stored_bytes=ONE_CLOUD + 10)
    size = {"Content-Length": str(len(CLOUD))}
    with caller(server, key) as first, caller(server, key) as second:

        def slowly() -> Iterator[bytes]:
            yield CLOUD[:100]
            until(lambda: stored(second) == ONE_CLOUD)
            refused(second.put("/v1/clouds/b", content=CLOUD), "quota-exceeded", "stored_bytes")
            yield CLOUD[100:]

        assert first.put("/v1/clouds/a", content=slowly(), headers=size).status_code == 200
        until(lambda: stored(second) == ONE_CLOUD)
