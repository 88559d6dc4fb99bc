"""Positions of the scanners, as the files of a pair tell them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from mpe_core.options import MAX_VIEWPOINTS, RegistrationOptions, Vector
from service.formats.decoded_cloud import DecodedCloud


def with_file_viewpoints(
    options: RegistrationOptions, source: DecodedCloud, target: DecodedCloud
) -> tuple[RegistrationOptions, tuple[str, ...]]:
    """Add the viewpoints that both files tell, where the caller gave none.

    Returns
    -------
    RegistrationOptions
        With both viewpoints, or as given.
    tuple[str, ...]
        A warning that tells where they are from, if they were added.
    """
    known = source.scanner_positions, target.scanner_positions
    is_asked = options.source_viewpoint is None and not options.ignore_file_viewpoints
    are_told = all(1 <= len(places) <= MAX_VIEWPOINTS for places in known)
    if not (are_told and options.is_global and is_asked):
        return options, ()
    text = (
        f"the files tell where their scanners stood, {_describe(known[0])} in the source and"
        f" {_describe(known[1])} in the target, and this is used; if it is wrong, set"
        " ignore_file_viewpoints"
    )
    return replace(options, source_viewpoint=known[0], target_viewpoint=known[1]), (text,)


def _describe(places: Sequence[Vector]) -> str:
    first = "({:.6g}, {:.6g}, {:.6g})".format(*places[0])
    others = len(places) - 1
    return first if others == 0 else f"{first} and {others} other{'s' * (others > 1)}"
