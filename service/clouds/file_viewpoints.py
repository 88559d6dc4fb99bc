"""Positions of the scanners, as the files of a pair tell them."""

from __future__ import annotations

from dataclasses import replace

from mpe_core.options import RegistrationOptions
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
    known = source.scanner_position, target.scanner_position
    is_asked = options.source_viewpoint is None and not options.ignore_file_viewpoints
    if known[0] is None or known[1] is None or not (options.is_global and is_asked):
        return options, ()
    places = ["({:.6g}, {:.6g}, {:.6g})".format(*each) for each in known if each is not None]
    text = (
        f"the files tell where their scanners stood, {places[0]} in the source and {places[1]} in"
        " the target, and this is used; if it is wrong, set ignore_file_viewpoints"
    )
    return replace(options, source_viewpoint=known[0], target_viewpoint=known[1]), (text,)
