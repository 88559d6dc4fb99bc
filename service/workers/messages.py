"""Messages of a child process to the service process: one JSON document a line.

The child reads strangers' files, so the parent trusts nothing that it sends: `decode` raises
MessageError for all but a valid message.

A child sends Ready, then any number of Progress, then one answer: Fetched, Succeeded or Exported,
each to one kind of task, or Failed.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cache
from typing import Annotated, Literal

from pydantic import AfterValidator, ConfigDict, Field, TypeAdapter, ValidationError

from service.outbound.http_cache import MAX_VALIDATOR_LENGTH
from service.problems import INTERNAL, TYPE_PREFIX, all_problem_types

MAX_MESSAGE_BYTES = 1 << 20
"""Length of an encoded message; MAX_WARNINGS of MAX_TEXT_LENGTH fit, every character escaped."""
MAX_TEXT_LENGTH = 4_000
"""Characters of a text that a caller may see."""
MAX_WARNINGS = 40
"""Number of warnings of a registration."""

Sha256 = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
Name = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]{0,39}$")]
Text = Annotated[str, Field(max_length=MAX_TEXT_LENGTH)]
Fraction = Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)]
Seconds = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Validator = Annotated[str, Field(max_length=MAX_VALIDATOR_LENGTH)]
Timing = Annotated[dict[Name, Seconds], Field(max_length=40)]
"""Seconds by stage; the keys are those of the API, such as `decode_s`."""


@cache
def _known_types() -> frozenset[str]:
    return frozenset(TYPE_PREFIX + kind.slug for kind in all_problem_types())


def _require_known(kind: str) -> str:
    """Refuse an invented type: each is a label of the metrics, which are kept for ever."""
    if kind not in _known_types():
        raise ValueError("expected a type of problem that the service has")
    return kind


_STRICT = ConfigDict(strict=True, extra="forbid")


class MessageError(ValueError):
    """The bytes are no valid message."""


@dataclass(frozen=True, slots=True)
class FetchedFile:
    """A file that the child has fetched into its scratch folder, or found unchanged."""

    __pydantic_config__ = _STRICT
    key: Sha256
    """Key of its URL in the HTTP cache."""
    etag: Validator | None
    last_modified: Validator | None
    is_cached: bool
    """Whether the cached file is still current, so that nothing was written."""


@dataclass(frozen=True, slots=True)
class Problem:
    """The problem document (RFC 9457) of a failure."""

    __pydantic_config__ = _STRICT
    type: Annotated[str, AfterValidator(_require_known)]
    title: Annotated[str, Field(max_length=200)]
    status: Annotated[int, Field(ge=400, le=599)]
    detail: Text


@dataclass(frozen=True, slots=True)
class Ready:
    """The child waits for its task."""

    __pydantic_config__ = _STRICT
    kind: Literal["ready"] = "ready"


@dataclass(frozen=True, slots=True)
class Progress:
    """How far the task is."""

    __pydantic_config__ = _STRICT
    stage: Name
    fraction: Fraction
    """Share of the whole task that is done."""
    kind: Literal["progress"] = "progress"


@dataclass(frozen=True, slots=True)
class Fetched:
    """The inputs of a registration are fetched."""

    __pydantic_config__ = _STRICT
    source: FetchedFile | None
    """The fetched file; None where none was to be fetched."""
    target: FetchedFile | None
    timing: Timing
    kind: Literal["fetched"] = "fetched"


@dataclass(frozen=True, slots=True)
class Succeeded:
    """The clouds are registered and the result is in the scratch folder."""

    __pydantic_config__ = _STRICT
    confidence: Fraction
    warnings: Annotated[list[Text], Field(max_length=MAX_WARNINGS)]
    timing: Timing
    kind: Literal["succeeded"] = "succeeded"


@dataclass(frozen=True, slots=True)
class Exported:
    """The file is written."""

    __pydantic_config__ = _STRICT
    warnings: Annotated[list[Text], Field(max_length=MAX_WARNINGS)] = field(default_factory=list)
    """What the format could not hold."""
    kind: Literal["exported"] = "exported"


@dataclass(frozen=True, slots=True)
class Failed:
    """The task cannot be performed."""

    __pydantic_config__ = _STRICT
    problem: Problem
    timing: Timing
    kind: Literal["failed"] = "failed"

    @property
    def is_unexplained(self) -> bool:
        """Whether the child does not know what went wrong: libraries do not always say why."""
        return self.problem.type == TYPE_PREFIX + INTERNAL.slug


Answer = Fetched | Succeeded | Exported | Failed
Message = Ready | Progress | Answer
_MESSAGES: TypeAdapter[Message] = TypeAdapter(Annotated[Message, Field(discriminator="kind")])


def encode(message: Message) -> bytes:
    """Return the message as a line of JSON, line end included."""
    return _MESSAGES.dump_json(message) + b"\n"


def decode(line: bytes) -> Message:
    """Parse and validate a line.

    Raises
    ------
    MessageError
        It is no valid message; the text repeats nothing of it.
    """
    try:
        return _MESSAGES.validate_json(line)
    except ValidationError as error:
        reason = error.errors(include_url=False, include_context=False, include_input=False)[0]
        raise MessageError(f"it sent an invalid message ({reason['type']})") from None


def clip(text: str) -> str:
    """Return the text as a message can hold it: valid Unicode, at most MAX_TEXT_LENGTH long."""
    return text[:MAX_TEXT_LENGTH].encode(errors="replace").decode()
