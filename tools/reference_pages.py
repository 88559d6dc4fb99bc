"""Write docs/reference from the code: API, settings, options, result fields, problems, formats.

A test asserts that the pages are current.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from pydantic import BaseModel
from pydantic_core import PydanticUndefined

from service.app import create_app
from service.formats import FORMATS, WRITERS
from service.problems import all_problem_types
from service.schemas import Result, describe_options
from service.settings import Settings, setting_variables
from tools.api_page import render_api_page

REFERENCE = Path(__file__).parent.parent / "docs" / "reference"
NOTICE = "<!-- Written by `python -m tools.reference_pages`; edit the code instead. -->\n"

SETTINGS_TEXT = """\
Environment variables of the service, checked at the start.
"""
OPTIONS_TEXT = """\
Options of a registration, the same over HTTP (`options`), in the library (`RegistrationOptions`)
and in `mpe align` (`--name-with-hyphens`). Lengths are in the unit of the input.
"""
RESULT_TEXT = """\
Fields of `result` in a registration that has succeeded. Lengths are in the unit of the files.
"""
PROBLEMS_TEXT = """\
Every error is `application/problem+json` (RFC 9457). `type` is `urn:mpe:problem:` and one of these
names. Other statuses of HTTP itself (404, 405, ...) are named by their phrase: `not-found`.
"""
FORMATS_TEXT = """\
The content of a file decides its format, not its name. `GET /v1/formats` lists the same. What is
kept beside the coordinates goes into aligned files; a warning names what is not.
"""
WRITERS_TEXT = """
## Written

`mpe align -o FILE` and `GET .../aligned?format=` write these. Columns of text and
arrays without names are called `column_4` and so on, by their places. Normals, velocities, and the
axes and harmonics of Gaussian splats are turned. What a format cannot hold is named in a warning:
on standard error, or in the header `X-Warnings` (a JSON array). An attribute called x, y or z is
called `attribute_x`, `attribute_y` or `attribute_z`.

"""


def render_pages() -> dict[str, str]:
    """Return the text of each page by its file name."""
    return {
        "api.md": f"{NOTICE}\n{render_api_page(create_app(Settings()).openapi())}",
        "settings.md": _page(
            "Settings", SETTINGS_TEXT, ("variable", "default", "meaning"), _settings()
        ),
        "options.md": _page("Options", OPTIONS_TEXT, ("option", "default", "meaning"), _options()),
        "result.md": _page("Result", RESULT_TEXT, ("field", "meaning"), _result_fields(Result)),
        "problems.md": _page("Problems", PROBLEMS_TEXT, ("name", "status", "meaning"), _problems()),
        "formats.md": _page(
            "Formats",
            FORMATS_TEXT,
            ("format", "usual extensions", "what is read", "what is kept"),
            _formats(),
        )
        + WRITERS_TEXT
        + _table(("format", "what is kept beside the coordinates"), _writers()),
    }


def _settings() -> Iterator[tuple[str, ...]]:
    for name, field in setting_variables():
        meaning = " ".join((field.description or "").split())
        yield f"`{name}`", _default(field.default), meaning


def _options() -> Iterator[tuple[str, ...]]:
    for name, schema in describe_options().items():
        yield f"`{name}`", _default(schema["default"]), schema["description"]


def _result_fields(model: type[BaseModel], prefix: str = "") -> Iterator[tuple[str, ...]]:
    for name, field in model.model_fields.items():
        kind = field.annotation
        if isinstance(kind, type) and issubclass(kind, BaseModel):
            yield from _result_fields(kind, f"{prefix}{name}.")
        else:
            yield f"`{prefix}{name}`", field.description or ""


def _problems() -> Iterator[tuple[str, ...]]:
    for kind in sorted(all_problem_types(), key=lambda kind: (kind.status, kind.slug)):
        yield f"`{kind.slug}`", str(kind.status), kind.title


def _formats() -> Iterator[tuple[str, ...]]:
    for item in FORMATS:
        yield f"`{item.name}`", ", ".join(item.extensions), item.title, item.kept


def _writers() -> Iterator[tuple[str, ...]]:
    for name, item in WRITERS.items():
        yield f"`{name}`", item.kept


def _default(value: Any) -> str:
    if value is PydanticUndefined or value == ():
        return ""
    return f"`{value}`" if value is not None else "none"


def _page(title: str, text: str, head: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    return f"{NOTICE}\n# {title}\n\n{text}\n{_table(head, rows)}"


def _table(head: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    cells = [head, ("---",) * len(head), *rows]
    return "".join(f"| {' | '.join(_escape(cell) for cell in row)} |\n" for row in cells)


def _escape(cell: str) -> str:
    return cell.replace("|", "\\|")


if __name__ == "__main__":
    for file_name, page in render_pages().items():
        (REFERENCE / file_name).write_text(page)
