"""What a caller may choose about a registration."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from mpe_core.errors import InvalidOptionsError
from mpe_core.geometry.validation import MAX_COORDINATE, is_rigid

Vector = tuple[float, float, float]
Row = tuple[float, float, float, float]
Matrix = tuple[Row, Row, Row, Row]

Method = Literal["mpl", "mpe"]
METHODS: tuple[Method, ...] = ("mpl", "mpe")
Search = Literal["global", "sparse"]
SEARCHES: tuple[Search, ...] = ("global", "sparse")
FieldMethod = Literal["tree", "exact"]
FIELDS: tuple[FieldMethod, ...] = ("tree", "exact")

ACCEPTANCE_THRESHOLD = 0.5
"""Confidence from which on a pose is accepted."""


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
    field: FieldMethod = "tree"
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

    voxel_size: float | None = None
    """Edge of the cubes that the clouds are thinned to for the search, in the unit of the input; a
    third of it for the refinement. Larger evens out noise, smaller keeps small parts; from a
    thousandth to a fifth of the radius of the smaller cloud. None: 1.5 % of that radius."""

    initial_transform: Matrix | None = None
    """About where the source lies in the target's frame: 4x4 rigid transform, row-major, as the
    result has it. The search keeps within 30 degrees and half a radius of the smaller cloud of
    it; local methods start there."""

    source_gravity: Vector | None = None
    """Which way is down in the source's frame, any length; with target_gravity the search keeps
    within 15 degrees of poses that agree about it."""

    target_gravity: Vector | None = None
    """Which way is down in the target's frame, any length."""

    yaw_only: bool = False
    """Both scans are levelled: the pose turns about the vertical alone. Down is -z, or as given by
    source_gravity and target_gravity."""

    source_viewpoint: Vector | None = None
    """Where the scanner stood in the source's frame; with target_viewpoint, surfaces that were seen
    from opposite sides never match: thin parts do not flip."""

    target_viewpoint: Vector | None = None
    """Where the scanner stood in the target's frame."""

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
        _check_positive("voxel_size", self.voxel_size)
        if not isinstance(self.yaw_only, bool):
            raise InvalidOptionsError(f"yaw_only must be true or false, got {self.yaw_only!r}")
        for kind in ("gravity", "viewpoint"):
            self._check_vectors(f"source_{kind}", f"target_{kind}")
        for name in ("source_gravity", "target_gravity"):
            if getattr(self, name) == (0, 0, 0):
                raise InvalidOptionsError(f"{name} must point somewhere, got (0, 0, 0)")
        if self.initial_transform is not None:
            self._check_initial_transform()
        self._check_purpose()

    def _check_vectors(self, *names: str) -> None:
        given = [name for name in names if getattr(self, name) is not None]
        if len(given) == 1:
            (missing,) = set(names) - set(given)
            raise InvalidOptionsError(f"{given[0]} is of use together with {missing}: give both")
        for name in given:
            self._set(name, tuple(_numbers(name, getattr(self, name), (3,)).tolist()))

    def _check_initial_transform(self) -> None:
        T = _numbers("initial_transform", self.initial_transform, (4, 4))
        if not is_rigid(T):
            raise InvalidOptionsError(
                "initial_transform must be rigid: a rotation and a translation above the row"
                f" 0 0 0 1, without scale, got {T.tolist()}"
            )
        self._set("initial_transform", tuple(tuple(row) for row in T.tolist()))

    def _check_purpose(self) -> None:
        """Refuse what the chosen method would ignore."""
        if self.method == "mpl" and self.search == "global":
            return
        for name in ("source_gravity", "source_viewpoint", "yaw_only", "voxel_size"):
            if getattr(self, name):
                raise InvalidOptionsError(
                    f'{name} needs method "mpl" with search "global", got method'
                    f' "{self.method}" with search "{self.search}"'
                )

    def _set(self, name: str, value: object) -> None:
        object.__setattr__(self, name, value)  # frozen; the value is the same, as tuples


def _check_count(name: str, value: object, least: int) -> None:
    if not isinstance(value, int) or isinstance(value, bool) or value < least:
        raise InvalidOptionsError(f"{name} must be a whole number from {least} up, got {value!r}")


def _check_positive(name: str, value: object, most: float = sys.float_info.max) -> None:
    if value is None:
        return
    if not isinstance(value, int | float) or isinstance(value, bool) or not 0 < value <= most:
        limit = f" and at most {most}" if most == 1 else ""
        raise InvalidOptionsError(f"{name} must be a number above 0{limit}, got {value!r}")


def _numbers(
    name: str, value: Any, shape: tuple[int, ...]
) -> np.ndarray[Any, np.dtype[np.float64]]:
    """The value as an array of this shape."""
    try:
        array = np.asarray(value, np.float64)
    except (TypeError, ValueError):
        array = np.empty(0)
    if array.shape != shape or not np.isfinite(array).all():
        size = " x ".join(str(n) for n in shape)
        raise InvalidOptionsError(f"{name} must be {size} finite numbers, got {value!r}")
    if np.abs(array).max() > MAX_COORDINATE:
        raise InvalidOptionsError(f"{name} has a number beyond {MAX_COORDINATE:g}")
    return array
