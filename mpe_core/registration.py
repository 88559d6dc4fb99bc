"""Registration of a source cloud onto a target cloud."""

from __future__ import annotations

from dataclasses import replace

from numpy.typing import ArrayLike

from mpe_core.clouds.scan_order import infer_viewpoint
from mpe_core.clouds.validate import Cloud, validate_cloud
from mpe_core.kernels import on_usable_cores
from mpe_core.options import RegistrationOptions
from mpe_core.progress import Progress, StageCallback
from mpe_core.result import CodedWarning, Registration
from mpe_core.scale_search import register_scaled


@on_usable_cores()
def register(
    source: ArrayLike,
    target: ArrayLike,
    options: RegistrationOptions | None = None,
    *,
    source_weights: ArrayLike | None = None,
    target_weights: ArrayLike | None = None,
    source_colors: ArrayLike | None = None,
    target_colors: ArrayLike | None = None,
    on_progress: StageCallback | None = None,
) -> Registration:
    """Find the pose that lays the source on the target.

    The input is never changed. Rows with NaN or infinity are ignored, and those that stand for no
    point: (0, 0, 0) or -9999 without a measurement, echoes at the largest range, copies. The same
    input, options and seed give the same bits, on any number of threads.

    Parameters
    ----------
    source, target
        (N, 3) and (M, 3) points, in one unit of length.
    options
        Options of the registration; None for the defaults.
    source_weights, target_weights
        (N,) and (M,) weights of the points, 0 or more and in any unit: K_i of the paper. Points of
        weight 0 do not influence the pose, but may be inliers.
    source_colors, target_colors
        (N,) and (M,) intensities, or (N, 3) and (M, 3) colours, in any unit. Where both are given,
        they settle what the surfaces leave free; see `use_color` of the options.
    on_progress
        Called as on_progress(stage, fraction of the whole in [0, 1]) between stages and between the
        iterations of long ones. An exception that it raises ends the registration.

    Returns
    -------
    Registration
        The pose, and how far to trust it.

    Raises
    ------
    InvalidCloudError
        If a cloud is not an (N, 3) array of at least 3 finite points that span a plane, or its
        weights do not fit.
    InvalidOptionsError
        If an option cannot go with these clouds.

    Examples
    --------
    A wavy sheet, turned by 37 degrees about z and shifted:

    >>> import numpy as np
    >>> from mpe_core import register
    >>> x, y = np.random.default_rng(0).uniform(-1, 1, (2, 5000))
    >>> target = np.column_stack([x, y, 0.3 * np.sin(3 * x + y) + 0.1 * x * y])
    >>> R = np.array([[0.8, -0.6, 0], [0.6, 0.8, 0], [0, 0, 1]])
    >>> source = (target - [5, 0, 2]) @ R  # so that target = R source + (5, 0, 2)
    >>> result = register(source, target)
    >>> result.accepted
    True
    >>> bool(np.allclose(result.T_target_source[:3, :3], R, atol=1e-3))
    True
    >>> result.T_target_source[:3, 3].round(2) + 0.0
    array([5., 0., 2.])
    """
    options, progress = options or RegistrationOptions(), Progress(on_progress)
    with progress.stage("prepare"):
        clouds = [
            validate_cloud(
                cloud,
                name,
                weights,
                keep_no_data=options.keep_no_data,
                viewpoints=viewpoints,
                colors=colors,
            )
            for cloud, name, weights, viewpoints, colors in (
                (source, "source", source_weights, options.source_viewpoint, source_colors),
                (target, "target", target_weights, options.target_viewpoint, target_colors),
            )
        ]
        options, notices = _with_inferred_viewpoints(options, *clouds)
    found = register_scaled(clouds[0], clouds[1], options, progress)
    return replace(found, warnings=(*notices, *found.warnings)) if notices else found


def _with_inferred_viewpoints(
    options: RegistrationOptions, source: Cloud, target: Cloud
) -> tuple[RegistrationOptions, tuple[CodedWarning, ...]]:
    """Add the scanners' places that the order of both clouds tells, and say so."""
    is_asked = options.infer_viewpoints == "auto" and options.source_viewpoint is None
    if not (options.is_global and is_asked):
        return options, ()
    x = infer_viewpoint(source.points)
    y = None if x is None else infer_viewpoint(target.points)
    if x is None or y is None:
        return options, ()
    places = [
        "({:.6g}, {:.6g}, {:.6g})".format(*each.position) + f" (certainty {each.certainty:.2f})"
        for each in (x, y)
    ]
    notice = CodedWarning(
        "viewpoints_inferred",
        f"the order of the points tells where the scanners stood, {places[0]} in the source and"
        f" {places[1]} in the target, and this is used; if it is wrong, set infer_viewpoints to"
        ' "never"',
    )
    return replace(options, source_viewpoint=x.position, target_viewpoint=y.position), (notice,)
