"""JSON documents to the dataclasses of `mpe_client.models`."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import MISSING, fields, is_dataclass
from datetime import datetime
from functools import cache
from types import NoneType
from typing import Any, Literal, TypeVar, get_args, get_origin, get_type_hints

from mpe_client.errors import InvalidResponseError

Model = TypeVar("Model")


def parse_json(model: type[Model], text: bytes | str) -> Model:
    """Parse the JSON of a response.

    Raises
    ------
    InvalidResponseError
        It is not what the service returns.
    """
    try:
        document = json.loads(text)
    except ValueError:
        raise InvalidResponseError(
            f"expected JSON of a {model.__name__}, got {text[:80]!r}"
        ) from None
    return parse(model, document)


def parse(model: type[Model], document: object) -> Model:
    """Turn a parsed JSON object into a dataclass; unknown members are left out.

    Raises
    ------
    InvalidResponseError
        A member is missing, or has another type.
    """
    value: Model = _convert(model, document, model.__name__)
    return value


@cache
def _hints(model: type) -> dict[str, Any]:
    return get_type_hints(model)


def _convert(hint: Any, value: Any, place: str) -> Any:
    if is_dataclass(hint):
        return _convert_object(hint, value, place)
    origin, arguments = get_origin(hint), get_args(hint)
    if NoneType in arguments:
        (inner,) = (item for item in arguments if item is not NoneType)
        return None if value is None else _convert(inner, value, place)
    if origin is list:
        items = _require(value, list, place)
        if arguments[0] in (int, float, str):  # numbers by the 100,000 are taken as they are
            return items
        return [_convert(arguments[0], item, f"{place}[]") for item in items]
    if origin in (dict, Mapping):
        return dict(_require(value, dict, place))
    if hint is datetime:
        return _convert_time(value, place)
    if origin is Literal:
        return _require(value, str, place)  # a later release may add values
    return (
        float(_require(value, (int, float), place))
        if hint is float
        else _require(value, hint, place)
    )


def _convert_object(model: Any, value: Any, place: str) -> Any:
    document, hints = _require(value, dict, place), _hints(model)
    known = {}
    for field in fields(model):
        if field.name in document:
            at = f"{place}.{field.name}"
            known[field.name] = _convert(hints[field.name], document[field.name], at)
        elif field.default is MISSING:
            raise InvalidResponseError(
                f"{place} has no member {field.name!r}; is this the address of the service, and is "
                "its release as new as the client's?"
            )
    return model(**known)


def _convert_time(value: Any, place: str) -> datetime:
    try:
        return datetime.fromisoformat(_require(value, str, place))
    except ValueError:
        raise InvalidResponseError(f"{place}: expected a time, got {value!r}") from None


def _require(value: Any, kind: Any, place: str) -> Any:
    if not isinstance(value, kind):
        raise InvalidResponseError(f"{place}: expected {kind}, got {type(value).__name__}")
    return value
