"""The Accept header chooses, with its weights."""

from __future__ import annotations

import pytest

from service.api.accept import preferred_type

JSON, NPY = "application/json", "application/x-npy"


@pytest.mark.parametrize(
    ("accept", "chosen"),
    [
        ("", JSON),
        ("*/*", JSON),
        ("application/*", JSON),
        (NPY, NPY),
        (f"{NPY}, */*", NPY),
        (f"{NPY};q=0.5, {JSON}", JSON),
        (f"{JSON};q=0.5, {NPY};q=0.9", NPY),
        (f"{JSON};q=0, */*", NPY),
        ("*/*;q=0", None),
        (f"{NPY};q=0", None),
        ("text/html", None),
        (" Application/JSON ; q=1.000", JSON),
        (";;;,,,q=q", None),
    ],
)
def test_the_choice(accept: str, chosen: str | None) -> None:
    assert preferred_type(accept, (JSON, NPY)) == chosen
