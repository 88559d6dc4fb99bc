"""Warnings of a registration, in words."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mpe_core.assess.confidence import CONVINCING_LAYER_SUPPORT, Evidence
from mpe_core.assess.motion_words import describe_alternatives, describe_free_directions
from mpe_core.clouds.full_sight import FullSight
from mpe_core.clouds.no_data import Kind
from mpe_core.clouds.normalize import CloudPair
from mpe_core.result import CodedWarning, Registration, WarningCode

NO_DATA_TEXTS: dict[Kind, str] = {
    "zeros": "they are (0, 0, 0), which stands for no measurement",
    "far": "they lie far from all others, like -9999 and other values for no measurement",
    "copies": "they repeat one point many times, as values for no measurement do",
    "shell": "they lie on a sphere around the scanner, as beams without echo at the largest range",
}
"""What rows of each kind are."""

NO_DATA_CODES: dict[Kind, WarningCode] = {
    "zeros": "rows_zeros",
    "far": "rows_far",
    "copies": "rows_copies",
    "shell": "rows_shell",
}
"""Codes of their warnings."""

MAX_QUIET_VIOLATION = 0.1
"""Violation of free space up to which nothing is said: more than at nearly all right poses."""


def describe_warnings(
    pair: CloudPair,
    evidence: Evidence,
    result: Registration,
    sights: tuple[FullSight, FullSight] | None = None,
    *,
    is_on_plane: bool = False,
) -> tuple[CodedWarning, ...]:
    """Say what a caller should know before using the result.

    Parameters
    ----------
    pair
        Clouds that were registered.
    evidence
        Evidence for the resulting pose.
    result
        Result, its own warnings aside.
    sights
        Places of full sight in source and target that stand for viewpoints, if any do.
    is_on_plane
        Whether the clouds fit, but are refused since what both show is one plane.
    """
    return (
        *_about_clouds(pair),
        *_about_sights(sights),
        *_about_convergence(result),
        *(() if is_on_plane else _about_trust(evidence)),
        *_about_ambiguity(pair, result, is_on_plane=is_on_plane),
        *_about_inliers(result),
    )


def _about_clouds(pair: CloudPair) -> Iterator[CodedWarning]:
    for name, cloud in (("source", pair.source_cloud), ("target", pair.target_cloud)):
        if cloud.dropped_rows:
            yield CodedWarning(
                "rows_not_finite",
                f"{cloud.dropped_rows} rows of the {name} were ignored: they hold NaN or infinity",
            )
        for left_out in cloud.no_data:
            yield CodedWarning(
                NO_DATA_CODES[left_out.kind],
                f"{left_out.count} rows of the {name} were left out:"
                f" {NO_DATA_TEXTS[left_out.kind]}; set keep_no_data to keep them",
            )


def _about_sights(sights: tuple[FullSight, FullSight] | None) -> Iterator[CodedWarning]:
    if sights is not None:
        yield CodedWarning(
            "viewpoints_inferred",
            "nobody told where the scanners stood, but there is a place from which"
            f" {sights[0].certainty:.1%} of the source's points are seen, and one for"
            f" {sights[1].certainty:.1%} of the target's; what lies between is taken to be free. If"
            ' that is wrong, give both viewpoints, or set infer_viewpoints to "never"',
        )


def _about_convergence(result: Registration) -> Iterator[CodedWarning]:
    if not result.converged:
        yield CodedWarning(
            "not_converged",
            f"not converged after {result.iterations} iterations: raise max_iterations, or check"
            " that the clouds show the same thing",
        )


def _about_trust(evidence: Evidence) -> Iterator[CodedWarning]:
    if evidence.accepted:
        return
    reason = (
        "but so they nearly do at different poses; give the scanners' places or a rough"
        " initial_transform, or scan something that stands out"
        if evidence.convinces
        else "the clouds may overlap too little, or show different things"
    )
    yield CodedWarning(
        "low_confidence",
        f"low confidence, do not trust this pose: {evidence.coverage:.0%} of the points lie near"
        f" the target, and {evidence.surface_agreement:.0%} of the overlapping ones"
        f" (chance-corrected) lie on its surface; {reason}",
    )
    yield from _about_contradictions(evidence)


def _about_contradictions(evidence: Evidence) -> Iterator[CodedWarning]:
    violation, support = evidence.free_space_violation, evidence.layer_support
    if violation is not None and violation > MAX_QUIET_VIOLATION:
        yield CodedWarning(
            "free_space",
            f"{violation:.0%} of the visible points of one scan stand where the other scanner saw"
            " through: check the viewpoints, or give a rough initial_transform",
        )
    if support is not None and support < CONVINCING_LAYER_SUPPORT:
        yield CodedWarning(
            "layers",
            "seen from above, what stands on the ground matches better at another pose: the scene"
            " repeats, or the clouds have too little in common; give the viewpoints, or a rough"
            " initial_transform",
        )


def _about_ambiguity(
    pair: CloudPair, result: Registration, *, is_on_plane: bool
) -> Iterator[CodedWarning]:
    if result.ambiguous:
        differ = describe_alternatives(
            result.T_target_source, result.alternatives, pair.source_centre
        )
        yield CodedWarning(
            "ambiguous",
            f"{len(result.alternatives)} other poses fit as well (see alternatives), for instance"
            f" {differ}: the shape is symmetric or repeats, or shows too little that tells them"
            " apart",
        )
    if len(result.free_directions):
        unit = result.free_directions / np.array([1.0] * 3 + [pair.unit] * 3)
        yield CodedWarning(
            "free_directions",
            f"the pose is undetermined in {len(result.free_directions)} of 6 directions (see"
            f" free_directions): the source {describe_free_directions(unit)}"
            + ("; not accepted: one plane is all that both show" if is_on_plane else ""),
        )


def _about_inliers(result: Registration) -> Iterator[CodedWarning]:
    if not len(result.inliers):
        yield CodedWarning(
            "no_inliers",
            "no source point is within the inlier threshold"
            f" {result.inliers.threshold:.6g} of the target",
        )
