"""Expansion of LZF, as the compressed encoding of PCD files uses it."""

from __future__ import annotations

import numpy as np
from numba import njit, types

MAX_DISTANCE = 8192
"""Bytes back to which a reference of LZF reaches."""
MAX_RUN = 264
"""Bytes that one step adds at most."""
DAMAGED = -1
"""Returned as the end of the output where a reference reaches before its beginning."""
_BYTES = types.Array(types.uint8, 1, "C", readonly=True)


@njit(
    types.UniTuple(types.int64, 2)(_BYTES, types.int64, types.uint8[::1], types.int64), cache=True
)
def expand_lzf(packed, place, out, end):
    """Expand until a step is incomplete in the input, or might not fit into the output.

    Parameters
    ----------
    packed : (P,) uint8
        A part of the compressed bytes, which begins with a step.
    place : int
        Byte of it at which to begin.
    out : (B,) uint8
        Receives the bytes; those before `end` are what came before, at least MAX_DISTANCE of
        them or all that there were.
    end : int
        Byte of `out` at which to write.

    Returns
    -------
    The byte of the input after the last complete step, and the end of the output or DAMAGED.
    """
    size = len(packed)
    while place < size and end + MAX_RUN <= len(out):
        control = np.int64(packed[place])
        if control < 32:
            count = control + 1
            if place + 1 + count > size:
                break
            for i in range(count):
                out[end + i] = packed[place + 1 + i]
            place += 1 + count
            end += count
            continue
        count, at = control >> 5, place + 1
        if count == 7:
            if at == size:
                break
            count += np.int64(packed[at])
            at += 1
        if at == size:
            break
        start = end - ((control & 31) << 8) - np.int64(packed[at]) - 1
        if start < 0:
            return place, DAMAGED
        count += 2
        for i in range(count):  # the run may overlap itself, so that bytes are copied in turn
            out[end + i] = out[start + i]
        place = at + 1
        end += count
    return place, end
