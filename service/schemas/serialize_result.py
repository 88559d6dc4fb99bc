"""Results of `mpe_core.register`, rendered for the API."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mpe_core import Registration
from service.schemas.result import MAX_INLINE_PAIRS, InlierSummary, Result, ResultWarning, Rotation

_PAIRS, _PAIRS_END = b'"pairs":[[', b"]]"
_PAIR_ROWS = re.compile(rb"\[\d{1,19},\d{1,19}\](?:,\[\d{1,19},\d{1,19}\])*")
_STEP_BYTES = 1 << 14
"""Text of pairs that is checked at once: meanwhile no other thread of the process runs."""

ROWS_PER_CHUNK = 4000
"""Inlier rows rendered at once: meanwhile no other thread of the process runs."""


def render_result(found: Registration, file_warnings: Sequence[str] = ()) -> bytes:
    """Render the `result` of a job as JSON, with what reading the files said."""
    # imported here: the service process, which renders the inliers, does not load SciPy (30 MB)
    from scipy.spatial.transform import Rotation as SciPyRotation

    T = found.T_target_source
    rotation = SciPyRotation.from_matrix(T[:3, :3] / found.scale)
    return (
        Result(
            transform=T.tolist(),
            rotation=Rotation(
                quaternion_xyzw=rotation.as_quat(canonical=True).tolist(),
                angle_deg=float(np.degrees(rotation.magnitude())),
            ),
            translation=T[:3, 3].tolist(),
            scale=found.scale,
            scale_deviation=found.scale_deviation,
            overlap=found.overlap,
            rmse=found.rmse,
            energy=found.energy,
            confidence=found.confidence,
            accepted=found.accepted,
            ambiguous=found.ambiguous,
            alternatives=found.alternatives.tolist(),
            covariance=found.covariance.tolist(),
            free_directions=found.free_directions.tolist(),
            converged=found.converged,
            iterations=found.iterations,
            inliers=_summarize_inliers(found),
            warnings=[
                *(ResultWarning(code="file", message=text) for text in file_warnings),
                *(ResultWarning(code=each.code, message=str(each)) for each in found.warnings),
            ],
        )
        .model_dump_json()
        .encode()
    )


def split_pairs(document: bytes) -> tuple[bytes, bytes]:
    """Divide what `render_result` has rendered: the result with null for its pairs, and the pairs.

    Up to MAX_INLINE_PAIRS are nearly all of the text, and no other thread runs while it is parsed.
    """
    start = document.find(_PAIRS)  # within a string its quotes would be escaped
    end = document.find(_PAIRS_END, start)
    if start < 0 or end < 0:
        return document, b""
    end += len(_PAIRS_END)
    pairs = document[start + len(_PAIRS) - 2 : end]
    return document[:start] + b'"pairs":null' + document[end:], pairs


def read_summary(document: bytes) -> dict[str, Any]:
    """Parse a rendered result without its pairs."""
    summary: dict[str, Any] = json.loads(split_pairs(document)[0])
    return summary


def count_pairs(text: bytes) -> int:
    """Return the number of pairs in `[[0,0],[1,4]]`, checked in short steps.

    Raises
    ------
    ValueError
        The text is anything else.
    """
    count, start, end = 0, 1, len(text) - 1
    while start < end:
        stop = text.find(b"],[", min(start + _STEP_BYTES, end)) + 1 or end
        if not _PAIR_ROWS.fullmatch(text, start, stop):
            raise ValueError("the inlier pairs are no pairs of row numbers")
        count += text.count(b"[", start, stop)
        start = stop + 1
    return count


def iter_inliers_json(rows: NDArray[np.void], threshold: float) -> Iterator[str]:
    """Yield an `InlierList` as JSON text, with a bounded number of rows in memory.

    Parameters
    ----------
    rows : (K,) rows of `inlier_file`
        May be memory-mapped.
    threshold : float
        Largest distance of a pair, in input units.
    """
    yield f'{{"count":{len(rows)},"threshold":{json.dumps(threshold)},"pairs":['
    yield from _iter_items(rows, lambda part: np.column_stack((part["source"], part["target"])))
    yield '],"distances":['
    yield from _iter_items(rows, lambda part: part["distance"])
    yield "]}"


def _iter_items(
    rows: NDArray[np.void], column: Callable[[NDArray[np.void]], NDArray[Any]]
) -> Iterator[str]:
    for start in range(0, len(rows), ROWS_PER_CHUNK):
        values = column(rows[start : start + ROWS_PER_CHUNK]).tolist()
        yield ("," if start else "") + json.dumps(values, separators=(",", ":"))[1:-1]


def _summarize_inliers(found: Registration) -> InlierSummary:
    inliers = found.inliers
    inline = len(inliers) <= MAX_INLINE_PAIRS
    pairs = np.column_stack((inliers.source, inliers.target)).tolist() if inline else None
    # not validated: 100,000 pairs would take longer than the registration
    return InlierSummary.model_construct(
        count=len(inliers), ratio=found.overlap, threshold=inliers.threshold, pairs=pairs
    )
