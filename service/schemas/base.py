"""Base classes of the API's models, and the problem document."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator
from pydantic_core import PydanticCustomError

from service.outbound.urls import redact_url

MAX_EXACT_INTEGER = 2**53
"""Up to this magnitude every integer has an exact float, so 12.0 can stand for 12."""

RedactedUrl = Annotated[str, AfterValidator(redact_url)]
"""A URL that loses its user info, query and fragment: they may hold credentials."""


class ResponseModel(BaseModel):
    """Base of what the API returns; validates from dicts and from rows with the same attributes."""

    model_config = ConfigDict(extra="forbid", from_attributes=True)


class Problem(BaseModel):
    """Problem document (RFC 9457)."""

    model_config = ConfigDict(extra="allow")

    type: str = Field(description="Stable name of the kind of problem.")
    title: str = Field(description="The kind of problem in words.")
    status: int = Field(ge=400, le=599, description="HTTP status that fits the problem.")
    detail: str = Field(description="What is wrong here, and what to do.")
    errors: list[dict[str, str]] | None = Field(
        None, description="For an invalid request: pointer and detail of each mistake."
    )


class StrictModel(BaseModel):
    """Base of what a caller sends: no unknown fields, no coercion, no NaN or infinity."""

    model_config = ConfigDict(
        extra="forbid",
        strict=True,
        frozen=True,
        allow_inf_nan=False,
        use_attribute_docstrings=True,
    )

    @model_validator(mode="before")
    @classmethod
    def _normalize(cls, value: object) -> object:
        if not isinstance(value, dict):
            return value
        check_field_names(value, cls.model_fields)
        return {name: whole_as_int(item) for name, item in value.items()}


def check_field_names(names: Iterable[object], known: Iterable[str]) -> None:
    """Refuse an unknown field and suggest the most similar known one.

    Raises
    ------
    PydanticCustomError
        A name is unknown. The message does not repeat it: it may be a secret in the wrong place.
    """
    fields = list(known)
    for name in names:
        if name not in fields:
            similar = get_close_matches(str(name), fields, n=1)
            raise PydanticCustomError(
                "unknown_field",
                "there is an unknown field{hint} The fields are: {known}",
                {
                    "hint": f"; did you mean '{similar[0]}'?" if similar else ".",
                    "known": ", ".join(fields),
                },
            )


def whole_as_int(value: Any) -> Any:
    """Return a float without a fraction as an int: JSON has one kind of number, so 12.0 is 12.

    This also turns -0.0 into 0, so that equal requests have equal fingerprints.
    """
    if isinstance(value, float) and value.is_integer() and abs(value) < MAX_EXACT_INTEGER:
        return int(value)
    return value
