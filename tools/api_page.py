"""The API reference as one page, written from the OpenAPI description."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

Schema = dict[str, Any]

TEXT = """\
Every call, its parameters, bodies and answers. `openapi.yaml` in the project and `/openapi.json` of
a running service say the same for programs. Where keys are in force a call carries the header
`Authorization: Bearer KEY`. What goes wrong is a [problem document](#problem);
[problems](problems.md) lists their types.
"""
_BOUNDS = {
    "minimum": "at least", "maximum": "at most", "exclusiveMinimum": "more than",
    "exclusiveMaximum": "less than", "minLength": "at least this many characters:",
    "maxLength": "at most this many characters:", "minItems": "at least this many:",
    "maxItems": "at most this many:",
}  # fmt: skip


def render_api_page(description: Schema) -> str:
    """Return the Markdown text of the page without its notice."""
    parts = ["# API reference", TEXT.rstrip(), description["info"]["description"]]
    tag = None
    for path, operations in description["paths"].items():
        for method, operation in operations.items():
            if operation["tags"][0] != tag:
                tag = operation["tags"][0]
                parts.append(f"## {tag.capitalize()}")
            parts += _describe_operation(method, path, operation)
    parts.append("## Documents")
    for name, schema in description["components"]["schemas"].items():
        parts += _describe_document(name, schema)
    return "\n\n".join(parts) + "\n"


def _describe_operation(method: str, path: str, operation: Schema) -> Iterator[str]:
    yield f"### {operation['summary'].rstrip('?')}"
    yield f"`{method.upper()} {path}`"
    if text := operation.get("description"):
        yield text.strip()
    if parameters := operation.get("parameters"):
        rows = (
            (f"`{each['name']}`", each["in"], _name_type(each["schema"]), _meaning(each))
            for each in parameters
        )
        yield _table(("parameter", "in", "type", "meaning"), rows)
    for kind, content in operation.get("requestBody", {}).get("content", {}).items():
        yield f"Body `{kind}`: {_name_type(content['schema'])}."
    yield _table(("answer", "content", "meaning"), _list_answers(operation["responses"]))


def _list_answers(responses: Schema) -> Iterator[tuple[str, ...]]:
    for status, answer in responses.items():
        content = "; ".join(
            f"`{kind}`: {_name_type(each['schema'])}" if "schema" in each else f"`{kind}`"
            for kind, each in answer.get("content", {}).items()
        )
        meaning = _plain(answer["description"]).replace("Successful Response", "Done.")
        yield ("other" if status == "default" else status), content, meaning


def _describe_document(name: str, schema: Schema) -> Iterator[str]:
    yield f"### {name}"
    if text := schema.get("description"):
        yield text.strip()
    required = schema.get("required", ())
    rows = (
        (
            f"`{field}`{' *' if field in required else ''}",
            _name_type(each),
            _meaning({"schema": each}),
        )
        for field, each in schema.get("properties", {}).items()
    )
    yield _table(("field", "type", "meaning"), rows)
    if required:
        yield "\\* always there."


def _meaning(item: Schema) -> str:
    """Return the description with bounds and default."""
    schema = item["schema"]
    parts = [_plain(item.get("description") or schema.get("description") or "")]
    for each in (schema, *schema.get("anyOf", ())):
        parts += [f"{text} {each[key]}." for key, text in _BOUNDS.items() if key in each]
    if schema.get("default") is not None:
        parts.append(f"Default: `{schema['default']}`.")
    return " ".join(
        part[0].upper() + part[1:] if n else part for n, part in enumerate(parts)
    ).strip()


def _name_type(schema: Schema) -> str:
    """Return the type in words; documents are links."""
    if "$ref" in schema:
        name = schema["$ref"].rpartition("/")[2]
        return f"[{name}](#{name.lower()})"
    if "const" in schema:
        return f"`{schema['const']}`"
    if "enum" in schema:
        return " or ".join(f"`{value}`" for value in schema["enum"])
    for key in ("anyOf", "oneOf", "allOf"):
        if key in schema:
            return " or ".join(dict.fromkeys(_name_type(each) for each in schema[key]))
    if schema.get("type") == "array":
        return f"list of {_name_type(schema.get('items', {}))}"
    return str(schema.get("format") or schema.get("type") or "anything")


def _plain(text: str) -> str:
    return " ".join(text.split())


def _table(head: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    cells = [head, ("---",) * len(head), *rows]
    lines = (" | ".join(cell.replace("|", "\\|") for cell in row) for row in cells)
    return "\n".join(f"| {line} |" for line in lines)
