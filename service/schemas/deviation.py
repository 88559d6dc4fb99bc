"""Model of the deviation of an aligned source from its target."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from pydantic import Field

from service.schemas.base import ResponseModel

if TYPE_CHECKING:
    from mpe_core import DeviationSummary


class Percentile(ResponseModel):
    """A percentile of the distances."""

    percent: float = Field(ge=0, le=100, description="So many per cent of the points lie below.")
    value: float | None = Field(description="Distance, in the input's unit; null without points.")


class ToleranceShare(ResponseModel):
    """How many points lie within a tolerance."""

    tolerance: float = Field(description="Largest distance, in the input's unit.")
    share: float | None = Field(
        description="Share of the points that count, in [0, 1]; null without points."
    )


class Deviation(ResponseModel):
    """Statistics of the distances of the moved source points from the target's surface."""

    signed: bool = Field(
        description="Whether points outside of the target are positive and those inside negative: "
        "where its file has normals or tells where the scanner stood (unless "
        "ignore_file_viewpoints is set), or target_viewpoint is given. Else all are positive."
    )
    count: int = Field(ge=0, description="Number of points that count.")
    beyond: int = Field(
        ge=0, description="Number of points farther away than max_distance, which do not count."
    )
    mean: float | None = Field(description="Mean, in the input's unit; null without points.")
    std: float | None = Field(description="Standard deviation, in the input's unit.")
    rms: float | None = Field(description="Root mean square, in the input's unit.")
    minimum: float | None = Field(description="Least distance, in the input's unit.")
    maximum: float | None = Field(description="Largest distance, in the input's unit.")
    percentiles: list[Percentile]
    shares: list[ToleranceShare] = Field(description="One for each tolerance of the request.")
    histogram_edges: list[float] = Field(
        description="Edges of the bins, in the input's unit; one more than there are counts."
    )
    histogram_counts: list[int] = Field(description="Number of points in each bin.")


def render_deviation(
    summary: DeviationSummary, is_signed: bool, histogram: tuple[list[float], list[int]]
) -> Deviation:
    """Return the API's model of a summary; numbers that no points stand behind are null."""
    edges, counts = histogram
    same = ("mean", "std", "rms", "minimum", "maximum")
    return Deviation(
        signed=is_signed,
        count=summary.count,
        beyond=summary.beyond,
        **{name: _number(getattr(summary, name)) for name in same},
        percentiles=[
            Percentile(percent=percent, value=_number(value))
            for percent, value in summary.percentiles.items()
        ],
        shares=[
            ToleranceShare(tolerance=tolerance, share=_number(share))
            for tolerance, share in summary.shares.items()
        ],
        histogram_edges=edges,
        histogram_counts=counts,
    )


def _number(value: float) -> float | None:
    return value if math.isfinite(value) else None
