"""Distances of the moved source from its target, over HTTP."""

from __future__ import annotations

import io
import json

import numpy as np
import pytest

from tests.factories.scans import arms, as_npy
from tests.factories.server import Server, registered

CLOUD = arms(1, 5000)
RAISED = CLOUD + np.array([0.0, 0.0, 50.0])  # a shift that the pose takes away


@pytest.fixture(scope="module")
def job_id(server: Server) -> str:
    options = {"source_viewpoint": [0, 0, 50], "target_viewpoint": [0, 0, 100], "seed": 11}
    job = registered(server.client, as_npy(CLOUD), as_npy(RAISED), options=json.dumps(options))
    return str(job["id"])


def test_statistics(server: Server, job_id: str) -> None:
    place = f"/v1/registrations/{job_id}/deviation"
    answer = server.client.get(place, params={"tolerance": [1e-9, 0.01], "max_distance": 1})
    found = answer.json()
    assert (found["signed"], found["count"], found["beyond"]) == (True, len(CLOUD), 0)
    assert abs(found["mean"]) < 0.01
    assert [item["tolerance"] for item in found["shares"]] == [1e-9, 0.01]
    assert found["shares"][1]["share"] == 1.0
    assert len(found["histogram_edges"]) == len(found["histogram_counts"]) + 1
    known = server.client.get(
        place,
        params={"tolerance": [1e-9, 0.01], "max_distance": 1},
        headers={"If-None-Match": answer.headers["ETag"]},
    )
    assert known.status_code == 304
    for wrong in (
        "tolerance=-1",
        "tolerance=nan",
        "max_distance=0",
        "&".join(["tolerance=1"] * 17),
    ):
        assert server.client.get(f"{place}?{wrong}").status_code == 422
    assert server.client.get("/v1/registrations/none/deviation").status_code == 404


def test_a_scalar_field_in_the_aligned_file(server: Server, job_id: str) -> None:
    place = f"/v1/registrations/{job_id}/aligned"
    answer = server.client.get(place, params={"distances": True})
    assert b"property float scalar_distance\n" in answer.content[:1000]
    text = server.client.get(place, params={"distances": True, "format": "csv"}).text
    assert text.splitlines()[0].endswith(",distance")
    las = server.client.get(place, params={"distances": True, "format": "las"})
    assert las.headers["ETag"] != server.client.get(place, params={"format": "las"}).headers["ETag"]
    values = np.genfromtxt(io.StringIO(text), delimiter=",", names=True)["distance"]
    assert np.abs(values).max() < 0.01
    assert (values < 0).any()
