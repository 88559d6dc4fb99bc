"""Clouds as they come: kinds of trouble in the input, each over random starts."""

from __future__ import annotations

import numpy as np

from benchmarks.experiment import Experiment, Result, markdown
from benchmarks.kinds.case import Array, Case, Maker
from benchmarks.kinds.colors import COLORS
from benchmarks.kinds.few import FEW
from benchmarks.kinds.parts import PARTS
from benchmarks.kinds.scale import SCALE
from benchmarks.kinds.values import VALUES
from mpe_core import Registration, RegistrationOptions, register
from mpe_core.geometry.rigid import apply, inverse, pose, rotation_error
from service.formats import CloudFileError
from service.formats.degrees import refuse_degrees
from tests.factories.clouds import random_rotation

KINDS: dict[str, Maker] = VALUES | FEW | PARTS | SCALE | COLORS
SEEDS = 20

MAX_OFF = 0.05
"""Distance from its place, over the size of the source, up to which a pose is right."""

MAX_BETWEEN_DEG, MAX_BETWEEN = 1.0, 0.01
"""Difference between a pose and the inverse of that the other way round, up to which they agree;
the shift over the size of the source."""


def run() -> Result:
    """Measure, and return the figures that the page shows."""
    rows = []
    for kind, make in KINDS.items():
        rows.append({"kind": kind} | _count(make))
        print(rows[-1], flush=True)
    return {"rows": rows}


def _count(make: Maker) -> Result:
    tally = {"right": 0, "wrong accepted": 0, "right refused": 0, "refused": 0, "named": 0}
    for seed in range(SEEDS):
        rng = np.random.default_rng(seed)
        judged, is_named = _try(make(rng), rng)
        tally[judged] += 1
        tally["named"] += is_named
    return {"starts": SEEDS} | tally


def _try(case: Case, rng: np.random.Generator) -> tuple[str, bool]:
    """Register the clouds of a case; whether its cause was named comes along."""
    truth = pose(random_rotation(rng), rng.uniform(-2, 2, 3))
    source = apply(inverse(truth), case.there)
    if case.named == "degrees":
        return _read_degrees(case.there)
    given = source if case.rows is None else np.vstack([source, case.rows])
    options = case.options
    if case.has_start:
        options = RegistrationOptions(initial_transform=np.round(truth, 4).tolist())
    light = case.colors or (None, None)
    found = register(given, case.target, options, source_colors=light[0], target_colors=light[1])
    is_named = any(warning.code == case.named for warning in found.warnings)
    if not case.fits:
        is_wrong = found.accepted and not (found.ambiguous or len(found.free_directions))
        return ("wrong accepted" if is_wrong else "refused"), is_named
    judged = _judge(found, source, case.there)
    if judged == "right" and case.both_ways and not _agrees(found, given, case.target):
        judged = "right refused"
    return judged, is_named


def _read_degrees(points: Array) -> tuple[str, bool]:
    try:
        refuse_degrees(points)
    except CloudFileError:
        return "refused", True
    return "wrong accepted", False


def _judge(found: Registration, source: Array, there: Array) -> str:
    T, wanted = found.T_target_source, there * found.scale
    here = np.einsum("ij,nj->ni", T[:3, :3], source) + T[:3, 3]
    off = float(np.sqrt(np.square(here - wanted).sum(axis=1).mean()))
    is_right = off < MAX_OFF * np.ptp(wanted, axis=0).max()
    if found.accepted and not (len(found.free_directions) and not is_right):
        return "right" if is_right else "wrong accepted"
    return "right refused" if is_right else "refused"


def _agrees(found: Registration, source: Array, target: Array) -> bool:
    """Whether the target on the source gives the inverse pose, and is accepted, too."""
    other = register(target, source)
    there, back = found.T_target_source, inverse(other.T_target_source)
    centre = source[:1000].mean(axis=0)[None]
    shift = np.linalg.norm(apply(there, centre) - apply(back, centre))
    size = np.ptp(source[:1000], axis=0).max()
    is_near = rotation_error(there, back) < MAX_BETWEEN_DEG and shift < MAX_BETWEEN * size
    return bool(other.accepted and is_near)


def table(result: Result) -> str:
    """Return the page's text and tables in Markdown."""
    names = list(result["rows"][0])
    rows = [tuple(row[name] for name in names) for row in result["rows"]]
    return (
        f"Generated clouds, {SEEDS} random starts each; a pose is right that puts the source "
        f"within {MAX_OFF:.0%} of its size of its place, and where a kind says both ways, if the "
        "target on the source gives the same. A wrong one that is said to be free counts as "
        "refused. Unlike clouds are to be refused, or to be said free or ambiguous; `named` are "
        "those whose cause a warning names.\n\n" + markdown(names, rows)
    )


KINDS_EXPERIMENT = Experiment("kinds", "Clouds as they come", run, table)
