"""Words in pictures: capital letters of 5 x 7 pixels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

_GLYPHS = {
    "A": "01110 10001 10001 11111 10001 10001 10001",
    "B": "11110 10001 11110 10001 10001 10001 11110",
    "C": "01110 10001 10000 10000 10000 10001 01110",
    "D": "11110 10001 10001 10001 10001 10001 11110",
    "E": "11111 10000 11110 10000 10000 10000 11111",
    "F": "11111 10000 11110 10000 10000 10000 10000",
    "G": "01110 10001 10000 10111 10001 10001 01110",
    "I": "01110 00100 00100 00100 00100 00100 01110",
    "N": "10001 11001 10101 10011 10001 10001 10001",
    "O": "01110 10001 10001 10001 10001 10001 01110",
    "P": "11110 10001 10001 11110 10000 10000 10000",
    "R": "11110 10001 10001 11110 10100 10010 10001",
    "S": "01111 10000 01110 00001 00001 10001 01110",
    "T": "11111 00100 00100 00100 00100 00100 00100",
    "U": "10001 10001 10001 10001 10001 10001 01110",
    " ": "00000 00000 00000 00000 00000 00000 00000",
}
SCALE = 2
"""Pixels of a dot of a letter."""
INK = (60, 60, 60)


def write_word(
    image: NDArray[np.uint8], word: str, left: int, top: int, ink: tuple[int, int, int] = INK
) -> int:
    """Write capital letters on white into an image; return the column after them."""
    height, width = 7 * SCALE, 6 * SCALE * len(word)
    image[top - SCALE : top + height + SCALE, left - SCALE : left + width] = 255
    for letter in word:
        dots = np.array([[int(dot) for dot in row] for row in _GLYPHS[letter].split()], bool)
        large = dots.repeat(SCALE, axis=0).repeat(SCALE, axis=1)
        height, width = large.shape
        image[top : top + height, left : left + width][large] = ink
        left += width + SCALE
    return left
