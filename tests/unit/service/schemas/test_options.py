"""Options in JSON: strict, told apart by their field, and described as mpe_core checks them."""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from mpe_core import RegistrationOptions
from mpe_core.errors import InvalidOptionsError
from service.schemas import RegistrationParameters, describe_options
from service.schemas.options import OPTION_NAMES, SCHEMA_BOUNDS

TURN = [[0, -1, 0, 0.5], [1, 0, 0, -0.0], [0, 0, 1, 0], [0, 0, 0, 1]]
FULL = {
    "method": "mpl",
    "initial_transform": TURN,
    "source_gravity": [0, 0, -1],
    "target_gravity": [0, 0.5, -1],
    "yaw_only": True,
    "overlap": 1,
    "seed": 12.0,
}


NEEDS_START = ("max_rotation_deg", "max_translation")


def parse(options: Any) -> RegistrationOptions:
    text = json.dumps({"options": options})
    return RegistrationParameters.model_validate_json(text).options


def mistakes(options: Any) -> list[tuple[str, str]]:
    """Pointer and message of each mistake."""
    with pytest.raises(ValidationError) as raised:
        parse(options)
    return [("/".join(map(str, e["loc"])), e["msg"]) for e in raised.value.errors()]


def test_json_gives_the_options_of_the_library() -> None:
    said = FULL | {"initial_transform": tuple(map(tuple, TURN)), "seed": 12}
    said |= {name: tuple(FULL[name]) for name in ("source_gravity", "target_gravity")}  # type: ignore[arg-type]
    assert parse(FULL) == RegistrationOptions(**said)  # type: ignore[arg-type]
    assert parse({}) == RegistrationOptions()


def test_equal_numbers_give_equal_text() -> None:
    """The hash of the work is one of text, in which 12.0 is not 12, nor -0.0 0.0."""
    first = {"seed": 12, "source_viewpoint": [0, 1, 2], "target_viewpoint": [0, 0, 0]}
    second = {"seed": 12.0, "source_viewpoint": [-0.0, 1.0, 2], "target_viewpoint": [0, -0.0, 0.0]}
    assert json.dumps(asdict(parse(first))) == json.dumps(asdict(parse(second)))


@pytest.mark.parametrize(
    ("options", "pointer", "words"),
    [
        ({"methd": "mpl"}, "options", "did you mean 'method'?"),
        ({"zzz-secret-zzz": 1}, "options", "there is an unknown field. The fields are: method, "),
        ({"method": "icp"}, "options/method", "'mpl' or 'mpe'"),
        ({"seed": "1"}, "options/seed", "valid integer"),
        ({"seed": 1.5}, "options/seed", "valid integer"),
        ({"seed": None}, "options/seed", "valid integer"),
        ({"seed": True}, "options/seed", "valid integer"),
        ({"yaw_only": 1}, "options/yaw_only", "valid boolean"),
        ({"overlap": "1"}, "options/overlap", "valid number"),
        ({"overlap": float("nan")}, "options/overlap", "finite"),
        ({"overlap": float("inf")}, "options/overlap", "finite"),
        ({"overlap": 1.5}, "options", "overlap must be a number above 0 and at most 1"),
        ({"source_gravity": [0, 1]}, "options/source_gravity", "a list of 3 numbers"),
        ({"source_gravity": {"0": 1}}, "options/source_gravity", "a list of 3 numbers"),
        ({"source_gravity": [0, "1", 2]}, "options/source_gravity/1", "valid number"),
        ({"source_viewpoint": [0, 1]}, "options/source_viewpoint", "a list of 1 to 256 of these"),
        ({"source_viewpoint": []}, "options/source_viewpoint", "a list of 1 to 256 of these"),
        ({"source_viewpoint": [[0, 1]]}, "options/source_viewpoint", "a list of 1 to 256"),
        ({"source_viewpoint": [[0, 1, 2], 3, 4]}, "options/source_viewpoint", "a list of 1 to"),
        ({"source_viewpoint": 257 * [[0, 1, 2]]}, "options/source_viewpoint", "a list of 1 to"),
        ({"source_viewpoint": [0, "1", 2]}, "options/source_viewpoint/1", "valid number"),
        ({"source_viewpoint": [[0, 1, True]]}, "options/source_viewpoint/0/2", "valid number"),
        ({"source_viewpoint": [[0, 1, float("nan")]]}, "options/source_viewpoint/0/2", "finite"),
        ({"initial_transform": "x"}, "options/initial_transform", "4x4 or 3x4 numbers"),
        ({"initial_transform": np.eye(3).tolist()}, "options/initial_transform", "4x4 or 3x4"),
        ({"initial_transform": (2 * np.eye(4)).tolist()}, "options/initial_transform", "rigid"),
        ("mpl", "options", "object"),
        (["mpl"], "options", "object"),
    ],
)
def test_each_mistake_is_told_once_where_it_is(options: Any, pointer: str, words: str) -> None:
    ((where, message),) = mistakes(options)
    assert where == pointer
    assert words in message
    assert "secret" not in message


@pytest.mark.parametrize(
    "form",
    [
        TURN[:3],
        [number for row in TURN for number in row],
        np.transpose(TURN).tolist(),
        {"quaternion_wxyz": [0.7071, 0, 0, 0.7071], "translation": [0.5, 0, 0]},
    ],
)
def test_a_transform_is_read_in_any_form(form: Any) -> None:
    transform = parse({"initial_transform": form}).initial_transform
    np.testing.assert_allclose(np.array(transform), TURN, atol=1e-12)


def test_viewpoints_are_one_place_or_several() -> None:
    places = [[0, 1, 2], [3, 4, 5.5]]
    options = parse({"source_viewpoint": places, "target_viewpoint": [[6, 7, 8]]})
    assert options.source_viewpoint == ((0.0, 1.0, 2.0), (3.0, 4.0, 5.5))
    assert options.target_viewpoint == (6.0, 7.0, 8.0)
    one, several, null = describe_options()["source_viewpoint"]["anyOf"]
    assert several == {"type": "array", "minItems": 1, "maxItems": 256, "items": one}
    assert null == {"type": "null"}


def test_null_stands_for_what_is_not_known() -> None:
    names = ("overlap", "initial_transform", "source_gravity", "target_gravity", "voxel_size")
    assert parse(dict.fromkeys(names)) == RegistrationOptions()


def test_every_option_is_described() -> None:
    schemas = describe_options()
    assert tuple(schemas) == OPTION_NAMES
    for name, schema in schemas.items():
        assert schema["default"] == getattr(RegistrationOptions(), name)
        assert "\n" not in schema["description"]
        assert schema["title"]


@pytest.mark.parametrize("name", SCHEMA_BOUNDS)
def test_the_published_bounds_are_those_that_are_checked(name: str) -> None:
    bounds = SCHEMA_BOUNDS[name]
    assert describe_options()[name].items() >= bounds.items()
    for bound, value in bounds.items():
        beyond = value + (1 if bound == "maximum" else -1)
        inside = value if bound in ("minimum", "maximum") else 1
        needed: dict[str, Any] = {"initial_transform": np.eye(4)} if name in NEEDS_START else {}
        RegistrationOptions(**{name: inside}, **needed)
        for wrong in (beyond, *([value] if bound == "exclusiveMinimum" else [])):
            with pytest.raises(InvalidOptionsError, match=name):
                RegistrationOptions(**{name: wrong}, **needed)


def test_vectors_are_described_as_lists() -> None:
    """`items` rather than `prefixItems`, which fewer tools understand."""
    vector, null = describe_options()["source_gravity"]["anyOf"]
    assert null == {"type": "null"}
    assert vector == {"type": "array", "minItems": 3, "maxItems": 3, "items": {"type": "number"}}
    assert "prefixItems" not in json.dumps(describe_options())
