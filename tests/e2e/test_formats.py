"""Files of every format over HTTP: the right cloud, or a reason."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from service.formats import FORMATS
from service.formats.text_table import MIN_KERNEL_BYTES
from tests.factories.cloud_files import seeds
from tests.factories.scanner_files import DOUBLES, e57, kitti, obj, scanner_seeds
from tests.factories.server import Server


def target() -> bytes:
    """The same cloud, turned by 20 degrees about z, as text."""
    c, s = np.cos(np.radians(20)), np.sin(np.radians(20))
    turned = DOUBLES @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1.0]])
    return "".join(f"{x!r} {y!r} {z!r}\n" for x, y, z in turned.tolist()).encode()


@pytest.mark.parametrize("kind", seeds() | scanner_seeds())
def test_every_kind_is_registered(server: Server, kind: str) -> None:
    content = (seeds() | scanner_seeds())[kind]
    options, reading = {"overlap": 0.9}, {"source": {"surface_samples": 0}}
    answer = server.submit(
        content, target(), wait=60, options=json.dumps(options), reading=json.dumps(reading)
    )
    assert answer.status_code == 200, answer.text
    job = answer.json()
    assert job["status"] == "succeeded"
    assert max(pair[0] for pair in job["result"]["inliers"]["pairs"]) < 40


def test_formats_are_listed(server: Server) -> None:
    items = server.client.get("/v1/formats").json()["items"]
    assert [item["name"] for item in items] == [item.name for item in FORMATS]
    assert [item["name"] for item in items if item["declared"]] == ["kitti"]


def test_a_declared_format_is_taken(server: Server) -> None:
    refused = server.submit(kitti(), target(), wait=60)
    assert refused.status_code in (415, 422)
    reading = json.dumps({"source": {"format": "kitti"}})
    answer = server.submit(kitti(), target(), wait=60, reading=reading)
    assert answer.status_code == 200, answer.text
    assert answer.json()["source"]["reading"] == {"format": "kitti"}


def test_scans_and_samples_are_chosen(server: Server) -> None:
    for content, said, most in (
        (e57(scans=2), {"scan": 1}, 20),
        (obj(), {"surface_samples": 500}, 500),
    ):
        reading = json.dumps({"source": said})
        answer = server.submit(content, target(), wait=60, reading=reading)
        assert answer.status_code == 200, answer.text
        result = answer.json()["result"]
        assert max((pair[0] for pair in result["inliers"]["pairs"]), default=0) < most


def test_large_text_is_read_by_the_kernel(server: Server) -> None:
    rows = np.tile(DOUBLES, (6000, 1)) + np.random.default_rng(0).normal(0, 0.5, (240_000, 3))
    content = "".join(f"{x:.3f} {y:.3f} {z:.3f}\n" for x, y, z in rows.tolist()).encode()
    assert len(content) > MIN_KERNEL_BYTES
    answer = server.submit(content, content, wait=60)
    assert answer.status_code == 200, answer.text
    assert answer.json()["result"]["overlap"] > 0.9


@pytest.mark.parametrize(
    "reading",
    [
        {"source": {"format": "docx"}},
        {"source": {"scan": -1}},
        {"source": {"surface_samples": 10**9}},
        {"source": {"scan": 0}},
        {"source": {"format": "las"}},
        {"middle": {}},
    ],
)
def test_a_wrong_reading_is_refused(server: Server, reading: object) -> None:
    answer = server.submit(obj(), target(), wait=60, reading=json.dumps(reading))
    assert answer.status_code == 422, answer.text
    assert answer.headers["content-type"].startswith("application/problem+json")


@pytest.mark.real_data
def test_every_real_file_decodes(server: Server, data: Path) -> None:
    """Each against itself: the identity, up to the spacing of the points."""
    as_kitti = json.dumps({"source": {"format": "kitti"}, "target": {"format": "kitti"}})
    for path in [*sorted((data / "formats").iterdir()), data / "blade/nasa_blade.stl"]:
        fields = {"reading": as_kitti} if path.suffix == ".bin" else {}
        content = path.read_bytes()
        answer = server.submit(content, content, wait=60, **fields)
        assert answer.status_code == 200, (path, answer.text[:500])
        assert answer.json()["result"]["overlap"] > 0.9, path
