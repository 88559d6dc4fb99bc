"""One registration of a kind of trouble."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mpe_core import RegistrationOptions
from tests.factories.clouds import knot

Array = NDArray[np.float64]


PLAIN = RegistrationOptions()


@dataclass(frozen=True)
class Case:
    """Clouds of which the benchmark moves the source, and what is wanted."""

    there: Array
    """(N, 3) source where it belongs."""
    target: Array
    """(M, 3) target."""
    fits: bool = True
    """Whether there is a right pose; otherwise the pair is to be refused."""
    options: RegistrationOptions = PLAIN
    rows: Array | None = None
    """(K, 3) rows that are appended to the source in its own frame."""
    colors: tuple[Array, Array] | None = None
    """Brightness of source and target."""
    named: str | None = None
    """Code of the warning that has to name the cause; "degrees" for the error of the readers."""
    has_start: bool = False
    """Whether the true pose, to four digits, is the initial transform."""
    both_ways: bool = False
    """Whether the pair counts as right only if the target on the source gives the same."""


Maker = Callable[[np.random.Generator], Case]


def body(rng: np.random.Generator, count: int = 3000) -> Array:
    """Return a bent tube with noise, about 1 long."""
    return knot(count, rng) + rng.normal(0, 0.002, (count, 3))
