"""Maps, landmarks and truth as files."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image

from mclcli.geometry import se2
from samples.sim.building import FREE, OCCUPIED, UNKNOWN, near
from samples.sim.recording import START_NS
from samples.sim.streams import Purpose, stream

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from mclcli.arrays import FloatArray
    from samples.sim.building import Building
    from samples.sim.robot import Trajectory


def write_map_pgm(grid: NDArray[np.int8], resolution: float, origin: tuple[float, float, float], path: Path) -> None:
    """Write a trinary map as ``path`` (.yaml) and a binary PGM beside it, as map_server's saver does.

    Free is 254, occupied 0, unknown 205: 0.196078 occupied, which only a free_thresh below that leaves unknown.
    """
    pixels = np.select([grid == FREE, grid == OCCUPIED], [np.uint8(254), np.uint8(0)], np.uint8(205))
    height, width = grid.shape
    path.with_suffix(".pgm").write_bytes(b"P5\n%d %d\n255\n" % (width, height) + pixels[::-1].tobytes())
    _write_yaml(path, path.with_suffix(".pgm").name, "trinary", resolution, origin)


def write_map_png(building: Building, path: Path, seed: int = 0) -> None:
    """Write a map of mode scale as ``path`` (.yaml) and a PNG with alpha beside it.

    Unknown cells are transparent. Some free cells along walls are only more or less occupied, as mapping leaves them.
    """
    grid, rng = building.grid, stream(seed, Purpose.MAP_BLUR)
    share = np.select([grid == FREE, grid == OCCUPIED], [0.0, 1.0], 50 / 255)
    rim = (grid == FREE) & near(grid == OCCUPIED, 1) & (rng.random(grid.shape) < 0.25)
    share[rim] = rng.uniform(0.25, 0.6, int(rim.sum()))
    gray = np.round(255.0 * (1.0 - share)).astype(np.uint8)
    alpha = np.where(grid == UNKNOWN, np.uint8(0), np.uint8(255))
    picture = Image.fromarray(np.ascontiguousarray(np.stack([gray, alpha], axis=-1)[::-1]))
    picture.save(path.with_suffix(".png"))
    _write_yaml(path, path.with_suffix(".png").name, "scale", building.resolution, building.origin)


def write_landmarks(building: Building, path: Path) -> None:
    """Write the landmarks in map as CSV ``id,x,y,z`` [m]."""
    marks = building.landmarks
    floor = np.column_stack([marks.positions[:, :2], np.zeros(len(marks.ids))])
    rows = zip(marks.ids, building.to_map(floor), marks.positions[:, 2], strict=True)
    lines = [f"{name},{x:.4f},{y:.4f},{z:.2f}" for name, (x, y, _), z in rows]
    write_lines(path, ["id,x,y,z", *lines])


def write_truth(truth: Trajectory, path: Path) -> None:
    """Write a trajectory as TUM: ``t x y z qx qy qz qw``, absolute seconds."""
    write_lines(path, [_tum_row(int(stamp), pose) for stamp, pose in zip(truth.stamps_ns, truth.poses, strict=True)])


def write_lines(path: Path, lines: list[str]) -> None:
    r"""Write lines of text ended by ``\n`` on every system."""
    path.write_bytes(("\n".join(lines) + "\n").encode())


def _tum_row(stamp_ns: int, pose: FloatArray) -> str:
    seconds, nanoseconds = divmod(START_NS + stamp_ns, 1_000_000_000)
    half = 0.5 * float(se2.wrap(pose[2]))
    x, y = (float(v) + 0.0 for v in pose[:2])
    return f"{seconds}.{nanoseconds:09d} {x:.6f} {y:.6f} 0 0 0 {math.sin(half):.9f} {math.cos(half):.9f}"


def _write_yaml(path: Path, image: str, mode: str, resolution: float, origin: tuple[float, float, float]) -> None:
    lines = [
        f"image: {image}",
        f"mode: {mode}",
        f"resolution: {resolution}",
        f"origin: [{origin[0]}, {origin[1]}, {origin[2]}]",
        "negate: 0",
        "occupied_thresh: 0.65",
        "free_thresh: 0.196",
    ]
    write_lines(path, lines)
