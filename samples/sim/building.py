"""What a building is: a grid with walls and furniture, doors, landmarks on its walls, places to go to."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple, final

import numpy as np

from mclcli.geometry import se2
from samples.sim.streams import Purpose, stream

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import ArrayLike, NDArray

    from mclcli.arrays import BoolArray, FloatArray

FREE, OCCUPIED, UNKNOWN = 0, 100, -1
RESOLUTION = 0.05


@final
class Rect(NamedTuple):
    """Axis-aligned rectangle in the floor frame [m], ``x0 < x1``, ``y0 < y1``."""

    x0: float
    y0: float
    x1: float
    y1: float

    @property
    def centre(self) -> tuple[float, float]:
        """Middle (x, y) [m]."""
        return (self.x0 + self.x1) / 2, (self.y0 + self.y1) / 2

    def grown(self, margin: float) -> Rect:
        """Rectangle larger by ``margin`` [m] on every side."""
        return Rect(self.x0 - margin, self.y0 - margin, self.x1 + margin, self.y1 + margin)


@final
@dataclass(frozen=True, slots=True, eq=False)
class Landmarks:
    """Marks on the walls: ``ids`` (L,) and ``positions`` (L, 3) x, y, z [m], floor frame."""

    ids: tuple[str, ...]
    positions: FloatArray


@final
@dataclass(frozen=True, slots=True, eq=False)
class Building:
    """One floor.

    ``grid`` (H, W) int8 as in nav_msgs/OccupancyGrid: 0 free, 100 occupied, −1 unknown, row 0 at the bottom, cells of
    ``resolution`` [m]. ``origin`` (x, y [m], yaw [rad]) is the map pose of the floor frame. ``boxes`` are the things
    that may be moved and ``doors`` the openings that may be closed; ``places`` names points (x, y) worth driving to.
    """

    name: str
    grid: NDArray[np.int8]
    boxes: tuple[Rect, ...]
    doors: tuple[Rect, ...]
    places: Mapping[str, tuple[float, float]]
    landmarks: Landmarks
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    resolution: float = RESOLUTION

    @property
    def occupied(self) -> BoolArray:
        """Cells that stop a beam, (H, W)."""
        return np.asarray(self.grid == OCCUPIED)

    def to_map(self, floor_poses: ArrayLike) -> FloatArray:
        """Poses (…, 3) of the floor frame in the map frame."""
        return se2.compose(self.origin, floor_poses)

    def to_floor(self, map_poses: ArrayLike) -> FloatArray:
        """Poses (…, 3) of the map frame in the floor frame."""
        return se2.compose(se2.inverse(self.origin), map_poses)


def solid(width: float, height: float, margin: float = 0.5) -> NDArray[np.int8]:
    """Grid of a solid block, unknown for ``margin`` [m] around it; rooms are carved out of it with ``paint``."""
    grid = np.full((round(height / RESOLUTION), round(width / RESOLUTION)), UNKNOWN, dtype=np.int8)
    paint(grid, Rect(margin, margin, width - margin, height - margin), OCCUPIED)
    return grid


def paint(grid: NDArray[np.int8], rect: Rect, value: int) -> None:
    """Set the cells of ``grid`` under ``rect`` to ``value``, in place."""
    x0, y0, x1, y1 = (max(0, round(edge / RESOLUTION)) for edge in rect)
    grid[y0:y1, x0:x1] = value


def patch(grid: NDArray[np.int8], rect: Rect) -> NDArray[np.int8]:
    """View of the cells of ``grid`` under ``rect``."""
    x0, y0, x1, y1 = (max(0, round(edge / RESOLUTION)) for edge in rect)
    return grid[y0:y1, x0:x1]


def near(mask: BoolArray, cells: int) -> BoolArray:
    """Cells within ``cells`` (in x and in y) of a true cell of ``mask`` (H, W)."""
    grown = np.array(mask)
    for _ in range(cells):
        grown[1:] |= grown[:-1].copy()
        grown[:-1] |= grown[1:].copy()
        grown[:, 1:] |= grown[:, :-1].copy()
        grown[:, :-1] |= grown[:, 1:].copy()
    return grown


def hollow(grid: NDArray[np.int8], bare: NDArray[np.int8] | None = None, skin: float = 0.15) -> NDArray[np.int8]:
    """Grid in which only the outer ``skin`` [m] of what is solid stays occupied: nobody ever mapped its inside.

    ``bare`` is the same floor before it was furnished: its walls stay whole where furniture hides them.
    """
    seen = near(grid == FREE, round(skin / RESOLUTION))
    if bare is not None:
        seen |= (bare == OCCUPIED) & near(bare == FREE, round(skin / RESOLUTION))
    return np.where((grid == OCCUPIED) & ~seen, np.int8(UNKNOWN), grid)


def place_landmarks(grid: NDArray[np.int8], walls: BoolArray, seed: int, count: int, spacing: float) -> Landmarks:
    """Up to ``count`` landmarks in free cells beside walls, at least ``spacing`` [m] apart, 1.2–1.8 m high.

    ``walls`` (H, W) are the cells a mark may hang on. Ids are ``1``, ``2``, … from left to right.
    """
    rng = stream(seed, Purpose.LANDMARKS)
    candidates = np.argwhere((grid == FREE) & near(walls, 1))
    points = (rng.permutation(candidates)[:, ::-1] + 0.5) * RESOLUTION
    chosen: list[FloatArray] = []
    for point in points:
        if len(chosen) < count and all(np.hypot(*(point - other)) >= spacing for other in chosen):
            chosen.append(point)
    ordered = sorted((float(x), float(y)) for x, y in chosen)
    heights = np.round(rng.uniform(1.2, 1.8, len(ordered)), 2)
    positions = np.column_stack([np.array(ordered).reshape(-1, 2), heights])
    return Landmarks(tuple(str(i + 1) for i in range(len(ordered))), positions)
