"""The worked example of the documentation: a map of two walls, three landmarks, three scans and their poses."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple, final

import numpy as np

from samples.sim.building import FREE, OCCUPIED
from samples.sim.files import write_lines, write_map_pgm

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

ORIGIN = (-3.0, -3.0, 0.0)
RESOLUTION = 0.05
LANDMARKS = ("id,x,y,z", "1,-1,0,0", "2,1,0.5,0", "3,0,-1,0")


@final
class Example(NamedTuple):
    """One scan of nine beams, with sightings (id, bearing [deg]) and candidate poses (x, y [m], yaw [deg])."""

    ranges: tuple[float, ...]
    bearings: tuple[tuple[str, int], ...]
    poses: tuple[tuple[float, float, int], ...]


EXAMPLES = {
    "set1": Example(
        (2.8, 3.0, 3.2, 3.1, 3.0, 3.2, 2.9, 2.7, 2.6),
        (("1", 70), ("2", 20), ("3", -95)),
        ((-0.5, -0.8, 90), (-0.2, -0.6, 88), (0.8, 0.1, 30)),
    ),
    "set2": Example(
        (1.05, 0.95, 0.86, 9.0, 0.80, -0.5, 0.87, 0.93, 2.9),
        (("1", 35), ("2", -50), ("3", -130), ("99", 0)),
        ((-0.5, -0.8, 90), (-0.45, -0.78, 95), (0.8, -1.1, -40), (0.85, -1.0, -37)),
    ),
    "set3": Example(
        (0.91, 0.86, 0.86, 0.80, 0.78, 0.82, 0.99, 1.14, 1.21),
        (),
        ((0.91, -0.81, -65), (0.96, -0.77, -63), (-2.21, 0.93, -100)),
    ),
}


def reference_grid() -> NDArray[np.int8]:
    """Map of the example: (120, 120) int8, a wall 5 m long and a block of half a metre."""
    grid = np.full((120, 120), FREE, dtype=np.int8)
    grid[60, 10:110] = OCCUPIED
    grid[20:30, 85:95] = OCCUPIED
    return grid


def write_reference(maps: Path, samples: Path) -> list[Path]:
    """Write the example's map to ``maps``, everything else to ``samples``; returns the paths."""
    write_map_pgm(reference_grid(), RESOLUTION, ORIGIN, maps / "reference.yaml")
    write_lines(samples / "reference.landmarks.csv", list(LANDMARKS))
    written = [maps / "reference.yaml", maps / "reference.pgm", samples / "reference.landmarks.csv"]
    for name, example in EXAMPLES.items():
        files = {".yaml": _scan_yaml(example), ".poses.csv": _pose_rows(example)}
        if example.bearings:
            files[".bearings.csv"] = ["id,bearing", *(f"{mark},{angle}deg" for mark, angle in example.bearings)]
        for suffix, lines in files.items():
            written.append(samples / f"reference_{name}{suffix}")
            write_lines(written[-1], lines)
    return written


def _pose_rows(example: Example) -> list[str]:
    return ["x,y,yaw", *(f"{x},{y},{yaw}deg" for x, y, yaw in example.poses)]


def _scan_yaml(example: Example) -> list[str]:
    """LaserScan as ``ros2 topic echo`` prints it, with the angles in full precision."""
    head = ["header:", "  stamp:", "    sec: 0", "    nanosec: 0", "  frame_id: laser"]
    angles = {"angle_min": -40, "angle_max": 40, "angle_increment": 10}
    fields = [f"{name}: {math.radians(degrees)!r}" for name, degrees in angles.items()]
    fields += ["time_increment: 0.0", "scan_time: 0.0", "range_min: 0.0", "range_max: 8.0"]
    return [*head, *fields, "ranges:", *(f"- {value}" for value in example.ranges), "intensities: []", "---"]
