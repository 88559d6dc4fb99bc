"""The tables of README.md, from the code that they describe; run it to renew them.

A table stands between `<!-- name -->` and `<!-- end -->`; a test asserts that they are current.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from pydantic import BaseModel
from pydantic_core import PydanticUndefined

from service.formats import FORMATS
from service.schemas import Result
from service.schemas.options import Options
from service.settings import Settings

README = Path(__file__).parent.parent / "README.md"


def renewed(readme: str) -> str:
    """The text with every table made anew."""
    tables = {
        "settings": _table(("variable", "default", "meaning"), _settings()),
        "options": _table(("option", "default", "meaning"), _options()),
        "result": _table(("field of `result`", "meaning"), _fields(Result)),
        "formats": _table(("format", "usual extensions", "what is read"), _formats()),
    }
    for name, table in tables.items():
        readme, found = re.subn(
            f"(<!-- {name} -->\n).*?(<!-- end -->)",
            lambda match, table=table: match[1] + table + match[2],
            readme,
            flags=re.S,
        )
        if found != 1:
            raise ValueError(f"README.md has {found} tables called {name}, expected 1")
    return readme


def _settings() -> Iterator[tuple[str, ...]]:
    for name, field in Settings.model_fields.items():
        yield f"`MPE_{name.upper()}`", _default(field.default), field.description or ""


def _options() -> Iterator[tuple[str, ...]]:
    for name, field in Options.model_fields.items():
        yield f"`{name}`", _default(field.default), field.description or ""


def _formats() -> Iterator[tuple[str, ...]]:
    for item in FORMATS:
        yield f"`{item.name}`", ", ".join(item.extensions), item.title


def _fields(model: type[BaseModel], prefix: str = "") -> Iterator[tuple[str, str]]:
    for name, field in model.model_fields.items():
        kind = field.annotation
        if isinstance(kind, type) and issubclass(kind, BaseModel):
            yield from _fields(kind, f"{prefix}{name}.")
        else:
            yield f"`{prefix}{name}`", field.description or ""


def _default(value: Any) -> str:
    if value is PydanticUndefined or value == ():
        return ""
    return f"`{value}`" if value is not None else "none"


def _table(head: tuple[str, ...], rows: Iterator[tuple[str, ...]]) -> str:
    lines = [head, ("---",) * len(head), *rows]
    return "".join(
        f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in row)} |\n" for row in lines
    )


if __name__ == "__main__":
    README.write_text(renewed(README.read_text()))
