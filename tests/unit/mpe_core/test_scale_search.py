"""The scale is fixed, one of units, or free; a refusal names what would fit."""

from types import SimpleNamespace

import numpy as np
import pytest

from mpe_core import InvalidOptionsError, RegistrationOptions, register, scale_search
from mpe_core.assess.confidence import Evidence
from mpe_core.clouds.scan_order import infer_viewpoint
from mpe_core.geometry.rigid import apply
from tests.factories.checks import assert_pose_close
from tests.factories.clouds import knot, moved, real_pair


def trial(seed=0, noise=0.002):
    rng = np.random.default_rng(seed)
    return moved(knot(4000, rng), rng, largest_deg=180, noise=noise)


def similarity(found):
    return np.vstack([found.T_target_source[:3] / [*[found.scale] * 3, 1], [0, 0, 0, 1]])


@pytest.mark.parametrize(
    ("factor", "words"),
    [
        (10, "in centimetres and the target in milli"),
        (1 / 3.28084, "in feet and the target in metres"),
    ],
)
def test_a_refusal_names_the_units_that_fit(factor, words):
    pair = trial()
    found = register(pair.source, pair.target * factor)
    assert not found.accepted
    assert found.scale == 1
    (text,) = [text for text in found.warnings if "times as large" in text]
    assert words in text


@pytest.mark.parametrize(("factor", "unit"), [(0.3048, "feet"), (1000, "milli"), (1, None)])
def test_units_are_tried(factor, unit):
    pair = trial(1)
    found = register(pair.source, pair.target * factor, RegistrationOptions(scale="units"))
    assert found.accepted
    assert found.scale == pytest.approx(factor)
    assert (unit is None) == (not found.warnings)
    assert unit is None or unit in found.warnings[0]
    T = similarity(found)
    T[:3, 3] /= factor
    assert_pose_close(T, pair.T_target_source, pair.source, degrees=0.5, shift=0.01)


@pytest.mark.parametrize("factor", [0.37, 1.12, 40])
@pytest.mark.parametrize("is_range", [False, True])
def test_a_free_scale_is_estimated(factor, is_range):
    pair = trial(2)
    scale = (0.6 / factor, 1.9 / factor) if is_range else "free"
    source = pair.source * factor
    found = register(source, pair.target, RegistrationOptions(scale=scale))
    assert found.accepted
    assert found.scale * factor == pytest.approx(1, abs=2e-3)
    assert 0 < found.scale_deviation * factor < 0.01
    there = apply(pair.T_target_source, pair.source)
    here = apply(found.T_target_source, source)
    assert np.linalg.norm(here - there, axis=1).max() < 0.02


@pytest.mark.parametrize(("scale", "factor"), [("units", 1000), ("free", 3.7)])
def test_the_viewpoint_is_scaled_with_the_source(data, scale, factor):
    trial = real_pair(data, "bunnyreal_1_0")
    places = [infer_viewpoint(cloud).position for cloud in (trial.source, trial.target)]
    source, target = (tuple(place) for place in places)
    known = {"source_viewpoint": source, "target_viewpoint": target}
    alike = register(trial.source, trial.target, RegistrationOptions(scale=scale, **known))
    known["source_viewpoint"] = tuple(factor * np.array(source))
    options = RegistrationOptions(scale=scale, **known)
    found = register(factor * trial.source, trial.target, options)
    assert found.scale == pytest.approx(alike.scale / factor, rel=1e-3)
    assert found.confidence == pytest.approx(alike.confidence, abs=0.01)


def test_a_wrong_scale_is_not_accepted_in_silence(data):
    pair = real_pair(data, "kitti10m_000")
    found = register(pair.source * 0.93, pair.target)
    assert not found.accepted
    assert any("scaled by 1.07" in text for text in found.warnings)


def test_mirrored_clouds_are_named():
    pair = trial(3)
    found = register(pair.source * [1, -1, 1], pair.target)
    assert not found.accepted
    assert any("mirror images" in text for text in found.warnings)


@pytest.mark.parametrize(("explained", "is_named"), [(0.1, False), (1.0, True)])
def test_a_mirror_image_that_explains_less_is_no_cause(explained, is_named, monkeypatch):
    other, pair = knot(4000, np.random.default_rng(8)) * [1, 2, 0.5], trial(3)
    convincing = Evidence(
        coverage=0.4,
        on_surface_fraction=explained,
        surface_agreement=1.0,
        shape_correlation=0.9,
    )
    mirrored = SimpleNamespace(best=SimpleNamespace(evidence=convincing))
    monkeypatch.setattr(scale_search, "_search_mirrored", lambda *_: mirrored)
    found = register(other, pair.target)
    assert not found.accepted
    assert any("mirror images" in text for text in found.warnings) == is_named


def test_an_accepted_pose_is_refused_where_the_mirror_image_fits_clearly_better(data):
    pair = real_pair(data, "goicp_demo")
    found = register(pair.source * [-1, 1, 1], pair.target)
    assert not found.accepted
    assert [warning.code for warning in found.warnings][-1] == "mirrored"


@pytest.mark.parametrize("scale", ["feet", (0, 1), (2, 1), (1, 2, 3), 5])
def test_what_is_no_scale_is_refused(scale):
    with pytest.raises(InvalidOptionsError, match="scale must be"):
        RegistrationOptions(scale=scale)
