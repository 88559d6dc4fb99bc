"""Options are checked when they are made, and compared by value."""

import numpy as np
import pytest

from mpe_core import InvalidOptionsError, RegistrationOptions

PLACE = {"target_viewpoint": (0, 0, 0)}


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"method": "icp"}, r"method must be one of \('mpl', 'mpe'\), got 'icp'"),
        ({"field": "grid"}, r"field must be one of \('tree', 'exact'\), got 'grid'"),
        ({"search": "local"}, "search must be one of"),
        ({"seed": -1}, "seed must be a whole number of at least 0, got -1"),
        ({"sample_size": 2}, "sample_size must be a whole number of at least 3, got 2"),
        ({"overlap": 1.5}, "overlap must be a number above 0 and at most 1, got 1.5"),
        ({"inlier_threshold": 0}, "inlier_threshold must be a number above 0, got 0"),
        ({"source_viewpoint": (0, 0, 1)}, "source_viewpoint needs target_viewpoint: give both"),
        (PLACE | {"source_viewpoint": (0, 1)}, "source_viewpoint must be 3 finite numbers, or a"),
        (PLACE | {"source_viewpoint": ()}, r"a list of 1 to 256 times 3, got \(\)"),
        (PLACE | {"source_viewpoint": [(0, 1)]}, r"a list of 1 to 256 times 3, got \[\(0, 1\)\]"),
        (PLACE | {"source_viewpoint": np.zeros((257, 3)).tolist()}, "got 257 times: .{80}[.]{3}$"),
        (PLACE | {"source_viewpoint": [(0, 1, np.nan)]}, "must be 3 finite numbers, or a list"),
        (PLACE | {"source_viewpoint": [(0, 1, 1e16)]}, "at most 1e[+]15, got 1e[+]16"),
        ({"initial_transform": 1e16 * np.eye(4)}, "at most 1e[+]15, got 1e[+]16"),
    ],
)
def test_messages_say_what_was_expected_and_what_came(options, message):
    with pytest.raises(InvalidOptionsError, match=message):
        RegistrationOptions(**options)


def test_arrays_and_lists_become_tuples_that_compare_and_hash():
    one = RegistrationOptions(source_gravity=np.array([0, 0, -1]), target_gravity=[0, 0, -2])
    other = RegistrationOptions(source_gravity=(0, 0, -1), target_gravity=(0, 0, -2))
    assert one == other
    assert hash(one) == hash(other)
    assert one.source_gravity == (0.0, 0.0, -1.0)


def test_several_viewpoints_become_tuples_and_one_stays_one():
    several = RegistrationOptions(source_viewpoint=np.eye(3)[:2], **PLACE)
    assert several == RegistrationOptions(source_viewpoint=[[1, 0, 0], [0, 1, 0]], **PLACE)
    assert several.source_viewpoint == ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    one = RegistrationOptions(source_viewpoint=[[1, 2, 3]], **PLACE)
    assert one == RegistrationOptions(source_viewpoint=(1, 2, 3), **PLACE)
    assert hash(one) != hash(several)


def test_options_cannot_be_changed():
    with pytest.raises(AttributeError):
        RegistrationOptions().seed = 1


@pytest.mark.parametrize("local", [{"method": "mpe"}, {"search": "sparse"}])
@pytest.mark.parametrize("name", ["voxel_size", "yaw_only"])
def test_what_the_method_would_ignore_is_refused(local, name):
    with pytest.raises(InvalidOptionsError, match=f"{name} needs method"):
        RegistrationOptions(**local, **{name: True if name == "yaw_only" else 0.1})
