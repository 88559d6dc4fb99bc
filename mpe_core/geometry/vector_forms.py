"""Vectors and places as callers write them, of numbers that can be calculated with.

The options import this module, so it must not load the compiled kernels.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from mpe_core.geometry.validation import MAX_COORDINATE

Array = NDArray[np.float64]

MAX_WORDS = 80
"""Characters of a wrong value that a message repeats."""


def read_numbers(value: Any, shape: tuple[int, ...]) -> Array:
    """Convert the value to an array of this shape.

    Raises
    ------
    ValueError
        It has another shape, or numbers that are not finite or too large.
    """
    array = as_array(value)
    if array.shape != shape or not np.isfinite(array).all():
        size = " x ".join(str(n) for n in shape)
        raise ValueError(f"must be {size} finite numbers, got {_shorten(value)}")
    return check_size(array)


def read_places(value: Any, most: int) -> Array:
    """Convert one place (3,), or up to `most` places (k, 3), to an array (k, 3).

    Raises
    ------
    ValueError
        It has another shape, or numbers that are not finite or too large.
    """
    array = as_array(value)
    if array.shape == (3,):
        array = array[None]
    has_shape = array.ndim == 2 and array.shape[1] == 3 and 1 <= len(array) <= most
    if not has_shape or not np.isfinite(array).all():
        raise ValueError(
            f"must be 3 finite numbers, or a list of 1 to {most} times 3, got {_shorten(value)}"
        )
    return check_size(array)


def as_array(value: Any) -> Array:
    """Convert the value to an array; an empty one if it does not consist of numbers."""
    try:
        return np.asarray(value, np.float64)
    except (TypeError, ValueError):
        return np.empty(0)


def check_size(array: Array) -> Array:
    """Return the array.

    Raises
    ------
    ValueError
        It holds numbers that are too large to be calculated with.
    """
    if np.abs(array).max() > MAX_COORDINATE:
        raise ValueError(
            f"must hold numbers of at most {MAX_COORDINATE:g}, got {np.abs(array).max():g}"
        )
    return array


def _shorten(value: Any) -> str:
    count = f"{len(value)} times: " if isinstance(value, list | tuple) and len(value) > 4 else ""
    words = repr(value)
    return count + (words if len(words) <= MAX_WORDS else f"{words[:MAX_WORDS]}...")
