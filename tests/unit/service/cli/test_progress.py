"""Stages are lines where no terminal is."""

from __future__ import annotations

import pytest

from service.cli.progress import show_progress


def test_each_stage_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    with show_progress() as show:
        for stage, fraction in (("search", 0.1), ("search", 0.2), ("refine", 0.5)):
            show(stage, fraction)
    printed = capsys.readouterr()
    assert printed.err.splitlines() == ["mpe: search (10%)", "mpe: refine (50%)"]
    assert printed.out == ""


def test_a_terminal_gets_a_bar(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    with show_progress() as show:
        show("search", 0.5)
    assert "mpe:" not in capsys.readouterr().err
