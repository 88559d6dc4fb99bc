"""What a system lacks of the sandbox is told, and refused where the sandbox is required."""

from __future__ import annotations

import logging
from pathlib import Path

import pytest

from service.workers.sandbox import confinement as module
from service.workers.sandbox.confinement import (
    SandboxError,
    check_sandbox,
    confine,
    describe_sandbox,
    library_paths,
    missing_parts,
)


def lack(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make this system one without Landlock and seccomp."""
    monkeypatch.setattr(module, "landlock_abi", lambda: 0)
    monkeypatch.setattr(module, "has_seccomp", lambda: False)
    monkeypatch.setattr(module, "restrict_files", lambda readable, writable: False)
    monkeypatch.setattr(module, "filter_system_calls", lambda *, network: False)


def test_what_is_missing_is_logged(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    lack(monkeypatch)
    with caplog.at_level(logging.WARNING):
        check_sandbox(is_required=False)
    assert ["Landlock" in caplog.text, "seccomp" in caplog.text] == [True, True]
    assert len(missing_parts()) == 2
    assert describe_sandbox().count("missing") == 2


def test_a_required_sandbox_refuses_to_start_without_its_parts(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    lack(monkeypatch)
    with pytest.raises(SandboxError, match="MPE_REQUIRE_SANDBOX"):
        check_sandbox(is_required=True)


def test_a_child_runs_unconfined_only_where_that_is_allowed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    lack(monkeypatch)
    confine([], [], network=False, is_required=False)
    with pytest.raises(SandboxError):
        confine([], [], network=False, is_required=True)


def test_the_working_directory_is_no_library() -> None:
    paths = library_paths()
    assert Path(module.__file__).parents[2] in paths
    assert Path.cwd() not in paths
    assert all(path.is_absolute() for path in paths)
