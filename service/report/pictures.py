"""Pictures of a registration: before and after, and coloured by distance from four sides."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from service.report.lettering import write_word
from service.report.picture import (
    WHITE,
    Image,
    View,
    color_by_value,
    draw_points,
    encode_png,
    join_rows,
    thin,
)

SOURCE_COLOR, TARGET_COLOR = (225, 110, 20), (55, 110, 180)
"""Orange and blue, which people with any colour vision tell apart."""
VIEWS = {"ISO": View(-60, 25), "FRONT": View(-90, 0), "TOP": View(-90, 89.9)}
SIDES = tuple(View(azimuth, 25) for azimuth in (-135, -45, 45, 135))
_BEFORE_AFTER_SIZE, _SIDE_SIZE = (400, 306), (480, 360)
_TITLE_HEIGHT, _TITLE_TOP = 24, 6
_MAX_GAP = 3.0
"""Distance of the clouds in radii of the larger one, from which on `before` shows the source beside
the target instead of where its file has it: two dots in an empty picture say nothing."""


def draw_before_after(
    source: NDArray[np.float64], moved: NDArray[np.float64], target: NDArray[np.float64]
) -> bytes:
    """Draw both clouds as their files have them and aligned, from fixed sides, as PNG.

    Parameters
    ----------
    source, moved : (N, 3)
        The source before and after; rows that are not finite are left out.
    target : (M, 3)
        The target.
    """
    source_rows, fixed = thin(source), target[thin(target)]
    rows = []
    for word, points in (("BEFORE", source[source_rows]), ("AFTER", moved[source_rows])):
        placed = _bring_near(points, fixed) if word == "BEFORE" else points
        row = [_draw_both(placed, fixed, view) for view in VIEWS.values()]
        rows.append(
            [_title(image, f"{word} {name}") for image, name in zip(row, VIEWS, strict=True)]
        )
    left = write_word(rows[0][0], "SOURCE", 190, _TITLE_TOP, SOURCE_COLOR)
    write_word(rows[0][0], "TARGET", left + 12, _TITLE_TOP, TARGET_COLOR)
    return encode_png(join_rows(rows))


def draw_distances(
    moved: NDArray[np.float64],
    distances: NDArray[np.float64],
    target: NDArray[np.float64],
    low: float,
    high: float,
) -> list[bytes]:
    """Draw the aligned source by distance on the grey target, from four sides, as PNG."""
    rows, fixed = thin(moved), target[thin(target)]
    colors = color_by_value(distances[rows], low, high)
    grey = np.full((len(fixed), 3), 215, np.uint8)
    points, both = np.concatenate([fixed, moved[rows]]), np.concatenate([grey, colors])
    return [encode_png(draw_points(points, both, view, _SIDE_SIZE, moved[rows])) for view in SIDES]


def _title(image: Image, words: str) -> Image:
    """Put a line of words above an image, where it hides no points."""
    line = np.full((_TITLE_HEIGHT, *image.shape[1:]), WHITE, np.uint8)
    write_word(line, words, 10, _TITLE_TOP)
    return np.concatenate([line, image])


def _draw_both(source: NDArray[np.float64], target: NDArray[np.float64], view: View) -> Image:
    colors = np.repeat(
        np.array([TARGET_COLOR, SOURCE_COLOR], np.uint8), [len(target), len(source)], axis=0
    )
    return draw_points(np.concatenate([target, source]), colors, view, _BEFORE_AFTER_SIZE)


def _bring_near(source: NDArray[np.float64], target: NDArray[np.float64]) -> NDArray[np.float64]:
    """Put a source that lies far away beside the target."""
    if len(source) == 0 or len(target) == 0:
        return source
    centers = [np.median(cloud, axis=0) for cloud in (source, target)]
    radius = max(
        float(np.percentile(np.linalg.norm(cloud - center, axis=1), 95))
        for cloud, center in zip((source, target), centers, strict=True)
    )
    gap = centers[0] - centers[1]
    length = float(np.linalg.norm(gap))
    if length <= _MAX_GAP * radius:
        return source
    near: NDArray[np.float64] = source - gap + gap / length * 2 * radius
    return near
