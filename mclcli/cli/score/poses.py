"""The poses that ``mcl score`` scores, from all the ways of naming them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli import rng
from mclcli.cli import console
from mclcli.cli.score.options import YAW_STEP
from mclcli.errors import UsageError
from mclcli.filter import particles
from mclcli.geometry import se2
from mclcli.replay.setup import describe_extent

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray
    from mclcli.cli.parse import Pose
    from mclcli.cli.score.options import PoseOptions
    from mclcli.world.occupancy import OccupancyGrid

_HEATMAP_POSITIONS = 15_000


@final
@dataclass(frozen=True, slots=True, eq=False)
class Candidates:
    """Poses (N, 3) in the order given, and the input's other columns: names, and texts (N rows; empty if none).

    ``step`` [m] is the spacing of the lattice among them, 0 without one.
    """

    poses: FloatArray
    columns: tuple[str, ...]
    texts: list[tuple[str, ...]]
    step: float


def collect(options: PoseOptions, grid: OccupancyGrid, *, for_heatmap: bool) -> Candidates:
    """Poses of --pose, then --poses, --around and --grid; of a heat map without any, a lattice over the map."""
    sets = [_given(options.given, grid)]
    columns: tuple[str, ...] = ()
    texts: list[tuple[str, ...]] = []
    if options.poses_file:
        poses, columns, rows = _from_file(options.poses_file, grid)
        texts = [("",) * len(columns)] * len(sets[0]) + rows
        sets.append(poses)
    if options.around is not None:
        sets.append(_drawn(options, options.around, grid))
    step = 0.0
    if options.lattice or (for_heatmap and sum(len(s) for s in sets) == 0):
        step, yaw_step = options.lattice or _steps_over_all(grid)
        sets.append(lattice_poses(grid, step, yaw_step))
    poses = np.concatenate(sets)
    if not poses.size:
        raise UsageError("no pose to score; name some with --pose, --poses, --around or --grid")
    texts += [("",) * len(columns)] * (len(poses) - len(texts)) if columns else []
    return Candidates(poses, columns, texts, step)


def _given(poses: list[Pose], grid: OccupancyGrid) -> FloatArray:
    array = np.array(poses, dtype=np.float64).reshape(-1, 3)
    array[:, 2] = se2.wrap(array[:, 2])
    for x, y, _ in array[~grid.contains(array[:, :2])]:
        raise UsageError(f"--pose: ({x:g}, {y:g}) lies off the map; {describe_extent(grid)}")
    return array


def _from_file(source: str, grid: OccupancyGrid) -> tuple[FloatArray, tuple[str, ...], list[tuple[str, ...]]]:
    from mclcli.io.tables.csv_table import read_poses

    poses, columns, rows = read_poses(source)
    off = int((~grid.contains(poses[:, :2])).sum())
    if off:
        console.warn(f"{source}: {off} of {len(poses)} poses lie off the map; {describe_extent(grid)}")
    return poses, columns, rows


def _drawn(options: PoseOptions, around: Pose, grid: OccupancyGrid) -> FloatArray:
    x, y, _ = around
    if not grid.contains([x, y]):
        raise UsageError(f"--around: ({x:g}, {y:g}) lies off the map; {describe_extent(grid)}")
    sigma, sigma_yaw = options.spread
    covariance = np.diag(np.square([sigma, sigma, sigma_yaw]))
    return particles.gaussian(
        np.array(around), covariance, options.number, rng.stream(options.seed, rng.Purpose.SCATTER)
    )


def _steps_over_all(grid: OccupancyGrid) -> tuple[float, float]:
    """Spacing [m] and turn [rad] of a lattice as fine as a picture of the whole map needs."""
    free_area = float(grid.free.sum()) * grid.resolution**2
    return max(grid.resolution, float(np.sqrt(free_area / _HEATMAP_POSITIONS))), YAW_STEP


def positions(grid: OccupancyGrid, step: float) -> FloatArray:
    """Points (P, 2) [m] of a square lattice in map, ``step`` [m] apart, in free cells; row by row from below."""
    corners = grid.to_map([[0, 0], [grid.width, 0], [grid.width, grid.height], [0, grid.height]])
    low, high = np.ceil(corners.min(axis=0) / step), np.floor(corners.max(axis=0) / step)
    xs, ys = np.arange(low[0], high[0] + 1) * step, np.arange(low[1], high[1] + 1) * step
    points = np.stack(np.meshgrid(xs, ys), axis=-1).reshape(-1, 2)
    points = points[grid.contains(points)]
    cells = np.floor(grid.to_cells(points)).astype(np.intp)
    return points[grid.free[cells[:, 1], cells[:, 0]]]


def headings(step: float) -> FloatArray:
    """Yaws (Q,) [rad] evenly over (−π, π], at most ``step`` apart, 0 among them."""
    count = max(1, int(np.ceil(se2.TAU / step - 1e-9)))
    return np.sort(se2.wrap(np.arange(count) * (se2.TAU / count)))


def lattice_poses(grid: OccupancyGrid, step: float, yaw_step: float) -> FloatArray:
    """Poses (P·Q, 3): every heading at every position, headings varying fastest."""
    points, yaws = positions(grid, step), headings(yaw_step)
    return np.column_stack([np.repeat(points, yaws.size, axis=0), np.tile(yaws, points.shape[0])])
