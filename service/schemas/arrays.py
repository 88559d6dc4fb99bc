"""Vectors and matrices as JSON has them: lists of numbers, of lists."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any

from pydantic import AfterValidator, BeforeValidator, Field
from pydantic_core import PydanticCustomError

Vector = Annotated[list[float], Field(min_length=3, max_length=3)]
Row = Annotated[list[float], Field(min_length=4, max_length=4)]
Motion = Annotated[list[float], Field(min_length=6, max_length=6)]
Matrix = Annotated[list[Row], Field(min_length=4, max_length=4)]


def _expecting(words: str, *shape: int) -> Callable[[object], object]:
    """Refuse lists of another shape in one sentence, whatever is in them."""

    def check(value: object) -> object:
        if value is not None and not _has_shape(value, shape):
            raise PydanticCustomError("shape", "expected {words}", {"words": words})
        return value

    return check


def _has_shape(value: object, shape: tuple[int, ...]) -> bool:
    if not shape:
        return True
    if not isinstance(value, list | tuple) or len(value) != shape[0]:
        return False
    return all(_has_shape(item, shape[1:]) for item in value)


def _one_zero(value: Any) -> Any:
    """-0.0 becomes 0.0: they are equal, but would be written differently in the key of the work."""
    if isinstance(value, list):
        return [_one_zero(item) for item in value]
    return None if value is None else value + 0.0


GivenVector = Annotated[
    Vector | None,
    BeforeValidator(_expecting("a list of 3 numbers, x, y, z, or null", 3)),
    AfterValidator(_one_zero),
]
GivenMatrix = Annotated[
    Matrix | None,
    BeforeValidator(_expecting("a list of 4 rows of 4 numbers, or null", 4, 4)),
    AfterValidator(_one_zero),
]
