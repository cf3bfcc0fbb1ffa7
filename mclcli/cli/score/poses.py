"""The poses that ``mcl score`` scores, from all the ways of naming them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, final

import numpy as np

from mclcli import rng
from mclcli.cli import console
from mclcli.errors import UsageError
from mclcli.filter import lattice, particles
from mclcli.geometry import se2
from mclcli.quantity import parse_list
from mclcli.replay.setup import describe_extent

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray
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


def collect(arguments: dict[str, Any], grid: OccupancyGrid) -> Candidates:
    """Poses of --pose, then --poses, --around and --grid."""
    sets = [_given(arguments["given"], grid)]
    columns: tuple[str, ...] = ()
    texts: list[tuple[str, ...]] = []
    if arguments["poses_file"]:
        poses, columns, rows = _from_file(arguments["poses_file"], grid)
        texts = [("",) * len(columns)] * len(sets[0]) + rows
        sets.append(poses)
    if arguments["around"] is not None:
        sets.append(_drawn(arguments, grid))
    step = 0.0
    if arguments["lattice"] or (arguments["heatmap"] and sum(len(s) for s in sets) == 0):
        step, yaw_step = _steps(arguments["lattice"], grid)
        sets.append(lattice.poses(grid, step, yaw_step))
    poses = np.concatenate(sets)
    if not poses.size:
        raise UsageError("no pose to score; name some with --pose, --poses, --around or --grid")
    texts += [("",) * len(columns)] * (len(poses) - len(texts)) if columns else []
    return Candidates(poses, columns, texts, step)


def _given(poses: list[tuple[float, ...]], grid: OccupancyGrid) -> FloatArray:
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


def _drawn(arguments: dict[str, Any], grid: OccupancyGrid) -> FloatArray:
    x, y, yaw = arguments["around"]
    if not grid.contains([x, y]):
        raise UsageError(f"--around: ({x:g}, {y:g}) lies off the map; {describe_extent(grid)}")
    spread = parse_list(arguments["spread"], ("m", "rad"), "--spread")
    if len(spread) != 2 or min(spread) < 0.0:
        raise UsageError(f"--spread: '{arguments['spread']}' is not SXY,SYAW, two standard deviations")
    covariance = np.diag(np.square([spread[0], spread[0], spread[1]]))
    draws = rng.stream(arguments["seed"], rng.Purpose.SCATTER)
    return particles.gaussian(np.array([x, y, yaw]), covariance, arguments["number"], draws)


def _steps(text: str | None, grid: OccupancyGrid) -> tuple[float, float]:
    """Spacing [m] and turn [rad] of the lattice; without --grid as fine as a picture of the whole map needs."""
    if text is None:
        free_area = float(grid.free.sum()) * grid.resolution**2
        return max(grid.resolution, float(np.sqrt(free_area / _HEATMAP_POSITIONS))), float(np.radians(5.0))
    steps = parse_list(text, ("m", "rad"), "--grid")
    if min(steps) <= 0.0:
        raise UsageError(f"--grid: '{text}' needs steps greater than 0")
    return steps[0], steps[1] if len(steps) > 1 else float(np.radians(5.0))
