"""Options of a registration."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from mpe_core.errors import InvalidOptionsError
from mpe_core.geometry.transform_forms import read_rigid_transform
from mpe_core.geometry.vector_forms import read_numbers, read_places

Vector = tuple[float, float, float]
_Row = tuple[float, float, float, float]
Matrix = tuple[_Row, _Row, _Row, _Row]

Viewpoints = Vector | tuple[Vector, ...]
"""Place of the scanner, or places of several."""

MAX_VIEWPOINTS = 256
"""Places of one cloud: each takes 0.15 MB of range images (docs/tuning.md)."""

Method = Literal["mpl", "mpe"]
METHODS: tuple[Method, ...] = ("mpl", "mpe")
Search = Literal["global", "sparse"]
SEARCHES: tuple[Search, ...] = ("global", "sparse")
FieldMethod = Literal["tree", "exact"]
FIELDS: tuple[FieldMethod, ...] = ("tree", "exact")

Scale = Literal["fixed", "units", "free"] | tuple[float, float]
SCALES = ("fixed", "units", "free")

UseColor = Literal["auto", "never"]
USES_OF_COLOR: tuple[UseColor, ...] = ("auto", "never")
InferViewpoints = Literal["auto", "never"]
INFERENCES: tuple[InferViewpoints, ...] = ("auto", "never")

ACCEPTANCE_THRESHOLD = 0.5
"""Confidence from which on a pose counts as right."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RegistrationOptions:
    """Options of one registration; the defaults suit any pair of clouds.

    Each option is described below its name. Vectors and matrices may be arrays or nested sequences;
    they are kept as tuples, so that options can be compared and hashed.

    Raises
    ------
    InvalidOptionsError
        If an option is out of its range, or does nothing with the chosen method.

    Examples
    --------
    >>> from mpe_core import RegistrationOptions
    >>> RegistrationOptions(overlap=0.4, seed=7).overlap
    0.4
    >>> RegistrationOptions(overlap=40)
    Traceback (most recent call last):
    mpe_core.errors.InvalidOptionsError: overlap must be a number above 0 and at most 1, got 40
    """

    method: Method = "mpl"
    """"mpl": search on a sample, then refinement on the full clouds. "mpe": the paper's Algorithm 1
    with the double sum over all points; a local method that converges from far away."""

    field: FieldMethod = "tree"
    """How "mpe" sums the forces of the target. "tree": distant parts of the target as one point
    (Barnes-Hut), in time N log N. "exact": over all pairs, as the paper prints it, in time N^2."""

    search: Search = "global"
    """How "mpl" finds the coarse pose. "global": search over all poses. "sparse": as the paper
    prints it, Algorithm 1 on a sample, then trimmed ICP; a local method that converges from far
    away."""

    sample_size: int = 1600
    """Number of points of each cloud in the "sparse" search."""

    overlap: float | None = None
    """Share of the source that has a counterpart in the target, in (0, 1]. None: it is unknown."""

    inlier_threshold: float | None = None
    """Largest distance of an inlier pair, in the unit of the input. None: it is estimated from the
    residuals."""

    voxel_size: float | None = None
    """Edge of the cubes to which the clouds are thinned for the search, in the unit of the input;
    the refinement uses a third of it. A larger one averages noise, a smaller one keeps small parts.
    From a thousandth to a fifth of the radius of the smaller cloud. None: 1.5 % of that radius."""

    initial_transform: Matrix | None = None
    """Approximate pose of the source in the target's frame, in the form of the result: 4x4 rigid
    transform, row-major. Also taken are 3x4, one list of 16 or 12 numbers, column-major, and an
    object with quaternion_xyzw or quaternion_wxyz and translation; rounded numbers become the
    nearest rotation. The search keeps within 30 degrees and half a radius of the smaller cloud of
    it, and of poses that fit as well the nearest to it wins; local methods start there."""

    max_rotation_deg: float | None = None
    """Largest angle between initial_transform and the result, in degrees. None: 30."""

    max_translation: float | None = None
    """Largest distance of the source's centre from where initial_transform puts it, in the unit of
    the input. None: half a radius of the smaller cloud."""

    scale: Scale = "fixed"
    """Whether the source may be scaled. "fixed": never; where a refused pair would fit in other
    units, a warning names them. "units": by the factor between two of millimetres, centimetres,
    inches, feet, metres and kilometres where one unit does not fit. "free": by any factor, from
    that of the sizes on. Or [least, most]: by a factor in this range."""

    source_gravity: Vector | None = None
    """Direction of gravity in the source's frame, of any length. With target_gravity, the search
    keeps within 15 degrees of poses that align both."""

    target_gravity: Vector | None = None
    """Direction of gravity in the target's frame, of any length."""

    yaw_only: bool = False
    """Whether both scans are levelled, so that the pose turns about the vertical alone. Gravity
    points along -z, or as given by source_gravity and target_gravity."""

    source_viewpoint: Viewpoints | None = None
    """Position of the scanner in the source's frame; of a cloud merged from several scans a list of
    up to 256 positions, each of which counts for the points nearest to it. With target_viewpoint,
    points that stand in what the other scanner saw through count against a pose, and surfaces that
    were seen from opposite sides are not matched, so that thin parts do not flip."""

    target_viewpoint: Viewpoints | None = None
    """Position of the scanner in the target's frame, or a list of positions."""

    ignore_file_viewpoints: bool = False
    """Whether the scanners' positions that both files tell, one for each scan in them, are not
    used. By default they are where source_viewpoint is not given, and a warning tells so. Arrays
    tell none."""

    infer_viewpoints: InferViewpoints = "auto"
    """Whether the scanners' positions may be told from the clouds. "auto": where no viewpoint is
    given, and both clouds are in the order of one scanner each, as depth cameras and spinning
    scanners write them; or where both show their ground, and each has a place from which hardly any
    of its points is hidden. A warning tells so. "never": it is not looked at."""

    keep_no_data: bool = False
    """Whether rows that look like no measurement are kept: (0, 0, 0) three times or more, values
    far from all others like -9999, beams without echo at the largest range, and all but one of many
    copies of a point. By default they are left out, and a warning tells their number."""

    use_color: UseColor = "auto"
    """Whether intensity or colour may settle the pose. "auto": where both clouds have it, and the
    surfaces alone leave the pose free (a wall, a floor, a tube) or ambiguous; where they settle it,
    colour changes nothing. Gain and offset of the scanners may differ. "never": it is not looked
    at. With scale "fixed" only."""

    max_iterations: int = 100
    """Largest number of iterations of each stage."""

    seed: int = 0
    """Seed of every random choice, 0 or more; the same seed gives the same bits."""

    def __post_init__(self) -> None:
        if self.method not in METHODS:
            raise InvalidOptionsError(f"method must be one of {METHODS}, got {self.method!r}")
        if self.search not in SEARCHES:
            raise InvalidOptionsError(f"search must be one of {SEARCHES}, got {self.search!r}")
        if self.field not in FIELDS:
            raise InvalidOptionsError(f"field must be one of {FIELDS}, got {self.field!r}")
        if self.use_color not in USES_OF_COLOR:
            raise InvalidOptionsError(
                f"use_color must be one of {USES_OF_COLOR}, got {self.use_color!r}"
            )
        if self.infer_viewpoints not in INFERENCES:
            raise InvalidOptionsError(
                f"infer_viewpoints must be one of {INFERENCES}, got {self.infer_viewpoints!r}"
            )
        self._check_scale()
        _check_count("sample_size", self.sample_size, minimum=3)
        _check_count("max_iterations", self.max_iterations, minimum=1)
        _check_count("seed", self.seed, minimum=0)
        _check_positive("overlap", self.overlap, maximum=1)
        _check_positive("inlier_threshold", self.inlier_threshold)
        _check_positive("voxel_size", self.voxel_size)
        for name in ("yaw_only", "keep_no_data", "ignore_file_viewpoints"):
            if not isinstance(getattr(self, name), bool):
                raise InvalidOptionsError(
                    f"{name} must be true or false, got {getattr(self, name)!r}"
                )
        for kind in ("gravity", "viewpoint"):
            self._check_both_given(f"source_{kind}", f"target_{kind}")
        for role in ("source", "target"):
            self._check_gravity(f"{role}_gravity")
            self._check_viewpoints(f"{role}_viewpoint")
        if self.initial_transform is not None:
            self._check_initial_transform()
        _check_positive("max_rotation_deg", self.max_rotation_deg, maximum=180)
        _check_positive("max_translation", self.max_translation)
        for name in ("max_rotation_deg", "max_translation"):
            if getattr(self, name) is not None and self.initial_transform is None:
                raise InvalidOptionsError(f"{name} needs initial_transform: give both or neither")
        self._check_purpose()

    @property
    def is_global(self) -> bool:
        """Whether the pose is searched for among all, and not from a start alone."""
        return self.method == "mpl" and self.search == "global"

    def _check_scale(self) -> None:
        if isinstance(self.scale, str):
            if self.scale not in SCALES:
                raise InvalidOptionsError(
                    f"scale must be one of {SCALES} or [least, most], got {self.scale!r}"
                )
            return
        least, most = _read("scale", lambda: read_numbers(self.scale, (2,)))
        if not 0 < least <= most:
            raise InvalidOptionsError(
                f"scale must be [least, most] with 0 < least <= most, got {self.scale!r}"
            )
        self._replace("scale", (least, most))

    def _check_both_given(self, *names: str) -> None:
        given = [name for name in names if getattr(self, name) is not None]
        if len(given) == 1:
            (missing,) = set(names) - set(given)
            raise InvalidOptionsError(f"{given[0]} needs {missing}: give both or neither")

    def _check_gravity(self, name: str) -> None:
        given = getattr(self, name)
        if given is None:
            return
        gravity = tuple(_read(name, lambda: read_numbers(given, (3,))))
        if gravity == (0, 0, 0):
            raise InvalidOptionsError(f"{name} must be a direction, got the zero vector")
        self._replace(name, gravity)

    def _check_viewpoints(self, name: str) -> None:
        given = getattr(self, name)
        if given is None:
            return
        places = tuple(map(tuple, _read(name, lambda: read_places(given, MAX_VIEWPOINTS))))
        self._replace(name, places[0] if len(places) == 1 else places)

    def _check_initial_transform(self) -> None:
        T = _read("initial_transform", lambda: read_rigid_transform(self.initial_transform))
        self._replace("initial_transform", tuple(map(tuple, T)))

    def _check_purpose(self) -> None:
        """Refuse what the chosen method would ignore."""
        if self.is_global:
            return
        searched = ("max_rotation_deg", "max_translation", "voxel_size")
        for name in ("source_gravity", "source_viewpoint", "yaw_only", "scale", *searched):
            if getattr(self, name) not in (None, False, "fixed"):
                raise InvalidOptionsError(
                    f'{name} needs method "mpl" with search "global", got method'
                    f' "{self.method}" with search "{self.search}"'
                )

    def _replace(self, name: str, value: object) -> None:
        object.__setattr__(self, name, value)  # frozen, but the value is the same


def _check_count(name: str, value: object, minimum: int) -> None:
    if not isinstance(value, int) or isinstance(value, bool) or value < minimum:
        raise InvalidOptionsError(
            f"{name} must be a whole number of at least {minimum}, got {value!r}"
        )


def _check_positive(name: str, value: object, maximum: float = sys.float_info.max) -> None:
    if value is None:
        return
    if not isinstance(value, int | float) or isinstance(value, bool) or not 0 < value <= maximum:
        limit = f" and at most {maximum}" if maximum < sys.float_info.max else ""
        raise InvalidOptionsError(f"{name} must be a number above 0{limit}, got {value!r}")


def _read(name: str, read: Callable[[], NDArray[np.float64]]) -> Any:
    """Return what is read as lists of numbers; errors begin with the name of the option."""
    try:
        return read().tolist()
    except ValueError as error:
        raise InvalidOptionsError(f"{name} {error}") from None
