"""What is somebody else's cannot be seen, used or changed: every route of openapi.yaml is tried."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from contextlib import ExitStack
from typing import Any, NamedTuple
from uuid import uuid4

import httpx
import pytest
import yaml

from tests.factories.scans import arms, as_npy
from tests.factories.server import CALL_S, PROJECT, Server, registered, running_server, submit
from tests.factories.tenants import caller, new_key, revoke

API = yaml.safe_load((PROJECT / "openapi.yaml").read_text())
METHODS = ("get", "put", "post", "delete", "options", "head", "patch", "trace", "query")
OPEN = {("get", "/livez"), ("get", "/readyz")}
CLOUD = as_npy(arms(1))
FORM = {"files": {"source": CLOUD, "target": CLOUD}, "data": {"options": '{"seed": 1}'}}
TUS = {"Tus-Resumable": "1.0.0"}
# what a call needs beside its path; a route that is not here needs nothing
NEEDED: dict[tuple[str, str], dict[str, Any]] = {
    ("post", "/v1/registrations"): FORM,
    ("get", "/v1/registrations/{job_id}/preview"): {"params": {"role": "source"}},
    ("post", "/v1/clouds"): {"content": CLOUD},
    ("put", "/v1/clouds/{cloud_id}"): {"content": CLOUD},
    ("post", "/v1/clouds/presign"): {"json": {"size": len(CLOUD), "sha256": "0" * 64}},
    ("post", "/v1/uploads"): {"headers": TUS | {"Upload-Length": "100"}},
    ("head", "/v1/uploads/{upload_id}"): {"headers": TUS},
    ("delete", "/v1/uploads/{upload_id}"): {"headers": TUS},
    ("patch", "/v1/uploads/{upload_id}"): {
        "headers": TUS | {"Upload-Offset": "0", "Content-Type": "application/offset+octet-stream"},
        "content": b"0123456789",
    },
}


class Route(NamedTuple):
    method: str
    path: str


ROUTES = [
    Route(method, path)
    for path, operations in API["paths"].items()
    for method in operations
    if method in METHODS
]
CLOSED = [route for route in ROUTES if route not in OPEN]
NAMES_A_THING = [route for route in CLOSED if "{" in route.path]
NOT_HERE = {r for r in CLOSED if "presign" in r.path}
"""Routes that need a store with signed URLs; tests/e2e/test_cluster.py has one."""
CREATES = Route("put", "/v1/clouds/{cloud_id}")  # under any id: the tenant's own cloud
named = {"ids": lambda route: f"{route.method} {route.path}"}


def call(client: httpx.Client, route: Route, things: dict[str, str]) -> httpx.Response:
    path = route.path.format(**things)
    return client.request(route.method.upper(), path, **NEEDED.get(route, {}))


class World(NamedTuple):
    server: Server
    alice: httpx.Client
    bob: httpx.Client
    things: dict[str, str]
    """Ids of what is Alice's, by their names in the paths."""


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Iterator[World]:
    with (
        running_server(tmp_path_factory.mktemp("tenants"), require_keys=True) as server,
        caller(server, new_key(server, "alice")) as alice,
        caller(server, new_key(server, "bob")) as bob,
    ):
        job = registered(alice, CLOUD, CLOUD, headers={"Idempotency-Key": "once"})
        alice.put("/v1/clouds/door", content=CLOUD).raise_for_status()
        upload = call(alice, Route("post", "/v1/uploads"), {})
        things = {
            "job_id": job["id"],
            "cloud_id": "door",
            "upload_id": upload.headers["Location"].rpartition("/")[2],
        }
        yield World(server, alice, bob, things)


def belongings(world: World) -> list[Any]:
    """All that can be asked about what is Alice's."""
    path = f"/v1/registrations/{world.things['job_id']}"
    upload = world.alice.head(f"/v1/uploads/{world.things['upload_id']}", headers=TUS)
    texts = [
        world.alice.get(url).text
        for url in (
            path,
            f"{path}/inliers",
            f"{path}/events",
            f"{path}/deliveries",
            "/v1/registrations",
            "/v1/clouds/door",
            "/v1/clouds",
        )
    ]
    return [*texts, upload.status_code, upload.headers["Upload-Offset"]]


def said(response: httpx.Response) -> tuple[int, Any]:
    """Status and document, but for the ids in them."""
    return response.status_code, re.sub(r"[0-9a-f]{8}-[0-9a-f-]{27}", "ID", response.text)


@pytest.mark.parametrize("route", [r for r in NAMES_A_THING if r != CREATES], **named)
def test_somebody_elses_thing_is_like_none(world: World, route: Route) -> None:
    before = belongings(world)
    foreign = call(world.bob, route, world.things)
    missing = call(world.bob, route, dict.fromkeys(world.things, str(uuid4())))
    assert foreign.status_code == (409 if route in NOT_HERE else 404)
    assert said(foreign) == said(missing)
    assert set(foreign.headers) == set(missing.headers)
    assert belongings(world) == before
    if route.method != "delete":  # the very call that failed is right for its owner
        assert call(world.alice, route, world.things).status_code != 404


@pytest.mark.parametrize("route", [r for r in CLOSED if r not in NAMES_A_THING], **named)
def test_nothing_of_somebody_else_is_told(world: World, route: Route) -> None:
    before = belongings(world)
    response = call(world.bob, route, world.things)
    assert response.status_code == 409 if route in NOT_HERE else response.status_code < 300
    for thing in world.things.values():
        assert f'"{thing}"' not in response.text
    assert belongings(world) == before


def test_the_same_name_is_another_cloud(world: World) -> None:
    mine = as_npy(arms(2))
    before = belongings(world)
    assert call(world.bob, CREATES, {"cloud_id": "door"}).status_code == 200
    world.bob.put("/v1/clouds/door", content=mine).raise_for_status()
    assert belongings(world) == before
    assert world.bob.get("/v1/clouds/door").json()["size"] == len(mine)
    assert world.bob.delete("/v1/clouds/door").status_code == 204
    assert belongings(world) == before


def test_somebody_elses_cloud_cannot_be_referred_to(world: World) -> None:
    def ask(cloud: str) -> httpx.Response:
        request = {"source": {"cloud": cloud}, "target": {"cloud": cloud}}
        return world.bob.post("/v1/registrations", json=request)

    assert ask("door").status_code == 404
    assert said(ask("door")) == said(ask("nothing"))


def test_the_same_work_is_known_to_its_tenant_alone(world: World) -> None:
    pair = (as_npy(arms(5)), as_npy(arms(5)))
    first = registered(world.alice, *pair)
    again = registered(world.alice, *pair)
    foreign = registered(world.bob, *pair)
    assert [job["cached"] for job in (first, again, foreign)] == [False, True, False]
    assert foreign["result"] == first["result"]


def test_the_same_idempotency_key_is_another_request(world: World) -> None:
    other = as_npy(arms(6))
    headers = {"Idempotency-Key": "once"}
    job = submit(world.bob, other, other, headers=headers).json()
    assert job["id"] != world.things["job_id"]
    assert submit(world.bob, other, other, headers=headers).json()["id"] == job["id"]
    assert submit(world.alice, CLOUD, CLOUD, headers=headers).json()["id"] == world.things["job_id"]


def test_a_cursor_of_somebody_else_leads_nowhere_else(world: World) -> None:
    for seed in range(2):
        registered(world.alice, CLOUD, CLOUD, options=f'{{"seed": {seed}}}')
    cursor = world.alice.get("/v1/registrations?limit=1").json()["next_cursor"]
    mine = {job["id"] for job in world.bob.get("/v1/registrations?limit=200").json()["items"]}
    page = world.bob.get("/v1/registrations", params={"limit": 200, "cursor": cursor}).json()
    assert {job["id"] for job in page["items"]} <= mine


def refused(response: httpx.Response) -> None:
    assert response.status_code == 401, response.text
    assert response.headers["WWW-Authenticate"].startswith('Bearer realm="mpe"')
    if response.request.method != "HEAD":
        assert response.headers["Content-Type"] == "application/problem+json"
        assert response.json()["type"] == "urn:mpe:problem:unauthorized"


@pytest.fixture(scope="module")
def strangers(world: World) -> Iterator[dict[str, httpx.Client]]:
    """Clients that nobody knows."""
    gone = new_key(world.server, "alice")
    revoke(world.server, gone)
    good = world.alice.headers["Authorization"]
    other = world.bob.headers["Authorization"]
    headers = {
        "nothing": [],
        "revoked": [f"Bearer {gone}"],
        "wrong secret": [good[:-1] + ("a" if good[-1] != "a" else "b")],
        "secret of another": [good.rpartition("_")[0] + "_" + other.rpartition("_")[2]],
        "unknown id": [re.sub(r"mpe_.{16}", "mpe_" + 16 * "0", good)],
        "no scheme": [good.removeprefix("Bearer ")],
        "another scheme": [good.replace("Bearer", "Basic")],
        "no prefix": [good.replace("mpe_", "")],
        "cut short": [good[:-1]],
        "something behind": [good + " x"],
        "empty": ["Bearer"],
        "two keys": [good, good],
        "not ASCII": ["Bearer mpe_\u00e9"],
    }
    with ExitStack() as stack:
        yield {
            name: stack.enter_context(
                httpx.Client(
                    base_url=world.server.url,
                    headers=[("Authorization", value.encode()) for value in values],
                    timeout=CALL_S,
                    trust_env=False,
                )
            )
            for name, values in headers.items()
        }


@pytest.mark.parametrize("route", CLOSED, **named)
def test_every_route_needs_a_key(
    world: World, strangers: dict[str, httpx.Client], route: Route
) -> None:
    before = belongings(world)
    for client in strangers.values():
        refused(call(client, route, world.things))
    assert belongings(world) == before


def test_a_key_counts_in_the_header_alone(world: World, strangers: dict[str, httpx.Client]) -> None:
    key = world.alice.headers["Authorization"].removeprefix("Bearer ")
    stranger = strangers["nothing"]
    refused(stranger.get("/v1/registrations", params={"key": key, "access_token": key}))
    refused(stranger.get("/v1/registrations", headers={"Cookie": f"Authorization=Bearer {key}"}))
    refused(stranger.get("/v1/registrations", auth=("mpe", key)))
    refused(stranger.get("/v1/registrations", headers={"X-API-Key": key}))


def test_a_refusal_comes_before_the_request_is_looked_at(
    strangers: dict[str, httpx.Client],
) -> None:
    stranger = strangers["nothing"]
    refused(stranger.get("/v1/registrations?limit=0"))
    refused(stranger.get("/v1/clouds/not%20an%20id"))
    refused(stranger.post("/v1/registrations", content=b"x", headers={"Content-Type": "a/b"}))


def test_what_is_open(strangers: dict[str, httpx.Client]) -> None:
    for method, path in OPEN:
        assert strangers["nothing"].request(method, path).status_code == 200
    assert strangers["nothing"].get("/openapi.json").status_code == 200


def test_every_closed_route_declares_the_key(world: World) -> None:
    assert API["components"]["securitySchemes"]["key"]["scheme"] == "bearer"
    for route in ROUTES:
        declared = API["paths"][route.path][route.method].get("security")
        assert declared == (None if route in OPEN else [{"key": []}, {}]), route


def test_lists_are_complete_for_their_own_tenant(world: World) -> None:
    jobs = world.alice.get("/v1/registrations?limit=200").json()["items"]
    assert world.things["job_id"] in [job["id"] for job in jobs]
    assert "door" in [cloud["id"] for cloud in world.alice.get("/v1/clouds").json()["items"]]
    assert json.loads(world.alice.get("/v1/capacity").text)["share"]["stored_bytes"] > len(CLOUD)
