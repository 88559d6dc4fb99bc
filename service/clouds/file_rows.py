"""Inlier pairs of clouds that were thinned while they were read, as rows of their files."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from service.formats import DecodedCloud

if TYPE_CHECKING:
    from mpe_core import Inliers


def in_file_rows(inliers: Inliers, source: DecodedCloud, target: DecodedCloud) -> Inliers:
    """Return the pairs as rows of the files, of which thinned clouds hold only some."""
    if source.rows is not None:
        inliers = replace(inliers, source=source.rows[inliers.source])
    if target.rows is not None:
        inliers = replace(inliers, target=target.rows[inliers.target])
    return inliers
