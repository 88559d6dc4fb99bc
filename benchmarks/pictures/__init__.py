"""The pictures of docs/method.md."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

from benchmarks.pictures.algorithm_1 import algorithm_1
from benchmarks.pictures.steps import (
    clouds,
    evidence,
    fields,
    inliers,
    polish,
    prepare,
    votes,
    waves,
)
from benchmarks.pictures.story import Story, tell

__all__ = ["PICTURES", "draw", "tell"]

PICTURES = (clouds, prepare, votes, fields, waves, polish, evidence, inliers, algorithm_1)


def draw(picture: Callable[[Story, Figure], None], story: Story, folder: Path) -> Path:
    """Draw a picture into the folder, in 256 colors; the same bytes each time."""
    figure = Figure(figsize=(8, 3.8), dpi=100, layout="constrained")
    picture(story, figure)
    memory = io.BytesIO()
    FigureCanvasAgg(figure).print_png(memory)
    path = folder / f"{picture.__name__.replace('_', '-')}.png"
    Image.open(memory).convert("RGB").quantize(method=Image.Quantize.MAXCOVERAGE).save(
        path, optimize=True
    )
    return path
