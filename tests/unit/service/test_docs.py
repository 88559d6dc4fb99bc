"""docs/service.md says what the code does."""

from __future__ import annotations

import service.outbound.errors  # noqa: F401 - defines problem types
from service.problems import all_problem_types
from service.settings import Settings
from tests.factories.server import PROJECT

TEXT = (PROJECT / "docs" / "service.md").read_text()


def test_every_problem_is_listed() -> None:
    for kind in all_problem_types():
        assert f"| `{kind.slug}` | {kind.status} | {kind.title} |" in TEXT


def test_every_setting_that_it_names_exists() -> None:
    known = {f"MPE_{name.upper()}" for name in Settings.model_fields}
    named = {word.strip("`,.;:()=") for word in TEXT.split() if "MPE_" in word}
    assert {name.partition("=")[0] for name in named} <= known
