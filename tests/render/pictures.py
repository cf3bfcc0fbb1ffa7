"""Small maps and a magnifying glass for the tests of pictures."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mclcli.render.palette import FREE, WALL
from mclcli.world.occupancy import OccupancyGrid

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from PIL import Image

    from mclcli.arrays import FloatArray
    from mclcli.render.palette import Color


def room(
    height: int = 60, width: int = 80, resolution: float = 0.1, origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> OccupancyGrid:
    """Free cells with a wall all around."""
    cells = np.zeros((height, width), dtype=np.int8)
    cells[[0, -1]] = 100
    cells[:, [0, -1]] = 100
    return OccupancyGrid(cells, resolution, np.array(origin))


def pixel(picture: Image.Image, x: float, y: float) -> FloatArray:
    """Where the picture says that a map point [m] lies: continuous pixels (right, down)."""
    scale, left, top = picture.info["pixel_from_map"]
    return np.array([left + scale * x, top - scale * y])


def closeness(picture: Image.Image, color: Color) -> FloatArray:
    """How much of a colour each pixel has, (H, W): 1 the colour itself, 0 farther than 60 levels from it."""
    far = np.abs(np.asarray(picture, dtype=np.float64) - np.array(color)).max(axis=2)
    return np.asarray(np.clip(1.0 - far / 60.0, 0.0, 1.0), dtype=np.float64)


def darkness(picture: Image.Image) -> FloatArray:
    """How much of a wall each pixel of free space has, (H, W): 1 is all wall."""
    red = np.asarray(picture, dtype=np.float64)[..., 0]
    return np.asarray(np.clip((FREE[0] - red) / (FREE[0] - WALL[0]), 0.0, 1.0), dtype=np.float64)


def middle_of(amount: FloatArray, near: FloatArray, reach: int) -> FloatArray:
    """Centroid (right, down) in continuous pixels of an amount per pixel, within ``reach`` pixels of a place."""
    x, y = np.floor(near).astype(int)
    part = amount[y - reach : y + reach + 1, x - reach : x + reach + 1]
    rows, columns = np.mgrid[y - reach : y + reach + 1, x - reach : x + reach + 1]
    assert part.sum() > 0.0, "nothing of that colour is near"
    total = float(part.sum())
    return np.array([((columns + 0.5) * part).sum() / total, ((rows + 0.5) * part).sum() / total])


def color_at(picture: Image.Image, x: float, y: float) -> tuple[int, ...]:
    """Colour of the pixel on which a map point [m] lies."""
    column, row = np.floor(pixel(picture, x, y)).astype(int).tolist()
    found = picture.getpixel((column, row))
    assert isinstance(found, tuple)
    return tuple(int(c) for c in found)


def near(color: tuple[int, ...], other: tuple[int, ...] | NDArray[np.uint8], levels: int = 12) -> bool:
    """Whether two colours differ by no more than some levels in each channel."""
    return bool(np.abs(np.array(color, dtype=int) - np.array(other, dtype=int)).max() <= levels)
