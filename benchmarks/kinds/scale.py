"""Units, scale, hands, given poses, and degrees."""

from __future__ import annotations

import numpy as np

from benchmarks.kinds.case import Case, Maker, body
from mpe_core import RegistrationOptions
from tests.factories.parts import comb

UNITS = (0.001, 0.0254, 0.3048, 10.0, 1000.0)


def _units(rng: np.random.Generator) -> Case:
    return Case(
        body(rng) / rng.choice(UNITS), body(rng), options=RegistrationOptions(scale="units")
    )


def _other_units(rng: np.random.Generator) -> Case:
    return Case(body(rng) / rng.choice(UNITS), body(rng), fits=False, named="other_units")


def _free_scale(rng: np.random.Generator) -> Case:
    options = RegistrationOptions(scale="free")
    return Case(body(rng) / rng.uniform(0.2, 5), body(rng), options=options)


def _mirrored(rng: np.random.Generator) -> Case:
    return Case(body(rng) * (-1, 1, 1), body(rng), fits=False, named="mirrored")


def _start(rng: np.random.Generator) -> Case:
    return Case(comb(rng, 4), comb(rng, 0), has_start=True)


def _degrees(rng: np.random.Generator) -> Case:
    place = np.array([rng.uniform(5, 15), rng.uniform(45, 55), 300])
    ground = rng.uniform(-1, 1, (5000, 3)) * (0.004, 0.004, 20) + place
    return Case(ground, ground, fits=False, named="degrees")


SCALE: dict[str, Maker] = {
    "other units, scale units": _units,
    "other units, scale fixed": _other_units,
    "any scale": _free_scale,
    "mirrored": _mirrored,
    "equal bays, the start given to four digits": _start,
    "longitude and latitude": _degrees,
}
