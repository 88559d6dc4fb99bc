"""The pre-commit hooks run what `make check` runs."""

from __future__ import annotations

import re
from pathlib import Path

import yaml

PROJECT = Path(__file__).parent.parent.parent


def test_hooks_are_the_commands_of_make_check() -> None:
    makefile = (PROJECT / "Makefile").read_text().replace("$(PY)", ".venv/bin/python")
    recipe = re.search(r"^check:.*\n((?:\t.*\n)+)", makefile, re.M)
    assert recipe is not None
    config = yaml.safe_load((PROJECT / ".pre-commit-config.yaml").read_text())
    hooks = [hook["entry"] for repository in config["repos"] for hook in repository["hooks"]]
    assert hooks == [line.strip() for line in recipe[1].splitlines()]


def test_hooks_download_nothing() -> None:
    config = yaml.safe_load((PROJECT / ".pre-commit-config.yaml").read_text())
    for repository in config["repos"]:
        assert repository["repo"] == "local"
        assert all(hook["language"] == "system" for hook in repository["hooks"])
