"""The OpenAPI description, served at /openapi.json."""

from __future__ import annotations

from importlib.metadata import version
from typing import Any

from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi
from pydantic import BaseModel
from pydantic.json_schema import models_json_schema

from service.clouds.inputs import CLOUD_ROLES
from service.schemas import AnnouncedFile, Problem, RegistrationParameters, RegistrationRequest

DESCRIPTION = """Rigid registration of 3-D point clouds from any starting pose.

Lengths are in the unit of the input, whatever it is; angles in degrees; times in seconds.
Every error is a problem document (RFC 9457)."""
REFERENCE = "#/components/schemas/{model}"
BODY_MODELS: tuple[type[BaseModel], ...] = (
    RegistrationRequest,
    RegistrationParameters,
    AnnouncedFile,
    Problem,
)


def add_description(app: FastAPI) -> None:
    """Set the OpenAPI description of the app and serve it at /openapi.json."""

    def openapi() -> dict[str, Any]:
        if app.openapi_schema is None:
            app.openapi_schema = _describe(app)
        return app.openapi_schema

    app.openapi = openapi  # type: ignore[method-assign]
    app.add_api_route("/openapi.json", openapi, include_in_schema=False)


def _describe(app: FastAPI) -> dict[str, Any]:
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
    components["RegistrationForm"] = _describe_form(components["RegistrationParameters"])
    for unused in ("HTTPValidationError", "ValidationError", "RegistrationParameters"):
        components.pop(unused, None)
    schema["components"]["schemas"] = dict(sorted(components.items()))
    for operations in schema["paths"].values():
        for operation in operations.values():
            operation["responses"].pop("422", None)
            operation["responses"]["default"] = _describe_problem()
            if "security" in operation:
                operation["security"].append({})  # a service without keys needs none
    return schema


def _describe_form(parameters: dict[str, Any]) -> dict[str, Any]:
    """Return the schema of the multipart form: two files, and the parameters as JSON."""
    cloud = {"type": "string", "format": "binary"}
    fields = parameters["properties"]
    text, null = fields["callback_url"].pop("anyOf")  # a form cannot say null: leave the field out
    assert null == {"type": "null"}  # noqa: S101
    fields["callback_url"] |= text
    return {
        "type": "object",
        "title": "RegistrationForm",
        "description": "A registration of two uploaded files. The other fields are JSON, except "
        "callback_url, which is plain text.",
        "required": list(CLOUD_ROLES),
        "additionalProperties": False,
        "properties": {
            "source": cloud | {"description": "File of the cloud that is moved."},
            "target": cloud | {"description": "File of the cloud that stays in place."},
            **fields,
        },
    }


def _describe_problem() -> dict[str, Any]:
    reference = {"$ref": REFERENCE.format(model=Problem.__name__)}
    return {
        "description": "What went wrong.",
        "content": {"application/problem+json": {"schema": reference}},
    }
