"""Expansion of LZF, against a slow twin, in parts of any size."""

from __future__ import annotations

import numpy as np
import pytest

from mpe_core.kernels.lzf import DAMAGED, MAX_DISTANCE, MAX_RUN, expand_lzf


def pack(rng: np.random.Generator, steps: int) -> tuple[bytes, bytes]:
    """Draw literals and references, near, far and overlapping; return them, and what they give."""
    packed, expanded = bytearray(), bytearray()
    for _ in range(steps):
        if not expanded or rng.random() < 0.4:
            run = rng.bytes(int(rng.integers(1, 33)))
            packed += bytes([len(run) - 1]) + run
            expanded += run
            continue
        farthest = min(len(expanded), MAX_DISTANCE)
        distance = int(rng.choice([1, min(5, farthest), farthest]))
        length = int(rng.choice([3, 8, 9, MAX_RUN]))
        high, low = divmod(distance - 1, 256)
        stored = length - 2
        packed += bytes(
            [stored << 5 | high] if stored < 7 else [7 << 5 | high, stored - 7]
        ) + bytes([low])
        for _ in range(length):
            expanded.append(expanded[-distance])
    return bytes(packed), bytes(expanded)


def test_all_at_once_and_in_parts() -> None:
    packed, expected = pack(np.random.default_rng(1), 900)
    source = np.frombuffer(packed, np.uint8)
    out = np.empty(len(expected) + MAX_RUN, np.uint8)
    assert expand_lzf(source, 0, out, 0) == (len(packed), len(expected))
    assert out[: len(expected)].tobytes() == expected
    place = end = 0
    for size in range(0, len(packed) + 50, 50):  # more of the input comes each time
        place, end = expand_lzf(source[:size], place, out, end)
    assert (place, end) == (len(packed), len(expected))
    assert out[:end].tobytes() == expected


def test_it_stops_where_the_output_is_full() -> None:
    packed, expected = pack(np.random.default_rng(2), 300)
    out = np.empty(MAX_RUN + 100, np.uint8)
    place, end = expand_lzf(np.frombuffer(packed, np.uint8), 0, out, 0)
    assert place < len(packed)
    assert 100 < end <= len(out)
    assert out[:end].tobytes() == expected[:end]


@pytest.mark.parametrize("packed", [b"\x20\x00", b"\x01ab\x3f\xff", b"\xe0\x00\x00"])
def test_references_before_the_beginning_are_damage(packed: bytes) -> None:
    out = np.empty(1000, np.uint8)
    assert expand_lzf(np.frombuffer(packed, np.uint8), 0, out, 0)[1] == DAMAGED
