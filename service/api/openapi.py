"""The OpenAPI description of the app."""

from __future__ import annotations

from importlib.metadata import version
from typing import Any

from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi
from pydantic import BaseModel
from pydantic.json_schema import models_json_schema

from service.schemas import Problem, RegistrationParameters, RegistrationRequest

DESCRIPTION = """Rigid registration of 3-D point clouds from any starting pose.

Lengths are in the unit of the input, whatever it is; angles in degrees; times in seconds.
Every error is a problem document (RFC 9457)."""
REFERENCE = "#/components/schemas/{model}"
BODY_MODELS: tuple[type[BaseModel], ...] = (RegistrationRequest, RegistrationParameters, Problem)


def describe(app: FastAPI) -> None:
    """Let the app describe itself, and serve that at /openapi.json."""

    def openapi() -> dict[str, Any]:
        if app.openapi_schema is None:
            app.openapi_schema = _description(app)
        return app.openapi_schema

    app.openapi = openapi  # type: ignore[method-assign]
    app.add_api_route("/openapi.json", openapi, include_in_schema=False)


def _description(app: FastAPI) -> dict[str, Any]:
    schema = get_openapi(
        title="Registration of point clouds",
        version=version("mpe"),
        description=DESCRIPTION,
        license_info={"name": "Apache-2.0", "identifier": "Apache-2.0"},
        routes=app.routes,
    )
    _, bodies = models_json_schema(
        [(model, "validation") for model in BODY_MODELS], ref_template=REFERENCE
    )
    components = schema["components"]["schemas"] | bodies["$defs"]
    components["RegistrationForm"] = _form(components["RegistrationParameters"])
    for unused in ("HTTPValidationError", "ValidationError", "RegistrationParameters"):
        components.pop(unused, None)
    schema["components"]["schemas"] = dict(sorted(components.items()))
    for operations in schema["paths"].values():
        for operation in operations.values():
            operation["responses"].pop("422", None)
            operation["responses"]["default"] = _problem_response()
            if "security" in operation:
                operation["security"].append({})  # a service without keys asks for none
    return schema


def _form(parameters: dict[str, Any]) -> dict[str, Any]:
    """The multipart form: two files, and the parameters as JSON."""
    cloud = {"type": "string", "format": "binary"}
    fields = parameters["properties"]
    text, null = fields["callback_url"].pop("anyOf")  # no text says null: it is left out
    assert null == {"type": "null"}  # noqa: S101
    fields["callback_url"] |= text
    return {
        "type": "object",
        "title": "RegistrationForm",
        "description": "A registration of two uploaded files; other fields are JSON, but "
        "callback_url, which is plain text.",
        "required": ["source", "target"],
        "additionalProperties": False,
        "properties": {
            "source": cloud | {"description": "The cloud that is moved: the file."},
            "target": cloud | {"description": "The cloud that stays: the file."},
            **fields,
        },
    }


def _problem_response() -> dict[str, Any]:
    reference = {"$ref": REFERENCE.format(model=Problem.__name__)}
    return {
        "description": "What went wrong.",
        "content": {"application/problem+json": {"schema": reference}},
    }
