"""Bash completes commands and options."""

from __future__ import annotations

import subprocess

import pytest

from service.cli.commands import _parser
from service.cli.completion import render_completion


def complete(*words: str) -> list[str]:
    script = render_completion(_parser(), "bash")
    typed = f"COMP_WORDS=({' '.join(words)}); COMP_CWORD={len(words) - 1}; _mpe"
    done = subprocess.run(
        ["bash", "-c", f'{script}\n{typed}; echo "${{COMPREPLY[@]}}"'],
        capture_output=True,
        text=True,
        check=True,
        timeout=30,
    )
    return done.stdout.split()


@pytest.mark.parametrize(
    ("words", "found"),
    [
        (["mpe", "sub"], ["submit"]),
        (["mpe", "download", "--dis"], ["--distances"]),
        (["mpe", "align", "a.ply", "--source-g"], ["--source-gravity"]),
        (["mpe", "nonsense", "--x"], []),
    ],
)
def test_words_are_completed(words: list[str], found: list[str]) -> None:
    assert complete(*words) == found


def test_zsh_uses_the_same() -> None:
    bash, zsh = (render_completion(_parser(), shell) for shell in ("bash", "zsh"))
    assert zsh.endswith(bash)
    assert "bashcompinit" in zsh
