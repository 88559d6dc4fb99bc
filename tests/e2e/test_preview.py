"""Previews of the clouds of a registration, over HTTP."""

from __future__ import annotations

import httpx
import numpy as np

from service.clouds.preview import HAS_COLORS, HAS_DISTANCES, HEADER
from tests.factories.cloud_files import POINTS, ply
from tests.factories.scanner_files import obj
from tests.factories.scans import arms, as_npy
from tests.factories.server import Server, registered


def test_both_clouds_thinned_and_the_source_with_its_distances(server: Server) -> None:
    cloud = arms(1)
    job = registered(server.client, as_npy(cloud), as_npy(cloud + 5))
    place = f"/v1/registrations/{job['id']}/preview"

    def fetch(query: str, **headers: str) -> httpx.Response:
        return server.client.get(f"{place}?{query}", headers=headers)

    source, target = fetch("role=source"), fetch("role=target&max_points=10")
    _, _, flags, count, total, *_ = HEADER.unpack_from(source.content)
    assert (flags, count, total) == (HAS_DISTANCES, len(cloud), len(cloud))
    assert len(source.content) == HEADER.size + 16 * count
    assert np.frombuffer(source.content[-4 * count :], "<f4").max() < 1e-3
    _, _, flags, count, total, *_ = HEADER.unpack_from(target.content)
    assert (flags, count, total, len(target.content)) == (0, 10, len(cloud), HEADER.size + 120)
    known = fetch("role=source", **{"If-None-Match": source.headers["ETag"]})
    assert (known.status_code, known.content) == (304, b"")
    assert fetch("role=target", **{"If-None-Match": source.headers["ETag"]}).status_code == 200
    for wrong in ("", "role=both", "role=source&max_points=0", "role=source&max_points=200001"):
        assert fetch(wrong).status_code == 422
    listed = server.client.get("/v1/registrations?limit=1").json()["items"][0]
    assert listed["confidence"] == job["result"]["confidence"]


def test_a_mesh_is_drawn_by_samples_of_its_surface(server: Server) -> None:
    job = registered(server.client, obj(), obj(), reading='{"source": {"surface_samples": 500}}')
    answer = server.client.get(f"/v1/registrations/{job['id']}/preview?role=source")
    assert answer.status_code == 200, answer.text
    assert HEADER.unpack_from(answer.content)[3] == 500


def test_colours_of_the_file(server: Server) -> None:
    job = registered(server.client, ply(), ply())
    answer = server.client.get(f"/v1/registrations/{job['id']}/preview?role=target")
    assert HEADER.unpack_from(answer.content)[2] & HAS_COLORS == 0  # red alone is no colour
    assert HEADER.unpack_from(answer.content)[3] == len(POINTS)


def test_what_has_no_preview(server: Server) -> None:
    assert server.client.get("/v1/registrations/none/preview?role=source").status_code == 404
    failed = server.submit(b"0 0 0\n1 1 1\n", ply(), wait=60).json()["job"]
    answer = server.client.get(f"/v1/registrations/{failed}/preview?role=source")
    assert (answer.status_code, answer.json()["type"]) == (409, "urn:mpe:problem:result-not-ready")
