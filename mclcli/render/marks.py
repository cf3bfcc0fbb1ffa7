"""Lines, arrows, dots and rings, drawn anti-aliased: on a sheet ``FINE`` times finer than the finished picture.

Positions are pixels of the finished picture, (N, 2) float64 (right, down), where pixel i covers [i, i + 1).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from PIL import Image, ImageDraw

from mclcli.render.palette import HALO

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from mclcli.arrays import FloatArray
    from mclcli.render.palette import Color

FINE = 3
_FAR = 16_000  # Pillow counts in 32 bits; nothing this far out is seen


def to_fine(pixels: FloatArray) -> NDArray[np.intp]:
    """Pixels of the fine sheet (N, 2) whose centres are nearest to positions on the finished picture."""
    return np.rint(np.clip(pixels * FINE - 0.5, -_FAR, _FAR)).astype(np.intp)


def _odd(width: float) -> int:
    """Width in fine pixels, odd so that the line is centred."""
    return 2 * round((width * FINE - 1) / 2) + 1


def disc(image: Image.Image, at: FloatArray, radius: float, fill: Color, edge: Color | None = None) -> None:
    """Filled circle at one position (2,), radius [px], with a thin edge of another colour."""
    (x, y), r = to_fine(at), round(radius * FINE)
    width = round(1.6 * FINE) if edge else 0
    ImageDraw.Draw(image).ellipse((x - r, y - r, x + r, y + r), fill=fill, outline=edge, width=width)


def stroke(image: Image.Image, pixels: FloatArray, color: Color, width: float) -> None:
    """Line of one colour through positions (N, 2), width [px], with round joints and ends."""
    stroke_ramp(image, pixels, np.broadcast_to(np.array(color, dtype=np.uint8), (len(pixels), 3)), width)


def stroke_ramp(image: Image.Image, pixels: FloatArray, colors: NDArray[np.uint8], width: float) -> None:
    """Line through positions (N, 2) whose colour changes: piece i has colour i + 1 of (N, 3)."""
    points = to_fine(pixels)
    moved = np.ones(len(points), dtype=bool)
    moved[1:] = (np.diff(points, axis=0) != 0).any(axis=1)
    corners = [(int(x), int(y)) for x, y in points[moved]]
    inks = [(int(r), int(g), int(b)) for r, g, b in colors[moved]]
    draw, thick = ImageDraw.Draw(image), _odd(width)
    half = thick // 2
    for i, (x, y) in enumerate(corners):
        if i:
            draw.line((corners[i - 1], (x, y)), fill=inks[i], width=thick)
        if half > 1:
            draw.ellipse((x - half, y - half, x + half, y + half), fill=inks[i])


def dashes(pixels: FloatArray, on: float, off: float) -> Iterator[FloatArray]:
    """Cut a line through positions (N, 2) into dashes of length ``on`` [px] with gaps ``off``, along its length."""
    length = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(pixels, axis=0).T))]) if len(pixels) else np.zeros(0)
    if len(pixels) < 2 or length[-1] == 0.0:
        return
    for start in np.arange(0.0, length[-1], on + off):
        end = min(start + on, length[-1])
        inner = pixels[np.searchsorted(length, start, "right") : np.searchsorted(length, end, "left")]
        ends = np.stack([np.interp([start, end], length, pixels[:, c]) for c in (0, 1)], axis=-1)
        yield np.concatenate([ends[:1], inner, ends[1:]])


def stroke_dashed(image: Image.Image, pixels: FloatArray, color: Color, width: float) -> None:
    """Draw a dashed line of one colour through positions (N, 2), width [px]."""
    for dash in dashes(np.clip(pixels, -_FAR, _FAR), on=8.0, off=5.0):
        stroke(image, dash, color, width)


def arrow(image: Image.Image, at: FloatArray, heading: float, color: Color, size: float = 15.0) -> None:
    """Arrow head with its middle at one position (2,), pointing along ``heading`` [rad, up is +π/2], with a halo."""
    c, s = np.cos(heading), -np.sin(heading)  # pixels run downwards
    for grow, ink in ((1.0 + 4.5 / size, HALO), (1.0, color)):
        shape = np.array([[1.0, 0.0], [-0.8, 0.68], [-0.42, 0.0], [-0.8, -0.68]]) * size * grow
        shape[:, 0] -= 1.5 * (grow - 1.0)  # the halo's notch must not thin out
        turned = shape @ np.array([[c, s], [-s, c]])
        corners = [(int(x), int(y)) for x, y in to_fine(at + turned)]
        ImageDraw.Draw(image).polygon(corners, fill=ink)


def rays(image: Image.Image, start: FloatArray, ends: FloatArray, color: Color, opacity: int) -> None:
    """Faint straight lines from one position (2,) to each of (N, 2), ``opacity`` of 255."""
    sheet = ImageDraw.Draw(image, "RGBA")
    x, y = (int(v) for v in to_fine(start))
    for u, v in to_fine(ends):
        sheet.line((x, y, int(u), int(v)), fill=(*color, opacity), width=_odd(1.0))


def soft_dots(image: Image.Image, pixels: FloatArray, opacity: FloatArray, color: Color, radius: float = 1.7) -> None:
    """Translucent dots at positions (N, 2), each with its own ``opacity`` (N,) in [0, 1); they darken in heaps.

    Beer's law: opacities of overlapping dots add as −log(1 − a), hence a million dots cost one histogram.
    """
    width, height = image.width // FINE, image.height // FINE
    density = _spread(pixels, -np.log1p(-np.minimum(opacity, 0.999)), width, height)
    thick = np.zeros((height, width))
    reach = int(np.ceil(radius + 0.5))
    padded = np.pad(density, reach)
    for i in range(-reach, reach + 1):
        for j in range(-reach, reach + 1):
            share = float(np.clip(radius + 0.5 - np.hypot(i, j), 0.0, 1.0))
            if share > 0.0:
                thick += share * padded[reach + i : reach + i + height, reach + j : reach + j + width]
    mask = Image.fromarray(np.rint(-255.0 * np.expm1(-thick)).astype(np.uint8))
    image.paste(color, (0, 0), mask.resize(image.size, Image.Resampling.BILINEAR))


def _spread(pixels: FloatArray, amount: FloatArray, width: int, height: int) -> FloatArray:
    """Histogram (height, width) with each amount shared bilinearly among the four pixels around its position."""
    total = np.zeros(width * height)
    corner = np.floor(np.clip(pixels, -_FAR, _FAR) - 0.5)
    right, down = (np.clip(pixels, -_FAR, _FAR) - 0.5 - corner).T
    for dx, dy in ((0, 0), (1, 0), (0, 1), (1, 1)):
        share = amount * (right if dx else 1.0 - right) * (down if dy else 1.0 - down)
        x, y = corner[:, 0] + dx, corner[:, 1] + dy
        inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
        flat = (y[inside] * width + x[inside]).astype(np.intp)
        total += np.bincount(flat, weights=share[inside], minlength=width * height)
    return total.reshape(height, width)
