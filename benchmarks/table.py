"""Prints the table of docs/performance.md: ``python -m benchmarks.table [--data FOLDER]``.

Run from the repository's root, with mcl installed in this interpreter's environment.
"""

from __future__ import annotations

import argparse
import datetime as dt
import platform
import sys
from pathlib import Path

import numpy as np

from benchmarks.measure import alternate, peak_memory, process, table, timed
from mclcli import compiled
from mclcli.sensors.beams import Beams
from mclcli.sensors.likelihood_field import LikelihoodField, LikelihoodFieldParameters
from mclcli.world.distance_field import DistanceField

Row = tuple[str, str, str]


def straightforward(field: DistanceField, beams: Beams, poses: np.ndarray) -> np.ndarray:
    """The likelihood field as one would write it in NumPy: all endpoints at once, distances in metres."""
    metres = field.metres()
    c, s = np.cos(poses[:, 2, None]), np.sin(poses[:, 2, None])
    x = poses[:, 0, None] + c * beams.endpoints[:, 0] - s * beams.endpoints[:, 1]
    y = poses[:, 1, None] + s * beams.endpoints[:, 0] + c * beams.endpoints[:, 1]
    column = np.floor((x - field.origin[0]) / field.resolution).astype(int)
    row = np.floor((y - field.origin[1]) / field.resolution).astype(int)
    inside = (column >= 0) & (column < metres.shape[1]) & (row >= 0) & (row < metres.shape[0])
    d = np.where(inside, metres[row.clip(0, metres.shape[0] - 1), column.clip(0, metres.shape[1] - 1)], field.max_dist)
    p = 0.5 * np.exp(-0.5 * (d / 0.2) ** 2) + 0.5 / beams.r_max
    return np.asarray(np.log(p).sum(axis=1))


def scoring(particles: int = 2000, count: int = 60, cells: int = 600) -> Row:
    """A concentrated cloud over a map of random obstacles."""
    rng = np.random.default_rng(0)
    levels = np.append(np.sqrt(np.arange(1600)) * 0.05, 2.0)
    codes = rng.integers(0, 1600, (cells, cells)).astype(np.uint16)
    field = DistanceField(codes, levels, 0.05, np.zeros(3))
    angles = np.linspace(-2.0, 2.0, count)
    ranges = rng.uniform(0.5, 10.0, count)
    beams = Beams(np.zeros((count, 2)), np.stack([np.cos(angles), np.sin(angles)], axis=-1), ranges, 12.0)
    poses = np.column_stack([15 + rng.normal(0, 0.2, (particles, 2)), rng.normal(0, 0.05, particles)])
    score = LikelihoodField(field, LikelihoodFieldParameters(), job_size=np.inf).measure("lidar", beams).log_likelihood
    assert np.allclose(score(poses), straightforward(field, beams, poses), rtol=1e-12)  # noqa: S101
    pair = alternate(timed(lambda: score(poses), 20), timed(lambda: straightforward(field, beams, poses), 3), 7)
    each = pair.a / (particles * count) * 1e9
    what = f"score {particles} poses × {count} beams, in process"
    return (
        what,
        f"{pair.a * 1e3:.2f} ms ({each:.1f} ns per pose·beam)",
        f"{1 / pair.ratio:.0f} × as fast as plain NumPy",
    )


def start_up() -> Row:
    """``mcl --help`` against importing click."""
    mcl = str(Path(sys.executable).parent / "mcl")
    pair = alternate(process(mcl, "--help"), process(sys.executable, "-c", "import click"), 15)
    return "`mcl --help`", f"{pair.a * 1e3:.0f} ms", f"{pair.ratio:.2f} × `python -c 'import click'`"


def memory() -> Row:
    """Peak memory of a million poses against 360 beams."""
    code = (
        "import numpy as np\n"
        "from mclcli.sensors.beams import Beams\n"
        "from mclcli.sensors.likelihood_field import *\n"
        "from mclcli.world.distance_field import DistanceField\n"
        "n, k = 1_000_000, 360\n"
        "field = DistanceField(np.zeros((2000, 2000), np.uint16), np.array([0.0, 2.0]), 0.05, np.zeros(3))\n"
        "beams = Beams(np.zeros((k, 2)), np.ones((k, 2)), np.ones(k), 12.0)\n"
        "poses = np.random.default_rng(0).uniform(0, 100, (n, 3))\n"
        "LikelihoodField(field, LikelihoodFieldParameters()).measure('lidar', beams).log_likelihood(poses)\n"
    )
    bare = peak_memory("import numpy")
    return (
        "memory of 1,000,000 poses × 360 beams",
        f"{peak_memory(code):.0f} MiB",
        f"{bare:.0f} MiB for importing NumPy",
    )


def whole_run(data: Path) -> list[Row]:
    """The Olin log from files to track, against the time the robot took."""
    log, map_file = data / "olin/macfirst_floor_take_2", data / "olin/mac_1st_floor_9_23.yaml"
    if not log.exists():
        return [("`mcl run` on Olin", "not measured: its data are not here", "")]
    mcl = str(Path(sys.executable).parent / "mcl")
    words = (mcl, "run", str(log), "--map", str(map_file), "--init", str(data / "olin/matched.tum"), "--track", "-")
    pair = alternate(process(*words), process(sys.executable, "-c", "import numpy, numba"), 5)
    what = "`mcl run`, Olin: 357 scans × 720 beams, 2,000 particles, whole process"
    return [
        (what, f"{pair.a:.2f} s ({46.2 / pair.a:.0f} × real time)", f"{pair.ratio:.1f} × importing NumPy and numba")
    ]


def main() -> None:
    """Measure and print."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--data", type=Path, default=Path("../shared/data"), help="folder of the real logs")
    data = options.parse_args().data
    compiled.load("likelihood_field")
    rows = [start_up(), scoring(), scoring(2000, 360), scoring(100_000, 60), memory(), *whole_run(data)]
    versions = f"Python {platform.python_version()}, NumPy {np.__version__}"
    print(f"{dt.datetime.now(dt.UTC):%Y-%m-%d}, {platform.machine()}, {versions}\n")
    print(table(rows))


if __name__ == "__main__":
    main()
