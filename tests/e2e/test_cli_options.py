"""What a caller knows, as arguments of `mpe align`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mpe_core.geometry.rigid import inverse
from service.cli import main
from service.cli.exit_codes import EXIT_NOT_ACCEPTED, EXIT_OK
from service.formats import write_ply
from tests.e2e.test_options import SHIFT, doubled, start, turned_room
from tests.factories.checks import assert_pose_close


def aligned(capsys: pytest.CaptureFixture[str], *words: object) -> dict[str, Any]:
    """What `mpe align --json` gives."""
    code = main(["align", *map(str, words), "--json"])
    assert code in (EXIT_OK, EXIT_NOT_ACCEPTED), capsys.readouterr().err
    found: dict[str, Any] = json.loads(capsys.readouterr().out)
    return found


def test_what_is_known_as_arguments(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    source, target, away = turned_room(1)
    files = tmp_path / "source.ply", tmp_path / "target.ply"
    for file, cloud in zip(files, (source, target), strict=True):
        write_ply(file, cloud)
    near = start(away)["initial_transform"]
    (tmp_path / "pose.txt").write_text("\n".join(" ".join(map(str, row)) for row in near))
    (tmp_path / "pose.json").write_text(json.dumps({"transform": near}))
    down = ["1e-9", "-1e-9", "-2"]
    for words in (
        ["--source-gravity", *down, "--target-gravity", 0, 0, -1],
        ["--yaw-only"],
        ["--initial-transform", tmp_path / "pose.txt"],
        ["--initial-transform", tmp_path / "pose.json"],
    ):
        found = aligned(capsys, *files, *words)
        assert not found["ambiguous"], words
        T = np.array(found["transform"])
        assert_pose_close(T, inverse(away), source, degrees=0.5, shift=0.01)


@pytest.mark.parametrize("words", [(), ("--search", "sparse")], ids=["default", "sparse"])
def test_weights_as_arguments(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, words: tuple[str, ...]
) -> None:
    doubled(tmp_path)
    files = tmp_path / "source.ply", tmp_path / "target.ply"
    found = aligned(capsys, *files, "--source-weights", "second", *words)
    np.testing.assert_allclose(np.array(found["transform"])[:3, 3], -SHIFT, atol=0.004)


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--initial-transform", "FOLDER/source.ply"], "source.ply: expected three or four lines"),
        (["--initial-transform", "FOLDER/none.txt"], "none.txt: No such file"),
        (["--initial-transform", "FOLDER/three.txt"], "initial_transform must be 4x4"),
        (["--source-gravity", "0", "0", "-1"], "target_gravity: give both"),
        (["--source-weights", "mass"], "no attribute 'mass'"),
    ],
)
def test_mistakes_in_arguments_are_told(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, words: list[str], told: str
) -> None:
    doubled(tmp_path)
    (tmp_path / "three.txt").write_text("1 0 0\n0 1 0\n0 0 1\n")
    words = [word.replace("FOLDER", str(tmp_path)) for word in words]
    files = [str(tmp_path / "source.ply"), str(tmp_path / "target.ply")]
    assert main(["align", *files, *words]) == 1
    assert told in capsys.readouterr().err
