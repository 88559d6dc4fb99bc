"""Keys as the command makes them, on a server that runs; where it listens without any."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.factories.commands import mpe
from tests.factories.scans import arms, as_npy
from tests.factories.server import Server, free_port, running_server
from tests.factories.tenants import caller, new_key, revoke
from tests.factories.waiting import until

CLOUD = as_npy(arms(1))


def listed(data_dir: Path) -> list[list[str]]:
    """The words of each line of `mpe keys list`, but for the head."""
    done = mpe(data_dir, "keys", "list")
    assert done.returncode == 0, done.stderr
    return [line.split() for line in done.stdout.splitlines()[1:]]


def test_the_first_key_closes_an_open_server(tmp_path: Path) -> None:
    with running_server(tmp_path) as server:
        mine = server.submit(CLOUD, CLOUD).json()
        created = mpe(server.data_dir, "keys", "create", "--tenant", "lab", "--name", "laptop")
        assert created.returncode == 0, created.stderr
        key = created.stdout.strip()
        with caller(server, key) as lab:  # at once, not only when the server looks again
            assert lab.get("/v1/registrations").json()["items"] == []
        until(lambda: server.client.get("/v1/registrations").status_code == 401)
        default = mpe(server.data_dir, "keys", "create", "--tenant", "default").stdout.strip()
        with caller(server, default) as local:  # what was sent without a key is of this tenant
            items = local.get("/v1/registrations").json()["items"]
        assert [job["id"] for job in items] == [mine["id"]]


def test_a_key_is_shown_once_and_kept_as_a_hash(tmp_path: Path) -> None:
    created = mpe(tmp_path, "keys", "create", "--tenant", "lab", "--name", "rig", "--queue-limit=7")
    key = created.stdout.strip()
    _, key_id, secret = key.split("_", 2)
    (line,) = listed(tmp_path)
    assert line[:3] == [key_id, "lab", "rig"]
    assert line[5:] == ["valid", "queue_limit", "7"]
    kept = b"".join(path.read_bytes() for path in tmp_path.rglob("*") if path.is_file())
    assert key_id.encode() in kept
    assert secret.encode() not in kept
    assert secret not in mpe(tmp_path, "keys", "list").stdout
    assert mpe(tmp_path, "keys", "revoke", key_id).returncode == 0
    assert listed(tmp_path)[0][5] == "revoked"
    again = mpe(tmp_path, "keys", "revoke", key_id)
    assert (again.returncode, key_id in again.stderr) == (1, True)


def test_a_tenant_has_a_plain_name(tmp_path: Path) -> None:
    done = mpe(tmp_path, "keys", "create", "--tenant=../etc")
    assert done.returncode == 1
    assert "letters" in done.stderr
    assert done.stdout == ""


@pytest.fixture(scope="module")
def closed(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    directory = tmp_path_factory.mktemp("closed")
    with running_server(directory, require_keys=True, workers=1) as server:
        yield server


def test_keys_may_be_needed_before_there_are_any(closed: Server) -> None:
    assert closed.client.get("/v1/registrations").status_code == 401


def test_a_revoked_key_is_refused_by_the_running_server(closed: Server) -> None:
    key, other = new_key(closed, "lab"), new_key(closed, "lab")
    with caller(closed, key) as lab, caller(closed, other) as colleague:
        assert lab.get("/v1/formats").status_code == 200
        revoke(closed, key)
        until(lambda: lab.get("/v1/formats").status_code == 401, within_s=30)
        assert colleague.get("/v1/formats").status_code == 200


def test_a_key_is_taken_under_any_name_and_from_any_page(closed: Server) -> None:
    strange = {"Host": "scans.example.org", "Origin": "https://lab.example.org"}
    with caller(closed, new_key(closed, "proxied")) as proxied:
        assert proxied.put("/v1/clouds/named", content=CLOUD, headers=strange).is_success
        assert proxied.get("/v1/clouds/named", headers=strange).status_code == 200


def test_two_keys_of_a_tenant_see_the_same(closed: Server) -> None:
    with (
        caller(closed, new_key(closed, "pair")) as one,
        caller(closed, new_key(closed, "pair")) as two,
    ):
        one.put("/v1/clouds/shared", content=CLOUD).raise_for_status()
        assert two.get("/v1/clouds/shared").status_code == 200


def test_the_log_says_whose_request_it_was(closed: Server) -> None:
    key = new_key(closed, "logged")
    with caller(closed, key) as lab:
        lab.get("/v1/formats", headers={"X-Request-ID": "whose-is-it"})
    line = until(lambda: [row for row in closed.log.splitlines() if "whose-is-it" in row])[0]
    assert '"tenant": "logged"' in line
    assert f'"key": "{key.split("_")[1]}"' in line
    assert key.split("_", 2)[2] not in closed.log


def test_no_address_of_others_without_keys(tmp_path: Path) -> None:
    port = free_port()
    done = mpe(tmp_path, "serve", "--host", "0.0.0.0", "--port", str(port))
    assert done.returncode == 2
    assert "mpe keys create" in done.stderr
    assert "MPE_ALLOW_ANONYMOUS_REMOTE=true" in done.stderr
    with socket.socket() as probe:
        assert probe.connect_ex(("127.0.0.1", port))


@pytest.mark.parametrize(
    "settings", [{}, {"allow_anonymous_remote": True}], ids=["a key", "told to"]
)
def test_an_address_of_others_with_a_key_or_when_told_to(
    tmp_path: Path, settings: dict[str, object]
) -> None:
    server = Server(tmp_path / "data", **settings)
    server.data_dir.mkdir()
    if not settings:
        new_key(server, "lab")
    server.start(ready=False, host="0.0.0.0")
    try:
        by_name = {"Host": f"mpe:{server.port}"}  # as other containers call it
        open_to_all = server.client.get("/v1/formats", headers=by_name).status_code == 200
        assert open_to_all == bool(settings)
    finally:
        server.client.close()
        server.stop()
