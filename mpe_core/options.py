"""What a caller may choose about a registration."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import Literal

from mpe_core.errors import InvalidOptionsError

Method = Literal["mpl", "mpe"]
METHODS: tuple[Method, ...] = ("mpl", "mpe")
Search = Literal["global", "sparse"]
SEARCHES: tuple[Search, ...] = ("global", "sparse")
Field = Literal["tree", "exact"]
FIELDS: tuple[Field, ...] = ("tree", "exact")


@dataclass(frozen=True, slots=True, kw_only=True)
class RegistrationOptions:
    """Options of one registration; the defaults suit any pair of clouds.

    Raises
    ------
    InvalidOptionsError
        An option is out of its range.
    """

    method: Method = "mpl"
    """"mpl": search on a sample, then refinement on the full clouds. "mpe": the paper's Algorithm 1
    with the double sum over all points; a local method with a wide basin."""

    # 35,947 points each: "tree" 0.9, "exact" 4.2 seconds of processor time in all, poses within
    # 0.001 degrees
    field: Field = "tree"
    """How "mpe" sums the target's pull on a point. "tree": distant parts of the target as one
    (Barnes-Hut), in time N log N. "exact": over all pairs, as the paper prints it, in time N^2."""

    search: Search = "global"
    """First half of "mpl". "global": from any pose. "sparse": as the paper prints it, Algorithm 1
    on a sample, then trimmed ICP; a local method with a wide basin."""

    # bunny of 1,889 points, wrong of 200 trials clean / with noise 0.02 / with 1,500 outliers:
    # 400 points 2/3/3, 800 1/1/1, 1,600 0/0/1; of 50 trials 100 points 6/3/4
    sample_size: int = 1600
    """Points of each cloud in the "sparse" search; a count."""

    overlap: float | None = None
    """Share of the source that has a counterpart in the target, in (0, 1]; None: searched."""

    inlier_threshold: float | None = None
    """Largest distance of an inlier pair, in the unit of the input; None: from the residuals."""

    max_iterations: int = 100
    """Bound on the iterations of each stage; a count."""

    seed: int = 0
    """Seed of every random choice; the same seed gives the same bits."""

    def __post_init__(self) -> None:
        if self.method not in METHODS:
            raise InvalidOptionsError(f"method must be one of {METHODS}, got {self.method!r}")
        if self.search not in SEARCHES:
            raise InvalidOptionsError(f"search must be one of {SEARCHES}, got {self.search!r}")
        if self.field not in FIELDS:
            raise InvalidOptionsError(f"field must be one of {FIELDS}, got {self.field!r}")
        _check_count("sample_size", self.sample_size, least=3)
        _check_count("max_iterations", self.max_iterations, least=1)
        _check_count("seed", self.seed, least=0)
        _check_positive("overlap", self.overlap, most=1)
        _check_positive("inlier_threshold", self.inlier_threshold)


def _check_count(name: str, value: object, least: int) -> None:
    if not isinstance(value, int) or isinstance(value, bool) or value < least:
        raise InvalidOptionsError(f"{name} must be a whole number from {least} up, got {value!r}")


def _check_positive(name: str, value: object, most: float = sys.float_info.max) -> None:
    if value is None:
        return
    if not isinstance(value, int | float) or isinstance(value, bool) or not 0 < value <= most:
        limit = f" and at most {most}" if most == 1 else ""
        raise InvalidOptionsError(f"{name} must be a number above 0{limit}, got {value!r}")
