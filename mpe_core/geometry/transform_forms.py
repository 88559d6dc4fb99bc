"""Rigid transforms in the forms that people write them.

The options import this module, so it must not load the compiled kernels.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mpe_core.geometry.validation import MAX_COORDINATE, is_rigid, is_rotation
from mpe_core.geometry.vector_forms import as_array, check_size

Array = NDArray[np.float64]

ROUNDING_TOL = 1e-2
"""Largest difference of an entry from the nearest rotation's: poses printed with three digits."""

BOTTOM_ROW = np.array([0.0, 0.0, 0.0, 1.0])
QUATERNIONS = {"quaternion_xyzw": (0, 1, 2, 3), "quaternion_wxyz": (1, 2, 3, 0)}
"""Keys of a quaternion, and where its x, y, z and w are."""

FORMS = (
    "4x4 or 3x4 numbers (rows, or one list of 16 or 12), or an object with quaternion_xyzw or"
    " quaternion_wxyz and translation"
)


def read_rigid_transform(value: Any) -> Array:
    """Read a rigid transform and round it to the nearest one.

    Parameters
    ----------
    value
        Matrix of 4x4 or 3x4 numbers, as rows or as one list of them; the translation may also be
        the last row (column-major). Or a mapping with `quaternion_xyzw` or `quaternion_wxyz` and
        `translation`.

    Returns
    -------
    (4, 4) transform; the very numbers if they are rigid.

    Raises
    ------
    ValueError
        It has none of these forms, or is not rigid; the text says what to send.
    """
    if isinstance(value, Mapping):
        return _from_quaternion(value)
    matrices = [M for M in _matrices(_numbers(value)) if is_nearly_rigid(M)]
    if len(matrices) > 1 and np.size(value) == 12:
        raise ValueError("must be told row by row: its 12 numbers are a pose either way, send 4x4")
    return _nearest_rigid(matrices[0]) if matrices else _refuse(_matrices(_numbers(value))[0])


def is_nearly_rigid(T: Array) -> bool:
    """Whether a (4, 4) matrix is rigid within ROUNDING_TOL."""
    if np.abs(T[3] - BOTTOM_ROW).max() > ROUNDING_TOL * 1e-3:
        return False
    R = _nearest_rotation(T[:3, :3])
    return bool(np.abs(T[:3, :3] - R).max() <= ROUNDING_TOL)


def _numbers(value: Any) -> Array:
    if not _are_numbers(value):
        raise ValueError(f"must be {FORMS}, got {_shown(value)}")
    array = as_array(value)
    if array.shape == (7,):
        raise ValueError(
            "must say where its 7 numbers belong: send an object with quaternion_xyzw (or"
            " quaternion_wxyz) and translation"
        )
    if array.shape not in {(4, 4), (3, 4), (4, 3), (16,), (12,)} or not np.isfinite(array).all():
        raise ValueError(f"must be {FORMS}, of finite numbers, got {_shown(value)}")
    return check_size(array)


def _are_numbers(value: Any) -> bool:
    if isinstance(value, np.ndarray):
        return value.dtype.kind in "iuf"
    if isinstance(value, Sequence) and not isinstance(value, str | bytes):
        return all(_are_numbers(item) for item in value)
    return isinstance(value, int | float | np.number) and not isinstance(value, bool)


def _matrices(array: Array) -> list[Array]:
    """Read the numbers as (4, 4): row-major first, then column-major."""
    if array.shape == (4, 3):
        return [_with_bottom(array.T)]
    if array.size == 12:
        rows = [_with_bottom(array.reshape(3, 4))]
        return rows if array.ndim == 2 else [*rows, _with_bottom(array.reshape(4, 3).T)]
    T = array.reshape(4, 4)
    return [T, T.T.copy()]


def _with_bottom(top: Array) -> Array:
    return np.vstack([top, BOTTOM_ROW])


def _nearest_rotation(M: Array) -> Array:
    U, _, Vt = np.linalg.svd(M)
    R: Array = U @ np.diag([1, 1, np.sign(np.linalg.det(U @ Vt))]) @ Vt
    return R


def _nearest_rigid(T: Array) -> Array:
    if is_rigid(T):
        return T
    rigid = np.eye(4)
    rigid[:3, :3], rigid[:3, 3] = _nearest_rotation(T[:3, :3]), T[:3, 3]
    return rigid


def _refuse(T: Array) -> Array:
    scale = np.cbrt(abs(np.linalg.det(T[:3, :3])))
    hint = ""
    if scale > 0 and is_rotation(T[:3, :3] / scale):
        hint = f"; it has a scale of {scale:.6g}: scale the cloud, and divide these 3x3 numbers"
    elif scale > 0 and is_rotation(-T[:3, :3] / scale):
        hint = "; it mirrors (its determinant is below 0): mirror the cloud instead"
    raise ValueError(
        "must be rigid: a rotation and a translation above the row 0 0 0 1, without scale, got"
        f" {T.tolist()}{hint}"
    )


def _from_quaternion(value: Mapping[Any, Any]) -> Array:
    names = [name for name in QUATERNIONS if name in value]
    if len(names) != 1 or set(value) != {names[0], "translation"}:
        raise ValueError(f"must be {FORMS}, got an object with {', '.join(map(str, value))}")
    q, t = (_vector(value[name], size) for name, size in ((names[0], 4), ("translation", 3)))
    length = float(np.linalg.norm(q))
    if abs(length - 1) > ROUNDING_TOL:
        raise ValueError(f"must have a quaternion of length 1, got one of {length:.6g}")
    x, y, z, w = q[list(QUATERNIONS[names[0]])] / length
    T = np.eye(4)
    T[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    T[:3, 3] = t
    return T


def _vector(value: Any, size: int) -> Array:
    array = np.asarray(value, np.float64) if _are_numbers(value) else np.empty(0)
    if array.shape != (size,) or not np.isfinite(array).all():
        raise ValueError(f"must be {FORMS}; expected {size} finite numbers, got {_shown(value)}")
    if np.abs(array).max() > MAX_COORDINATE:
        raise ValueError(f"must hold numbers of at most {MAX_COORDINATE:g}, got {value!r}")
    return array


def _shown(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 200 else f"{text[:200]}..."
