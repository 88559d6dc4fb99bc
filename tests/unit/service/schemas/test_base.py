"""What all models have in common: strict input, tolerant rows, redacted URLs."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
from pydantic import ValidationError

from service.schemas.base import (
    MAX_EXACT_INTEGER,
    RedactedUrl,
    ResponseModel,
    StrictModel,
    whole_as_int,
)


class Sent(StrictModel):
    """What a caller might send."""

    count: int = 0
    length_m: float | None = None


class Returned(ResponseModel):
    """What the API might return."""

    url: RedactedUrl | None


@pytest.mark.parametrize("text", ['{"count": 12}', '{"count": 12.0}', '{"count": 1.2e1}'])
def test_a_whole_number_may_be_written_as_any_number(text: str) -> None:
    assert Sent.model_validate_json(text).count == 12


@pytest.mark.parametrize("value", [float(MAX_EXACT_INTEGER), 1.5, float("inf"), float("nan"), "1"])
def test_what_is_not_exactly_whole_stays(value: object) -> None:
    assert whole_as_int(value) is value


@pytest.mark.parametrize(
    "text",
    [
        '{"count": "1"}',
        '{"count": 1.5}',
        '{"length_m": NaN}',
        '{"cuont": 1}',
        "[]",
        '{"count": 1e30}',
    ],
)
def test_nothing_is_coerced(text: str) -> None:
    with pytest.raises(ValidationError):
        Sent.model_validate_json(text)


def test_an_unknown_field_is_not_repeated() -> None:
    with pytest.raises(ValidationError) as raised:
        Sent.model_validate_json('{"Bearer mpe_secret": 1}')
    (mistake,) = raised.value.errors()
    assert mistake["msg"] == "there is an unknown field. The fields are: count, length_m"


def test_input_is_frozen() -> None:
    with pytest.raises(ValidationError):
        Sent().count = 1  # type: ignore[misc]


def test_a_returned_url_carries_no_credentials() -> None:
    url = "https://user:word@h.example:8/scan.ply?sig=secret#part"
    returned = Returned.model_validate(SimpleNamespace(url=url, secret="not copied"))
    assert returned.model_dump() == {"url": "https://h.example:8/scan.ply"}
    assert Returned(url=None).url is None
