"""`mpe align` writes files beside its answer, and says by its exit code whether to trust it."""

from __future__ import annotations

from pathlib import Path

import pytest

from service.cli import main
from service.formats import read_points, write_ply
from tests.factories.scans import arms


def test_distances_and_report(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    points = arms(1, 2000)
    write_ply(tmp_path / "a.ply", points)
    write_ply(tmp_path / "b.ply", points + 1.0)
    files = [
        str(tmp_path / name)
        for name in ("a.ply", "b.ply", "out.ply", "report.html", "before-after.png")
    ]
    wanted = ["-o", files[2], "--distances", "--report", files[3], "--unit", "mm"]
    code = main(["align", *files[:2], *wanted, "--plot", files[4]])
    printed = capsys.readouterr()
    assert code in (0, 3), printed.err
    assert "scalar_distance" in read_points(tmp_path / "out.ply", attributes=True).attributes
    page = (tmp_path / "report.html").read_text()
    assert "a.ply" in page
    assert " mm" in page
    assert (tmp_path / "before-after.png").read_bytes().startswith(b"\x89PNG")


def test_distances_need_a_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["align", "a.ply", "b.ply", "--distances"]) == 1
    assert "expected -o FILE" in capsys.readouterr().err
