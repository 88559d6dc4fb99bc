"""A rigid transform is read in the forms that people write, and rounded ones are mended."""

import numpy as np
import pytest

from mpe_core.geometry.rigid import pose, rotation_error
from mpe_core.geometry.transform_forms import read_rigid_transform
from mpe_core.geometry.validation import is_rigid
from tests.factories.clouds import random_rotation


def transform(seed, reach=50.0):
    rng = np.random.default_rng(seed)
    return pose(random_rotation(rng), rng.uniform(-reach, reach, 3))


@pytest.mark.parametrize("seed", range(5))
def test_every_form_is_the_same_transform(seed):
    T = transform(seed)
    forms = (
        T,
        T.tolist(),
        T[:3],
        T.ravel().tolist(),
        T[:3].ravel(),
        T.T,
        T.T.ravel(),
        T[:3].T.ravel(),
        T[:3].T,
        tuple(map(tuple, T)),
    )
    for form in forms:
        assert (read_rigid_transform(form) == T).all()


@pytest.mark.parametrize("seed", range(5))
def test_a_quaternion_and_a_translation_are_read(seed):
    from scipy.spatial.transform import Rotation

    T = transform(seed)
    x, y, z, w = Rotation.from_matrix(T[:3, :3]).as_quat()
    for name, q in (("quaternion_xyzw", (x, y, z, w)), ("quaternion_wxyz", [w, x, y, z])):
        read = read_rigid_transform({name: q, "translation": T[:3, 3].tolist()})
        np.testing.assert_allclose(read, T, atol=1e-12)


def test_rows_come_first_where_there_is_no_translation():
    T = transform(0, reach=0)
    assert (read_rigid_transform(T.ravel()) == T).all()


@pytest.mark.parametrize("digits", [2, 3, 4, 6])
def test_rounded_poses_become_the_nearest_rotation(digits):
    T = transform(digits)
    read = read_rigid_transform(np.round(T, digits))
    assert is_rigid(read)
    assert rotation_error(read, T) < 60 * 10.0**-digits
    assert (read[:3, 3] == np.round(T, digits)[:3, 3]).all()


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (2 * np.eye(4), "must be rigid"),
        (np.diag([2, 2, 2, 1]), "scale of 2: scale the cloud"),
        (np.diag([1, 1, -1, 1]), "must be rigid"),
        (np.diag([-1, -1, -1, 1]), "it mirrors"),
        (np.diag([1, 1, 1.1, 1]), "must be rigid"),
        ([0, 0, 0, 1, 1, 2, 3], "where its 7 numbers belong"),
        (list("abcdefghijklmnop"), "must be 4x4 or 3x4"),
        ([["1", 0, 0, 0]] * 4, "must be 4x4 or 3x4"),
        (True, "must be 4x4 or 3x4"),
        ({"quaternion_xyzw": [0, 0, 0, 1]}, "got an object with quaternion_xyzw"),
        ({"quaternion_xyzw": [0, 0, 0, 2], "translation": [0, 0, 0]}, "length 1, got one of 2"),
        ({"quaternion_xyzw": [0, 0, 1], "translation": [0, 0, 0]}, "expected 4 finite numbers"),
        (np.full((4, 4), np.nan), "of finite numbers"),
        (np.diag([1, 1, 1, 1]) + np.eye(4, k=3) * 1e16, "at most 1e[+]15"),
    ],
)
def test_what_is_none_says_what_to_send(value, text):
    with pytest.raises(ValueError, match=text):
        read_rigid_transform(value)
