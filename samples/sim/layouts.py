"""Buildings to order: every generator takes a seed and gives another floor of the same kind."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from samples.sim.building import (
    FREE,
    OCCUPIED,
    RESOLUTION,
    Building,
    Rect,
    hollow,
    paint,
    patch,
    place_landmarks,
    solid,
)
from samples.sim.streams import Purpose, stream

if TYPE_CHECKING:
    from numpy.typing import NDArray

WALL = 0.15
DOOR = 0.95


def office_floor(
    seed: int, origin: tuple[float, float, float] = (0.0, 0.0, 0.0), landmarks: int = 60, clutter: int = 6
) -> Building:
    """Office floor of 23 × 15 m: two corridors joined by a lobby and a passage (a loop), rooms off them.

    Rooms differ in width, furniture and side of the door with ``seed``; ``clutter`` boxes stand about. Places:
    ``lobby``, ``west``, ``passage``, ``south1``…, ``core1``…, ``north1``….
    """
    rng = stream(seed, Purpose.LAYOUT)
    grid = solid(24.0, 16.0)
    halls = [Rect(0.7, 5.05, 23.3, 6.75), Rect(0.7, 9.65, 23.3, 11.35)]
    halls += [Rect(0.7, 5.05, 4.4, 11.35), Rect(19.45, 5.05, 21.15, 11.35)]
    for hall_ in halls:
        paint(grid, hall_, FREE)
    places = {"lobby": (2.2, 8.2), "west": (1.6, 5.9), "passage": (20.3, 8.2)}
    rooms: list[tuple[Rect, Rect]] = []
    bands = {
        "south": (0.7, 23.3, 0.7, 4.9, "up"),
        "core": (4.55, 19.3, 6.9, 9.5, ""),
        "north": (0.7, 23.3, 11.5, 15.3, "down"),
    }
    for name, (x0, x1, y0, y1, side) in bands.items():
        for k, (left, right) in enumerate(split(rng, x0, x1, 2.9, 5.2)):
            room = Rect(left, y0, right, y1)
            door = _doorway(rng, room, upward=side == "up" or (not side and bool(rng.random() < 0.5)))
            paint(grid, room, FREE)
            paint(grid, door, FREE)
            rooms.append((room, door))
            places[f"{name}{k + 1}"] = room.centre
    bare = np.array(grid)
    doors = tuple(door for _, door in rooms)
    for room, door in rooms:
        _furnish(rng, grid, room, door)
    _furnish_lobby(grid)
    boxes = scatter(rng, grid, [room for room, _ in rooms] + halls[:2], clutter, doors)
    grid = hollow(grid, bare)
    marks = place_landmarks(grid, bare == OCCUPIED, seed, landmarks, spacing=1.4)
    return Building("office", grid, boxes, doors, places, marks, origin)


def hall(
    seed: int,
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0),
    *,
    racks: bool = True,
    landmarks: int = 40,
    clutter: int = 10,
) -> Building:
    """Hall of 30 × 20 m with pillars, rows of racks of unequal length if ``racks``, and pallets (the boxes).

    Places: ``dock``, ``south1``…``south4`` and ``north1``…``north4`` at the ends of the aisles, ``gate``.
    """
    rng = stream(seed, Purpose.LAYOUT)
    grid = solid(31.0, 21.0)
    floor = Rect(0.7, 0.7, 30.3, 20.3)
    paint(grid, floor, FREE)
    paint(grid, Rect(0.7, 15.6, 5.2, 20.3), OCCUPIED)  # an office in the corner
    paint(grid, Rect(27.4, 0.7, 30.3, 4.1), OCCUPIED)  # a store room
    for x in np.arange(5.0, 28.0, 6.0):
        for y in (3.4, 17.4):
            px, py = _snap(x + rng.uniform(-0.5, 0.5)), _snap(y + rng.uniform(-0.3, 0.3))
            paint(grid, Rect(px - 0.2, py - 0.2, px + 0.2, py + 0.2), OCCUPIED)
    for row in range(4 if racks else 0):
        _rack(rng, grid, 7.3 + 5.0 * row)
    bare = np.array(grid)
    keep = (Rect(0.7, 4.0, 7.0, 15.0),)
    boxes = scatter(rng, grid, [floor], clutter, keep)
    places = {"dock": (2.6, 4.0), "gate": (28.6, 10.5)}
    for aisle in range(4):
        x = 10.3 + 5.0 * aisle
        places |= {f"south{aisle + 1}": (x, 3.6), f"north{aisle + 1}": (x, 17.0), f"aisle{aisle + 1}": (x, 10.2)}
    grid = hollow(grid, bare)
    marks = place_landmarks(grid, bare == OCCUPIED, seed, landmarks, spacing=1.8)
    return Building("hall", grid, boxes, (), places, marks, origin)


def corridors(
    seed: int, origin: tuple[float, float, float] = (0.0, 0.0, 0.0), *, count: int = 4, landmarks: int = 12
) -> Building:
    """``count`` equal corridors with equal niches off one long corridor: where a global search must stay in doubt.

    Only the seed's few boxes, one in every second corridor, tell them apart. Places: ``end1``…, ``mouth1``….
    """
    rng = stream(seed, Purpose.LAYOUT)
    pitch, length = 4.0, 10.0
    grid = solid(pitch * count + 2.0, length + 4.0)
    paint(grid, Rect(0.7, 0.7, pitch * count + 1.3, 2.5), FREE)
    places: dict[str, tuple[float, float]] = {}
    arms = []
    for k in range(count):
        x = 1.4 + pitch * k
        arms.append(Rect(x, 2.5, x + 1.8, length + 3.3))
        paint(grid, arms[-1], FREE)
        for y in (5.0, 8.0, 11.0):
            paint(grid, Rect(x + 1.8, y, x + 2.4, y + 1.0), FREE)
        places |= {f"end{k + 1}": (x + 0.9, length + 2.4), f"mouth{k + 1}": (x + 0.9, 1.6)}
    bare = np.array(grid)
    niches = [Rect(arm.x1 + 0.05, 8.05, arm.x1 + 0.55, 8.95) for arm in arms[::2]]
    boxes = scatter(rng, grid, niches, len(niches), (), size=(0.3, 0.45), gap=0.0)
    grid = hollow(grid, bare)
    marks = place_landmarks(grid, bare == OCCUPIED, seed, landmarks, spacing=2.0)
    return Building("corridors", grid, boxes, (), places, marks, origin)


def split(rng: np.random.Generator, x0: float, x1: float, low: float, high: float) -> list[tuple[float, float]]:
    """Cut [x0, x1] [m] into rooms ``low`` to ``high`` wide (the last may be wider) with walls between them."""
    rooms = []
    left = x0
    while x1 - left > 2 * low + WALL:
        right = _snap(min(left + rng.uniform(low, high), x1 - low - WALL))
        rooms.append((left, right))
        left = _snap(right + WALL)
    return [*rooms, (left, x1)]


def scatter(
    rng: np.random.Generator,
    grid: NDArray[np.int8],
    areas: list[Rect],
    count: int,
    keep: tuple[Rect, ...],
    size: tuple[float, float] = (0.4, 0.9),
    gap: float = 0.75,
) -> tuple[Rect, ...]:
    """Put up to ``count`` boxes with sides ``size`` [m] on free floor of ``areas`` and paint them into ``grid``.

    Each touches nothing but leaves ``gap`` [m] for a robot on all sides, and stays 0.8 m off every ``keep`` rectangle.
    """
    boxes: list[Rect] = []
    for _ in range(60 * count):
        if len(boxes) == count:
            break
        area = areas[int(rng.integers(len(areas)))]
        width, height = (_snap(v) for v in rng.uniform(*size, 2))
        x, y = _snap(rng.uniform(area.x0, area.x1 - width)), _snap(rng.uniform(area.y0, area.y1 - height))
        box = Rect(x, y, x + width, y + height)
        if np.all(patch(grid, box.grown(gap)) == FREE) and not any(_overlap(box.grown(0.8), other) for other in keep):
            paint(grid, box, OCCUPIED)
            boxes.append(box)
    return tuple(boxes)


def _snap(value: float) -> float:
    return round(round(value / RESOLUTION) * RESOLUTION, 2)


def _overlap(a: Rect, b: Rect) -> bool:
    return a.x0 < b.x1 and b.x0 < a.x1 and a.y0 < b.y1 and b.y0 < a.y1


def _doorway(rng: np.random.Generator, room: Rect, *, upward: bool) -> Rect:
    left = _snap(rng.uniform(room.x0 + 0.3, room.x1 - 0.3 - DOOR))
    y0 = room.y1 if upward else room.y0 - WALL
    return Rect(left, y0, left + DOOR, y0 + WALL)


def _furnish(rng: np.random.Generator, grid: NDArray[np.int8], room: Rect, door: Rect) -> None:
    """Door leaf, desks along the far wall as a lidar sees them (a pedestal and a side panel), a cabinet."""
    upward = door.y0 >= room.y1 - 1e-6
    leaf_y = room.y1 - 0.9 if upward else room.y0
    if room.x1 - door.x1 > 0.1:
        paint(grid, Rect(door.x1, leaf_y, door.x1 + 0.05, leaf_y + 0.9), OCCUPIED)
    desk = 0.7
    y = room.y0 if upward else room.y1 - desk
    x = _snap(room.x0 + rng.uniform(0.0, 0.4))
    while x + 1.6 < room.x1:
        paint(grid, Rect(x, y, x + 0.45, y + desk), OCCUPIED)
        paint(grid, Rect(x + 1.5, y, x + 1.55, y + desk), OCCUPIED)
        x = _snap(x + rng.uniform(1.7, 2.4))
    if room.y1 - room.y0 > 3.0:
        side = room.x0 if rng.random() < 0.5 else room.x1 - 0.45
        middle = _snap(room.centre[1] + rng.uniform(-0.5, 0.3))
        paint(grid, Rect(side, middle, side + 0.45, middle + _snap(rng.uniform(0.6, 1.1))), OCCUPIED)


def _furnish_lobby(grid: NDArray[np.int8]) -> None:
    """Reception desk, a sofa and two pillars."""
    for rect in (
        Rect(3.1, 7.2, 3.5, 9.2),
        Rect(0.7, 7.4, 1.3, 9.0),
        Rect(4.15, 6.9, 4.4, 7.15),
        Rect(4.15, 9.25, 4.4, 9.5),
    ):
        paint(grid, rect, OCCUPIED)


def _rack(rng: np.random.Generator, grid: NDArray[np.int8], x: float) -> None:
    """A double row of racks, 1.2 m deep, with a gap somewhere."""
    low, high = _snap(rng.uniform(5.2, 6.2)), _snap(rng.uniform(14.0, 15.4))
    gap = _snap(rng.uniform(8.0, 11.0))
    for y0, y1 in ((low, gap), (gap + 1.6, high)):
        paint(grid, Rect(x, y0, x + 1.2, y1), OCCUPIED)
