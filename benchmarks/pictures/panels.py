"""What the pictures have in common: colours, panels, points."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

Array = NDArray[np.float64]

SOURCE, TARGET, RIGHT, WRONG = "#d95f02", "#3b6fa0", "#1b9e4b", "#a0a0a0"
SHOWN = 6000


def panels(figure: Figure, count: int, titles: Sequence[str]) -> Sequence[Axes]:
    """Panels without scales, one length the same in all directions."""
    panels: Sequence[Axes] = figure.subplots(1, count)
    for axes, title in zip(panels, titles, strict=True):
        bare(axes, title)
    return panels


def bare(axes: Axes, title: str) -> None:
    axes.set_aspect("equal")
    axes.set_axis_off()
    axes.set_title(title, fontsize=10)


def dots(axes: Axes, points: Array, colour: str, columns: tuple[int, int] = (0, 1)) -> None:
    some = points[:: max(1, len(points) // SHOWN)]
    axes.scatter(*some[:, columns].T, s=1, color=colour, lw=0)


def legend(figure: Figure, axes: Axes, colours: dict[str, str]) -> None:
    for text, colour in colours.items():
        axes.plot([], [], "o", color=colour, label=text)
    figure.legend(loc="outside lower center", ncols=len(colours), frameon=False)
