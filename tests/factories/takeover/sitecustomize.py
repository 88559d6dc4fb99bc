"""A decoder with a flaw: it executes what a file says that begins with MAGIC.

Python imports this module at its start where its folder is on PYTHONPATH. What the code leaves in
`found` is raised as the reason why the file cannot be read, so that the caller sees it.
"""

from __future__ import annotations

import importlib.util
import json
import sys
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import ModuleType
from typing import Any

FLAWED = "service.formats.read"
MAGIC = b"ply\ncomment takeover\n"


class FlawFinder(MetaPathFinder):
    """Puts the flaw into the module when it is imported."""

    def find_spec(self, name: str, path: object, target: object = None) -> ModuleSpec | None:
        if name != FLAWED:
            return None
        sys.meta_path.remove(self)
        spec = importlib.util.find_spec(name)
        assert spec is not None
        assert spec.loader is not None
        execute = spec.loader.exec_module

        def execute_flawed(module: ModuleType) -> None:
            execute(module)
            module.read_points = with_flaw(module.read_points, module.CloudFileError)

        spec.loader.exec_module = execute_flawed  # type: ignore[method-assign]
        return spec


def with_flaw(read_points: Any, error: type[Exception]) -> Any:
    def read_or_execute(path: Path, *limits: Any, **choices: Any) -> Any:
        content = Path(path).read_bytes()
        if not content.startswith(MAGIC):
            return read_points(path, *limits, **choices)
        names: dict[str, Any] = {"found": {}}
        exec(content.removeprefix(MAGIC).decode(), names)
        raise error(json.dumps(names["found"]))

    return read_or_execute


sys.meta_path.insert(0, FlawFinder())
