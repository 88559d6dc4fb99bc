"""The life of a registration over HTTP."""

from __future__ import annotations

import io
from concurrent.futures import ThreadPoolExecutor
from datetime import datetime

import httpx
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.factories.clouds import knot
from tests.factories.scans import arms, as_npy, motion, moved, pose_error
from tests.factories.server import CALL_S, Server, finished, submit
from tests.factories.slow import SLOW, slow_pair
from tests.factories.waiting import until


def test_accepted_then_finished(server: Server) -> None:
    target = knot(30_000, np.random.default_rng(3))
    response = server.submit(as_npy(target), as_npy(target))
    assert response.status_code == 202
    accepted = response.json()
    assert response.headers["Location"] == f"/v1/registrations/{accepted['id']}"
    assert int(response.headers["Retry-After"]) > 0
    assert accepted["status"] in ("queued", "running")
    assert accepted["result"] is None
    job = finished(server.client, accepted["id"])
    assert job["status"] == "succeeded"
    assert job["error"] is None
    assert job["attempt"] == 1
    assert job["progress"] == {"stage": "finished", "fraction": 1.0, "needs_label": None}
    times = [
        datetime.fromisoformat(job[f"{event}_at"]) for event in ("created", "started", "finished")
    ]
    assert times == sorted(times)
    stages = [job["timing"][f"{name}_s"] for name in ("queued", "decode", "prepare", "refine")]
    assert all(seconds >= 0 for seconds in stages)
    assert sum(stages) <= job["timing"]["total_s"]


def test_result_says_the_same_pose_in_every_form(server: Server) -> None:
    target = arms(4)
    truth = motion(np.random.default_rng(4), target, 20, 0.5)
    source = moved(np.linalg.inv(truth), target)
    response = server.submit(as_npy(source), as_npy(target), wait=60)
    assert response.status_code == 200
    assert response.headers["Preference-Applied"] == "wait=60"
    result = response.json()["result"]
    transform = np.array(result["transform"])
    degrees, shift = pose_error(transform, truth, source)
    assert degrees < 0.1
    assert shift < 0.02
    assert transform[3].tolist() == [0, 0, 0, 1]
    rotation = Rotation.from_quat(result["rotation"]["quaternion_xyzw"])
    np.testing.assert_allclose(rotation.as_matrix(), transform[:3, :3], atol=1e-12)
    assert result["rotation"]["angle_deg"] == pytest.approx(np.degrees(rotation.magnitude()))
    assert result["translation"] == transform[:3, 3].tolist()


def test_inliers_in_both_forms(server: Server) -> None:
    cloud = arms(5)
    job = server.submit(as_npy(cloud), as_npy(cloud), wait=60).json()
    summary = job["result"]["inliers"]
    url = f"/v1/registrations/{job['id']}/inliers"
    listed = server.client.get(url).json()
    assert listed["count"] == summary["count"] == len(listed["pairs"]) == len(listed["distances"])
    assert listed["pairs"] == summary["pairs"]
    assert listed["threshold"] == summary["threshold"]
    assert max(listed["distances"]) <= summary["threshold"]
    for response in (
        server.client.get(url, params={"format": "npy"}),
        server.client.get(url, headers={"Accept": "application/x-npy"}),
    ):
        assert response.headers["Content-Type"] == "application/x-npy"
        array = np.load(io.BytesIO(response.content), allow_pickle=False)
        assert np.column_stack((array["source"], array["target"])).tolist() == listed["pairs"]
        assert array["distance"].tolist() == listed["distances"]
    refused = server.client.get(url, headers={"Accept": "image/png"})
    assert refused.status_code == 406


def test_a_wait_that_is_too_short_loses_nothing(server: Server) -> None:
    response = server.submit(*slow_pair(), wait=1, options=SLOW)
    assert response.status_code == 202
    url = response.headers["Location"]
    until(lambda: server.client.get(url).json()["status"] == "running")
    assert "Retry-After" in server.client.get(url).headers
    pending = server.client.get(f"{url}/inliers")
    assert pending.status_code == 409
    assert server.client.delete(url).json()["status"] == "cancelled"


def test_delete_cancels_then_removes(server: Server) -> None:
    job = server.submit(*slow_pair(), options=SLOW).json()
    url = f"/v1/registrations/{job['id']}"
    cancelled = server.client.delete(url)
    assert cancelled.status_code == 200
    assert cancelled.json()["status"] == "cancelled"
    assert server.client.get(url).json()["status"] == "cancelled"
    assert server.client.delete(url).status_code == 204
    assert server.client.get(url).status_code == 404
    assert server.client.delete(url).status_code == 404


def test_list_pages_newest_first(server: Server) -> None:
    cloud = as_npy(arms(6))
    created = [server.submit(cloud, cloud, wait=60).json()["id"] for _ in range(5)]
    listed, cursor = [], None
    while len(listed) < len(created):
        parameters = {"limit": 2} | ({"cursor": cursor} if cursor else {})
        page = server.client.get("/v1/registrations", params=parameters).json()
        assert len(page["items"]) <= 2
        assert all("result" not in item for item in page["items"])
        listed += [item["id"] for item in page["items"]]
        cursor = page["next_cursor"]
    assert listed[: len(created)] == created[::-1]
    wrong = server.client.get("/v1/registrations", params={"cursor": "zzz"})
    assert wrong.status_code == 422


def test_eight_clients_at_once(server: Server) -> None:
    """Each gets the pose of its own pair back."""

    def one(seed: int) -> tuple[float, float]:
        target = arms(seed)
        truth = motion(np.random.default_rng(seed), target, 25, 0.3)
        source = moved(np.linalg.inv(truth), target)
        with httpx.Client(base_url=server.url, timeout=CALL_S, trust_env=False) as client:
            job = finished(client, submit(client, as_npy(source), as_npy(target)).json()["id"])
        return pose_error(np.array(job["result"]["transform"]), truth, source)

    with ThreadPoolExecutor(8) as clients:
        errors = list(clients.map(one, range(100, 124)))
    assert max(degrees for degrees, _ in errors) < 0.1
    assert max(shift for _, shift in errors) < 0.02


def test_health(server: Server) -> None:
    assert server.client.get("/livez").json() == {"status": "ok"}
    assert server.client.get("/readyz").json() == {"status": "ok", "warnings": []}


def test_served_description_is_the_committed_one(server: Server) -> None:
    import yaml

    from tests.factories.server import PROJECT

    committed = yaml.safe_load((PROJECT / "openapi.yaml").read_text())
    assert server.client.get("/openapi.json").json() == committed, "run `make openapi`"
