"""The options of a registration as the API takes them: one field for each field of mpe_core's."""

from __future__ import annotations

import ast
import dataclasses
import inspect
import textwrap
from difflib import get_close_matches
from typing import TYPE_CHECKING, Any, Self, get_type_hints

from pydantic import BaseModel, ConfigDict, Field, create_model, model_validator
from pydantic_core import PydanticCustomError

from mpe_core.options import Matrix, RegistrationOptions, Vector
from service.schemas.arrays import GivenMatrix, GivenVector

EXACT = 2**53
"""Below it, a float that is whole is exactly that whole number."""
# what mpe_core checks, said in the schema too
BOUNDS: dict[str, dict[str, Any]] = {
    "sample_size": {"minimum": 3},
    "overlap": {"exclusiveMinimum": 0, "maximum": 1},
    "inlier_threshold": {"exclusiveMinimum": 0},
    "voxel_size": {"exclusiveMinimum": 0},
    "max_iterations": {"minimum": 1},
    "seed": {"minimum": 0},
}

# JSON has lists where mpe_core has tuples
AS_JSON: dict[Any, Any] = {Vector | None: GivenVector, Matrix | None: GivenMatrix}


class StrictModel(BaseModel):
    """Input of a caller: no unknown fields, no coercion, no NaN or infinity."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)

    @model_validator(mode="before")
    @classmethod
    def _known_fields(cls, value: object) -> object:
        """Refuse an unknown field by naming the nearest known one; the input is not repeated."""
        known = list(cls.model_fields)
        for name in value if isinstance(value, dict) else ():
            if name not in known:
                near = get_close_matches(str(name), known, n=1)
                hint = f"; did you mean '{near[0]}'?" if near else ""
                raise PydanticCustomError(
                    "unknown_field",
                    "there is an unknown field{hint} The fields are: {known}",
                    {"hint": hint or ".", "known": ", ".join(known)},
                )
        return value

    @model_validator(mode="before")
    @classmethod
    def _whole_numbers(cls, value: object) -> object:
        """JSON has one kind of number: 12.0 is the whole number 12."""
        if not isinstance(value, dict):
            return value
        return {name: _whole(item) for name, item in value.items()}


def _whole(value: object) -> object:
    if isinstance(value, float) and value.is_integer() and abs(value) < EXACT:
        return int(value)
    return value


class _CheckedOptions(StrictModel):
    @model_validator(mode="after")
    def _within_ranges(self) -> Self:
        RegistrationOptions(**self.model_dump())
        return self


def _attribute_docs(owner: type) -> dict[str, str]:
    """The string below each annotated attribute of the class."""
    (definition,) = ast.parse(textwrap.dedent(inspect.getsource(owner))).body
    assert isinstance(definition, ast.ClassDef)  # noqa: S101
    docs: dict[str, str] = {}
    for statement, following in zip(definition.body, definition.body[1:], strict=False):
        if isinstance(statement, ast.AnnAssign) and isinstance(following, ast.Expr):
            name, text = ast.unparse(statement.target), ast.literal_eval(following.value)
            docs[name] = " ".join(text.split())
    return docs


def _options_model() -> type[_CheckedOptions]:
    docs = _attribute_docs(RegistrationOptions)
    hints = get_type_hints(RegistrationOptions, include_extras=True)
    fields: dict[str, Any] = {
        field.name: (
            AS_JSON.get(hints[field.name], hints[field.name]),
            Field(
                field.default,
                description=docs[field.name],
                json_schema_extra=BOUNDS.get(field.name),
            ),
        )
        for field in dataclasses.fields(RegistrationOptions)
    }
    return create_model(
        "Options",
        __base__=_CheckedOptions,
        __doc__="How to register.",
        __module__=__name__,
        **fields,
    )


if TYPE_CHECKING:

    class Options(_CheckedOptions):
        """How to register."""
else:
    Options = _options_model()
