"""Colors, panels and points of the pictures."""

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
    """Return panels without scales, with lengths equal in all directions."""
    panels: Sequence[Axes] = figure.subplots(1, count)
    for axes, title in zip(panels, titles, strict=True):
        bare(axes, title)
    return panels


def bare(axes: Axes, title: str) -> None:
    """Hide the scales of a panel, and make lengths equal in all directions."""
    axes.set_aspect("equal")
    axes.set_axis_off()
    axes.set_title(title, fontsize=10)


def dots(axes: Axes, points: Array, color: str, columns: tuple[int, int] = (0, 1)) -> None:
    """Draw up to about SHOWN points, projected on two coordinates."""
    some = points[:: max(1, len(points) // SHOWN)]
    axes.scatter(*some[:, columns].T, s=1, color=color, lw=0)


def legend(figure: Figure, axes: Axes, colors: dict[str, str]) -> None:
    """Explain the colors below the panels."""
    for text, color in colors.items():
        axes.plot([], [], "o", color=color, label=text)
    figure.legend(loc="outside lower center", ncols=len(colors), frameon=False)
