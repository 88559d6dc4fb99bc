"""The `options` of a request: `mpe_core.RegistrationOptions`, read from JSON by pydantic.

The dataclass itself is the model: pydantic takes its fields, defaults and attribute docstrings, and
runs its checks. As a standard dataclass it inherits the config of the model that contains it, so
`Options` belongs in a `StrictModel`. This module adds what JSON needs: lists in place of tuples,
messages that name the expected shape, and bounds in the published schema.
"""

from __future__ import annotations

from dataclasses import fields
from typing import Annotated, Any, get_type_hints

from pydantic import (
    BeforeValidator,
    ConfigDict,
    GetJsonSchemaHandler,
    TypeAdapter,
    ValidationError,
)
from pydantic_core import CoreSchema, InitErrorDetails, PydanticCustomError

from mpe_core.geometry.transform_forms import QUATERNIONS, read_rigid_transform
from mpe_core.options import (
    MAX_VIEWPOINTS,
    SCALES,
    RegistrationOptions,
    Scale,
    Vector,
    Viewpoints,
)
from service.schemas.base import check_field_names, whole_as_int

OPTION_NAMES = tuple(field.name for field in fields(RegistrationOptions))

SCHEMA_BOUNDS: dict[str, dict[str, float]] = {
    "sample_size": {"minimum": 3},
    "overlap": {"exclusiveMinimum": 0, "maximum": 1},
    "inlier_threshold": {"exclusiveMinimum": 0},
    "voxel_size": {"exclusiveMinimum": 0},
    "max_rotation_deg": {"exclusiveMinimum": 0, "maximum": 180},
    "max_translation": {"exclusiveMinimum": 0},
    "max_iterations": {"minimum": 1},
    "seed": {"minimum": 0},
}
"""Bounds that the schema publishes; RegistrationOptions enforces them, a test compares the two."""

_HINTS = get_type_hints(RegistrationOptions)
_SHAPES: dict[Any, tuple[tuple[int, ...], str]] = {
    Vector | None: ((3,), "a list of 3 numbers, x, y, z, or null"),
    Viewpoints | None: (
        (3,),
        f"a list of 3 numbers, x, y, z, a list of 1 to {MAX_VIEWPOINTS} of these, or null",
    ),
    Scale: ((2,), f"one of {', '.join(SCALES)}, or a list of 2 numbers, least and most"),
}
_VIEWPOINTS = ("source_viewpoint", "target_viewpoint")
_STRICT = ConfigDict(strict=True, allow_inf_nan=False)
_PLACE: TypeAdapter[Any] = TypeAdapter(Vector, config=_STRICT)
_PLACES: TypeAdapter[Any] = TypeAdapter(tuple[Vector, ...], config=_STRICT)


def _from_json(value: object) -> object:
    """Check names and shapes, and turn lists into the tuples that RegistrationOptions has."""
    if not isinstance(value, dict):
        return value
    check_field_names(value, OPTION_NAMES)
    errors = [_shape_error(name) for name, item in value.items() if not _has_shape(name, item)]
    if errors:
        raise ValidationError.from_exception_data("options", errors)
    values = {name: _as_tuple(item) for name, item in value.items()}
    errors = [error for name in _VIEWPOINTS for error in _number_errors(name, values.get(name))]
    if errors:
        raise ValidationError.from_exception_data("options", errors)
    if values.get("initial_transform") is not None:
        values["initial_transform"] = _read_transform(value["initial_transform"])
    return values


def _read_transform(value: object) -> object:
    """Turn any form of a rigid transform into rows of numbers."""
    try:
        return _as_tuple(read_rigid_transform(value).tolist())
    except ValueError as reason:
        text = {"reason": str(reason)}
        error = PydanticCustomError("transform", "initial_transform {reason}", text)
        line = InitErrorDetails(type=error, loc=("initial_transform",), input=None)
        raise ValidationError.from_exception_data("options", [line]) from None


def _has_shape(name: str, value: object) -> bool:
    if name in _VIEWPOINTS:
        return value is None or _are_places(value)
    shape, _ = _SHAPES.get(_HINTS[name], ((), ""))
    if isinstance(value, str) and name == "scale":
        return value in SCALES
    if value is None and name != "scale":
        return True
    return _is_nested_list(value, shape)


def _is_nested_list(value: object, shape: tuple[int, ...]) -> bool:
    if not shape:
        return True
    if not isinstance(value, list) or len(value) != shape[0]:
        return False
    return all(_is_nested_list(item, shape[1:]) for item in value)


def _are_places(value: object) -> bool:
    """Whether a value is a list of 3, or a list of lists of 3."""
    if not isinstance(value, list) or not any(isinstance(item, list) for item in value):
        return _is_nested_list(value, (3,))
    return 1 <= len(value) <= MAX_VIEWPOINTS and _is_nested_list(value, (len(value), 3))


def _number_errors(name: str, places: Any) -> list[InitErrorDetails]:
    """List what is wrong in one place or several, once: a union would name each of its forms."""
    if places is None:
        return []
    form = _PLACES if isinstance(places[0], tuple) else _PLACE
    try:
        form.validate_python(places)
    except ValidationError as error:
        return [
            InitErrorDetails(type=item["type"], loc=(name, *item["loc"]), input=None)
            for item in error.errors()
        ]
    return []


def _shape_error(name: str) -> InitErrorDetails:
    _, expected = _SHAPES[_HINTS[name]]
    error = PydanticCustomError("shape", "expected {expected}", {"expected": expected})
    return InitErrorDetails(type=error, loc=(name,), input=None)


def _as_tuple(value: Any) -> Any:
    if isinstance(value, list):
        return tuple(_as_tuple(item) for item in value)
    return whole_as_int(value)


class _JsonSchema:
    """Annotation that completes the JSON schema of the options."""

    @staticmethod
    def __get_pydantic_json_schema__(
        core_schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        reference = handler(core_schema)
        schema = handler.resolve_ref_schema(reference)
        schema["description"] = "How to register."
        for name, option in schema["properties"].items():
            option["description"] = " ".join(option["description"].split())
            option |= SCHEMA_BOUNDS.get(name, {}) | _list_schemas(option)
        for name in _VIEWPOINTS:
            schema["properties"][name]["anyOf"][1] |= {"minItems": 1, "maxItems": MAX_VIEWPOINTS}
        forms = schema["properties"]["initial_transform"]["anyOf"]
        forms[1:1] = _transform_forms()
        return reference


def _transform_forms() -> list[dict[str, Any]]:
    """Describe the forms of a rigid transform beside 4x4 rows."""
    number = {"type": "number"}

    def numbers(least: int, most: int) -> dict[str, Any]:
        return {"type": "array", "minItems": least, "maxItems": most, "items": number}

    rows = {"type": "array", "minItems": 3, "maxItems": 3, "items": numbers(4, 4)}
    quaternions = [
        {
            "type": "object",
            "additionalProperties": False,
            "required": [name, "translation"],
            "properties": {name: numbers(4, 4), "translation": numbers(3, 3)},
        }
        for name in QUATERNIONS
    ]
    return [rows, numbers(16, 16), numbers(12, 12), *quaternions]


def _list_schemas(schema: dict[str, Any]) -> dict[str, Any]:
    """Describe a tuple of equal items as a list: `items` is more widely understood."""
    schema = dict(schema)
    if "anyOf" in schema:
        schema["anyOf"] = [_list_schemas(choice) for choice in schema["anyOf"]]
    if "prefixItems" in schema:
        schema["items"] = schema.pop("prefixItems")[0]
    if "items" in schema:
        schema["items"] = _list_schemas(schema["items"])
    return schema


Options = Annotated[RegistrationOptions, BeforeValidator(_from_json), _JsonSchema]
"""Type of the field `options` of a request."""
