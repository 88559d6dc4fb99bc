"""The report tells everything, and no text of a stranger is taken for markup."""

from __future__ import annotations

import base64
import hashlib
import re
from html.parser import HTMLParser
from typing import Any

import numpy as np
import pytest

from service.report.page import CONTENT_POLICY, STYLE, ReportContent, render_report
from service.report.pose_forms import describe_pose
from service.report.verdict import judge

EVIL = "<script>alert('x')</script>\"'&"
CLOUD = {"sha256": "ab" * 32, "size": 1234, "url": None, "cloud": None, "reading": {}}
R = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])
T = np.eye(4)
T[:3, :3], T[:3, 3] = R, (1, 2, 3)
RESULT: dict[str, Any] = {
    "transform": T.tolist(), "scale": 1.0, "overlap": 0.5, "rmse": 0.01, "confidence": 0.95,
    "accepted": True, "ambiguous": False, "converged": True, "free_directions": [],
    "covariance": (1e-4 * np.eye(6)).tolist(), "warnings": [],
    "inliers": {"count": 10, "ratio": 0.5, "threshold": 0.02},
}  # fmt: skip
DEVIATION: dict[str, Any] = {
    "signed": False, "count": 10, "beyond": 2, "mean": 0.1, "std": 0.2, "rms": 0.3, "minimum": 0.0,
    "maximum": None, "percentiles": [{"percent": 50, "value": 0.1}],
    "shares": [{"tolerance": 0.5, "share": 0.75}], "histogram_edges": [0.0, 0.5, 1.0],
    "histogram_counts": [3, 7],
}  # fmt: skip


def content(**changes: Any) -> ReportContent:
    job = {
        "id": "j1", "labels": {"part": EVIL}, "source": CLOUD | {"cloud": EVIL}, "target": CLOUD,
        "options": {"method": EVIL}, "timing": {"total_s": 1.5, "fetch_s": None},
        "finished_at": "2026-01-05T09:30:00Z",
    }  # fmt: skip
    result = RESULT | {"warnings": [{"code": "file", "message": EVIL}]}
    fields: dict[str, Any] = {
        "job": job, "result": result, "deviation": DEVIATION, "sizes": (7, 8), "unit": EVIL,
        "reach": 0.06, "release": "0.1", "before_after": b"png", "sides": [b"one"] * 4,
    }  # fmt: skip
    return ReportContent(**fields | changes)


class Tags(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))


def test_texts_are_escaped_and_nothing_is_loaded() -> None:
    page = render_report(content())
    parser = Tags()
    parser.feed(page)
    names = {name for name, _ in parser.tags}
    assert not names & {"script", "link", "iframe", "object", "form"}
    assert page.count("&lt;script&gt;") >= 5
    for _, attributes in parser.tags:
        assert not any(name.startswith("on") or name == "style" for name in attributes)
        assert (attributes.get("src") or "data:").startswith("data:")
        assert "href" not in attributes
    assert sum(name == "img" for name, _ in parser.tags) == 5


def test_the_policy_allows_the_style_alone() -> None:
    page = render_report(content())
    (style,) = re.findall(r"<style>(.*?)</style>", page, re.S)
    assert style == STYLE
    digest = base64.b64encode(hashlib.sha256(style.encode()).digest()).decode()
    assert f"style-src 'sha256-{digest}'" in CONTENT_POLICY


def test_what_a_report_tells() -> None:
    page = render_report(content(unit="mm"))
    for text in ("Check it", "Trust it", "ab" * 32, "1,234 bytes", "0.02 mm", "75.00 %", "0.573°"):
        assert (text in page) == (text != "Check it"), text
    assert "units of the file" in render_report(content(unit=None))


def test_names_and_options_are_in_words() -> None:
    job = content().job | {"labels": {"source": "hall.e57"}, "source": CLOUD}
    options = {"overlap": None, "yaw_only": True, "keep_no_data": False, "seed": 0}
    page = render_report(content(job=job | {"options": options}))
    cells = ("hall.e57<br>7 points", "not set</td>", "yes</td>", "no</td>", "0</td>")
    assert [text for text in cells if text not in page] == []
    assert "None" not in page
    assert "uploaded file" in page


def test_pose_forms_are_one_pose() -> None:
    from scipy.spatial.transform import Rotation

    forms = dict(describe_pose(T.tolist()))
    numbers = {name: [float(n) for n in text.split()] for name, text in forms.items()}
    rows, cloud_compare, columns, xyzw, wxyz, angles, vector = numbers.values()
    np.testing.assert_allclose(np.reshape(rows, (4, 4)), T)
    np.testing.assert_allclose(np.reshape(cloud_compare, (4, 4)), T)
    np.testing.assert_allclose(np.reshape(columns, (4, 4)), T.T)
    np.testing.assert_allclose(Rotation.from_quat(xyzw[:4]).as_matrix(), R, atol=1e-9)
    np.testing.assert_allclose(wxyz[:4], np.roll(xyzw[:4], 1))
    turned = Rotation.from_euler("xyz", angles[:3], degrees=True).as_matrix()
    np.testing.assert_allclose(turned, R, atol=1e-9)
    found = Rotation.from_rotvec(np.radians(vector[:3])).as_matrix()
    np.testing.assert_allclose(found, R, atol=1e-9)


def test_a_right_angle_of_pitch_has_angles() -> None:
    from scipy.spatial.transform import Rotation

    upright = np.eye(4)
    upright[:3, :3] = Rotation.from_euler("xyz", [0, 90, 30], degrees=True).as_matrix()
    text = describe_pose(upright.tolist())[5][1]
    angles = [float(n) for n in text.split()][:3]
    again = Rotation.from_euler("xyz", angles, degrees=True).as_matrix()
    np.testing.assert_allclose(again, upright[:3, :3], atol=1e-9)


@pytest.mark.parametrize(
    ("changes", "title"),
    [
        ({}, "Trust it"),
        ({"warnings": [{"code": "rows_zeros", "message": "m"}]}, "Trust it"),
        ({"warnings": [{"code": "layers", "message": "m"}]}, "Check it"),
        ({"confidence": 0.7}, "Check it"),
        ({"ambiguous": True}, "Check it"),
        ({"free_directions": [[0] * 6]}, "Check it"),
        ({"accepted": False, "confidence": 0.2}, "Do not use it"),
    ],
)
def test_verdicts(changes: dict[str, Any], title: str) -> None:
    verdict = judge(RESULT | changes)
    assert verdict.title == title
    assert verdict.reasons
