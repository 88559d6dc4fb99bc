"""Pictures of point clouds, drawn by NumPy alone: no display, no graphics card, no library."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]
"""(height, width, 3) colours."""
WHITE = 255
MAX_DRAWN_POINTS = 100_000
"""Points of a cloud that are drawn: they fill a picture, and more hide each other."""
MARGIN = 0.06
"""Share of the picture that is left free at each side."""
SHADE_STRENGTH, DARKEST = 15.0, 0.5
"""How fast edges in depth become dark (eye-dome lighting), and the least brightness."""
FRAME_PERCENT = 0.5
"""Share of the points at each side that need not fit into a picture, in per cent: strays."""
FRAME_POINTS = 20_000
"""Points that are enough to find the frame."""
_STOPS = np.array([0.0, 0.25, 0.5, 0.75, 1.0])
_RAMP = np.array([[40, 60, 190], [40, 170, 215], [70, 180, 75], [245, 200, 50], [205, 35, 40]])
"""Blue, cyan, green, yellow, red: the order that programs for scans have in common."""


@dataclass(frozen=True, slots=True)
class View:
    """Direction of an orthographic picture, in degrees."""

    azimuth: float
    """Where the observer stands, from the x axis towards the y axis."""
    elevation: float
    """How high above the xy plane."""

    def axes(self) -> NDArray[np.float64]:
        """Return the (3, 3) rows right, up and towards the observer."""
        a, e = np.radians([self.azimuth, self.elevation])
        toward = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
        right = np.array([-np.sin(a), np.cos(a), 0.0])
        return np.array([right, np.cross(toward, right), toward])


def thin(points: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return rows of finite points, at most MAX_DRAWN_POINTS of them, evenly chosen."""
    rows = np.flatnonzero(np.isfinite(points).all(axis=1))
    step = -(-len(rows) // MAX_DRAWN_POINTS) or 1
    chosen: NDArray[np.intp] = rows[::step]
    return chosen


def color_by_value(values: NDArray[np.float64], low: float, high: float) -> Image:
    """Return (N, 3) colours from blue at `low` to red at `high`; NaN is grey."""
    span = high - low if high > low else 1.0
    share = np.clip((values - low) / span, 0, 1)
    known = np.nan_to_num(share)
    colors = np.stack([np.interp(known, _STOPS, channel) for channel in _RAMP.T], axis=1)
    colors[np.isnan(values)] = 160
    return colors.astype(np.uint8)


def draw_points(
    points: NDArray[np.float64],
    colors: Image,
    view: View,
    size: tuple[int, int],
    frame: NDArray[np.float64] | None = None,
) -> Image:
    """Draw points as seen from a direction, nearer ones before farther ones.

    Parameters
    ----------
    points : (N, 3)
        Finite points.
    colors : (N, 3)
        Their colours.
    view
        Direction.
    size
        Width and height in pixels.
    frame : (K, 3), optional
        Points that fill the picture; default: those that are drawn.
    """
    width, height = size
    image = np.full((height, width, 3), WHITE, np.uint8)
    if len(points) == 0:
        return image
    axes = view.axes()
    seen = points @ axes.T
    fitted = seen if frame is None else frame @ axes.T
    some = fitted[:: 1 + len(fitted) // FRAME_POINTS]
    low, high = np.percentile(some, (FRAME_PERCENT, 100 - FRAME_PERCENT), axis=0)
    scale = _fit(high - low, size)
    x = (seen[:, 0] - (low[0] + high[0]) / 2) * scale + width / 2
    y = height / 2 - (seen[:, 1] - (low[1] + high[1]) / 2) * scale
    depth = np.full((height, width), -np.inf)
    order = _order_by_depth(seen[:, 2], low[2], high[2])
    _splat(image, depth, np.stack([x, y, seen[:, 2]], axis=1)[order], colors[order], len(points))
    _shade(image, depth, float(high[2] - low[2]))
    return image


def _order_by_depth(z: NDArray[np.float64], low: float, high: float) -> NDArray[np.intp]:
    """Return the order from far to near; numpy sorts steps of 16 bits in linear time."""
    steps = np.clip((z - low) / (high - low or 1.0), 0, 1) * np.iinfo(np.uint16).max
    return np.argsort(steps.astype(np.uint16), kind="stable")


def _fit(extent: NDArray[np.float64], size: tuple[int, int]) -> float:
    """Return pixels per unit of length, so that the extent fills the picture."""
    shares = [
        pixels * (1 - 2 * MARGIN) / max(e, 1e-300) for pixels, e in zip(size, extent, strict=False)
    ]
    return float(min(shares))


def _splat(
    image: Image, depth: NDArray[np.float64], places: NDArray[np.float64], colors: Image, count: int
) -> None:
    """Draw squares at x, y, from far to near, so that the nearest is seen."""
    height, width = depth.shape
    dots = int(np.clip(np.ceil(0.45 * np.sqrt(height * width / max(count, 1))), 2, 5))
    column, row = places[:, 0].astype(np.int64), places[:, 1].astype(np.int64)
    for dx in range(dots):
        for dy in range(dots):
            c, r = column + dx - dots // 2, row + dy - dots // 2
            rows = np.flatnonzero((c >= 0) & (c < width) & (r >= 0) & (r < height))
            c, r, z = c[rows], r[rows], places[rows, 2]
            layer = np.full(depth.shape, -1, np.int64)
            layer[r, c] = rows  # the last one at a pixel is the nearest
            is_drawn = layer >= 0
            nearest = layer[is_drawn]
            z = places[nearest, 2]
            is_nearer = z > depth[is_drawn]
            flat = np.flatnonzero(is_drawn)[is_nearer]
            depth.reshape(-1)[flat] = z[is_nearer]
            image.reshape(-1, 3)[flat] = colors[nearest[is_nearer]]


def _shade(image: Image, depth: NDArray[np.float64], span: float) -> None:
    """Darken points behind nearer ones, so that shapes show (eye-dome lighting)."""
    has_point = np.isfinite(depth)
    known = np.where(has_point, depth, depth[has_point].min() if has_point.any() else 0.0)
    response = np.zeros(depth.shape)
    for axis in (0, 1):
        for shift in (-2, 2):
            step = np.roll(known, shift, axis=axis) - known
            response += np.clip(step / (span or 1.0), 0, None)
    shade = np.maximum(np.exp(-SHADE_STRENGTH * response), DARKEST)
    image[has_point] = (image[has_point] * shade[has_point, None]).astype(np.uint8)


def join_rows(rows: Sequence[Sequence[Image]]) -> Image:
    """Put pictures of equal size beside and below each other."""
    return np.concatenate([np.concatenate(list(row), axis=1) for row in rows])


def encode_png(image: Image) -> bytes:
    """Return an image as PNG."""
    height, width, _ = image.shape
    lines = np.concatenate([np.zeros((height, 1), np.uint8), image.reshape(height, -1)], axis=1)
    head = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    chunks = ((b"IHDR", head), (b"IDAT", zlib.compress(lines.tobytes(), 6)), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        for kind, data in chunks
    )
