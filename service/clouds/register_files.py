"""Registration of two decoded files, with all that they tell beside their points."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

from mpe_core.options import RegistrationOptions
from service.clouds.file_rows import in_file_rows
from service.formats import DecodedCloud, common_brightness

if TYPE_CHECKING:
    from mpe_core import Registration


def register_files(
    source: DecodedCloud,
    target: DecodedCloud,
    options: RegistrationOptions,
    on_progress: Callable[[str, float], None] | None,
) -> Registration:
    """Register the points with their weights and brightness; inliers are rows of the files.

    Raises
    ------
    mpe_core.RegistrationError
        The clouds cannot be registered.
    """
    from mpe_core import register  # loads the kernels, which the service itself must not

    source_colors, target_colors = common_brightness(source, target)
    registration = register(
        source.points,
        target.points,
        options,
        source_weights=source.weights,
        target_weights=target.weights,
        source_colors=source_colors,
        target_colors=target_colors,
        on_progress=on_progress,
    )
    return replace(registration, inliers=in_file_rows(registration.inliers, source, target))
