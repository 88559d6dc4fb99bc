"""The client's types are those of openapi.yaml."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING, fields, is_dataclass
from datetime import datetime
from types import NoneType
from typing import Any, Literal, get_args, get_origin, get_type_hints

import pytest

from mpe_client import models, parameters
from mpe_client.models import Job
from mpe_client.parse import parse
from tests.factories.fake_service import SCHEMAS, job

MODELS = [model for model in vars(models).values() if is_dataclass(model)]
SIMPLE = {str: "string", float: "number", int: "integer", bool: "boolean"}


def has_form(hint: Any, schema: Mapping[str, Any]) -> bool:
    """Whether values of the schema are values of the type."""
    if "$ref" in schema:
        name = schema["$ref"].rsplit("/", 1)[-1]
        return has_form(hint, SCHEMAS[name]) if name not in CLASSES else hint.__name__ == name
    if "anyOf" in schema:
        kinds = [kind for kind in schema["anyOf"] if kind.get("type") != "null"]
        inner = [item for item in get_args(hint) if item is not NoneType]
        return NoneType in get_args(hint) and len(inner) == 1 and has_form(inner[0], kinds[0])
    origin = get_origin(hint)
    if origin is Literal:
        return list(get_args(hint)) == schema["enum"]
    if schema["type"] == "array":
        return origin is list and has_form(get_args(hint)[0], schema["items"])
    if schema["type"] == "object":
        return origin in (dict, Mapping)
    if schema.get("format") == "date-time":
        return hint is datetime
    return SIMPLE.get(hint) == schema["type"]


CLASSES = {model.__name__ for model in MODELS}


@pytest.mark.parametrize("model", MODELS, ids=lambda model: model.__name__)
def test_a_model_has_the_members_of_its_schema(model: Any) -> None:
    schema = SCHEMAS[model.__name__] if model.__name__ != "Event" else EVENT
    hints = get_type_hints(model)
    assert {field.name for field in fields(model)} == schema["properties"].keys()
    for name, member in schema["properties"].items():
        assert has_form(hints[name], member), f"{model.__name__}.{name}: {hints[name]}, {member}"
    optional = {field.name for field in fields(model) if field.default is not MISSING}
    assert optional == schema["properties"].keys() - set(schema["required"])


def event_schema() -> dict[str, Any]:
    """The schema of the data of an event, which the description of a stream cannot hold."""
    from service.schemas import Event

    schema: dict[str, Any] = Event.model_json_schema(mode="serialization")
    return schema


EVENT = event_schema()


@pytest.mark.parametrize(
    ("names", "schema"),
    [
        (parameters.Options.__annotations__, "RegistrationOptions"),
        (parameters.Reading.__annotations__, "Reading"),
        (parameters.Readings.__annotations__, "Readings"),
    ],
)
def test_keywords_are_those_of_the_description(names: dict[str, Any], schema: str) -> None:
    assert names.keys() == SCHEMAS[schema]["properties"].keys()


def test_a_submission_has_all_fields_of_the_form() -> None:
    own = parameters.Submission.__annotations__.keys() - parameters.Options.__annotations__.keys()
    form = SCHEMAS["RegistrationForm"]["properties"].keys() - {"source", "target", "options"}
    assert own - {"idempotency_key"} == form


@pytest.mark.parametrize("name", ["method", "field", "search"])
def test_choices_are_those_of_the_description(name: str) -> None:
    hints = get_type_hints(parameters.Options)
    assert list(get_args(hints[name])) == SCHEMAS["RegistrationOptions"]["properties"][name]["enum"]


def test_members_of_later_releases_are_ignored() -> None:
    parsed = parse(Job, job(invented=1))
    assert parsed.has_ended
    assert parsed.created_at.year == 2026
