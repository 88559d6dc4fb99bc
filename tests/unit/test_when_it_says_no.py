"""The page on warnings has an entry a code, and its examples give the warnings."""

from __future__ import annotations

import ast
import copy
import pickle
import re
from pathlib import Path

import pytest

from mpe_core import CodedWarning, Registration
from mpe_core.result import WARNING_CODES
from service.formats import DecodedCloud
from tests.factories.server import PROJECT

PAGE = (PROJECT / "docs" / "when-it-says-no.md").read_text()
SETUP = re.search(r"```python setup\n(.*?)```", PAGE, re.DOTALL)
ENTRIES = dict(re.findall(r"^## (\w+)\n(.*?)(?=^## |\Z)", PAGE, re.DOTALL | re.MULTILINE))
EXAMPLES = {
    code: found[1]
    for code, text in ENTRIES.items()
    if (found := re.search(r"```python\n(.*?)```", text, re.DOTALL))
}


def test_there_is_an_entry_for_each_code() -> None:
    assert tuple(ENTRIES) == WARNING_CODES
    assert tuple(EXAMPLES) == WARNING_CODES, "each entry has an example"


@pytest.mark.slow
@pytest.mark.parametrize("code", EXAMPLES)
def test_the_example_gives_the_warning(
    code: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert SETUP is not None
    names: dict[str, object] = {}
    exec(SETUP[1], names)
    *lines, last = ast.parse(EXAMPLES[code]).body
    assert isinstance(last, ast.Expr)
    exec(compile(ast.Module(lines, []), code, "exec"), names)
    found: Registration | DecodedCloud = eval(
        compile(ast.Expression(last.value), code, "eval"), names
    )
    assert code in [getattr(warning, "code", "file") for warning in found.warnings]


def test_a_warning_is_a_string_that_can_be_copied() -> None:
    warning = CodedWarning("ambiguous", "2 other poses")
    assert warning == "2 other poses"
    for other in (copy.deepcopy(warning), pickle.loads(pickle.dumps(warning))):
        assert (other, other.code) == (warning, "ambiguous")
