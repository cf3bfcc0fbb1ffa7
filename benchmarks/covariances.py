"""Whether covariances are those of the errors: ``python -m benchmarks.covariances [--drives N] [--data FOLDER]``.

Simulated drives on right maps, and on maps whose walls stand up to 10 or 20 cm off in pieces of up to 4 m; then real
logs, whose references have errors of their own. ``sample``: the particles' covariance; ``sandwich``: that of the error.
"""

from __future__ import annotations

import argparse
import dataclasses
import math
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from benchmarks.accuracy import CASES, SAMPLES, Loaded
from benchmarks.recovering import WEAN
from mclcli.evaluate.association import associate
from mclcli.evaluate.consistency import Consistency, consistency
from mclcli.geometry.trajectory import Trajectory
from mclcli.replay.loop import replay
from mclcli.settings import profiles
from samples.sim import layouts, memory
from samples.sim.building import FREE, OCCUPIED
from samples.sim.recording import Scenario, simulate
from samples.sim.robot import Drive, OdometryNoise
from samples.sim.sensors import Lidar, Mount

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from mclcli.records import TrackPoint
    from samples.sim.building import Building
    from samples.sim.recording import Recording

_LAYOUTS: dict[str, Callable[[int], Building]] = {
    "office": layouts.office_floor,
    "hall": layouts.hall,
    "corridors": layouts.corridors,
}
_WAYS = ("sample", "sandwich")
_REFERENCES = {  # standard deviations [m], [rad] of the references, as their README says, of yaw by the same matching
    "office sample": (0.0, 0.0),
    "warehouse sample": (0.0, 0.0),
    "intel": (0.05, math.radians(1.0)),
    "olin": (0.03, math.radians(1.0)),
    "trace0": (0.03, math.radians(1.0)),
    "simpath2": (0.0, 0.0),
    "wean1": (0.2, math.radians(1.0)),
    "wean3": (0.2, math.radians(1.0)),
}


class World(NamedTuple):
    """A family of drives."""

    layout: str
    off: float = 0.0  # [m] by which pieces of the map are off
    sigma: float = 0.015  # [m] of the lidar
    half: bool = False  # it looks ahead only, 5.6 m far
    noise: float = 1.0  # of the odometry


WORLDS = [
    World("office"),
    World("office", sigma=0.005),
    World("office", sigma=0.05),
    World("office", noise=3.0),
    World("office", half=True),
    World("hall"),
    World("corridors"),
    World("office", off=0.1),
    World("office", off=0.1, half=True),
    World("hall", off=0.1),
    World("corridors", off=0.1),
    World("office", off=0.2),
]


def shifted(building: Building, off: float, seed: int) -> Building:
    """The map with its walls in pieces of 2 to 4 m, each up to ``off`` [m] from its place in x and in y."""
    draws = np.random.default_rng([seed, 77])
    grid, (height, width) = building.grid.copy(), building.grid.shape
    grid[grid == OCCUPIED] = FREE
    most, size = round(off / building.resolution), round(draws.uniform(2.0, 4.0) / building.resolution)
    for y in range(0, height, size):
        for x in range(0, width, size):
            step = draws.integers(-most, most + 1, 2)
            rows, columns = np.nonzero(building.grid[y : y + size, x : x + size] == OCCUPIED)
            grid[np.clip(rows + y + step[0], 0, height - 1), np.clip(columns + x + step[1], 0, width - 1)] = OCCUPIED
    return dataclasses.replace(building, grid=grid)


def drive(world: World, seed: int) -> Recording:
    """A tour of four places, drawn by the seed, of a building drawn by the seed."""
    today = _LAYOUTS[world.layout](seed)
    mapped = shifted(today, world.off, seed) if world.off else today
    draws = np.random.default_rng([seed, 5])
    names = ("trans_per_trans", "yaw_per_trans", "yaw_per_yaw", "trans_per_yaw", "scale", "yaw_scale", "pull")
    noise = OdometryNoise(**{name: getattr(OdometryNoise(), name) * world.noise for name in names})
    field, reach, beams = (math.pi, 5.6, 180) if world.half else (2.0 * math.pi, 12.0, 360)
    lidar = Lidar(Mount(0.1, 0.0, 0.2), beams, -field / 2, field / beams, range_max=reach, rate=5.0, sigma=world.sigma)
    for _ in range(30):
        places = sorted(today.places)
        tour = tuple(places[i] for i in draws.permutation(len(places))[:4])
        scenario = Scenario(
            name=world.layout,
            mapped=mapped,
            today=today,
            tours=(tour,),
            lidar=lidar,
            noise=noise,
            drive=Drive(turn=1.2),
            seed=seed,
        )
        try:
            return simulate(scenario)
        except ValueError:  # no way between two of the places
            continue
    raise RuntimeError(f"no tour of {world.layout} {seed}")


def judged(points: Sequence[TrackPoint], truth: Trajectory, deviations: tuple[float, float]) -> Consistency:
    """Of the updates, without those more than 1 m off: that is being lost."""
    steps = [p for p in points if p.step and truth.stamps_ns[0] <= p.stamp_ns <= truth.stamps_ns[-1]]
    poses, covariances = (np.array([getattr(p.estimate, name) for p in steps]) for name in ("pose", "covariance"))
    pairs = associate(Trajectory(np.array([p.stamp_ns for p in steps]), poses, covariances), truth)
    near = np.hypot(*(pairs.estimated - pairs.expected)[:, :2].T) < 1.0
    found = consistency(dataclasses.replace(pairs, updated=pairs.updated & near), deviations)
    if found is None:
        raise SystemExit("no update states a covariance")
    return found


def simulated(drives: int) -> None:
    """Each family with so many buildings."""
    print(
        "| map | lidar | odometry | sample: ANEES/3, in 95 % | sandwich: ANEES/3 (worst drive), in 95 % |\n"
        + "|---" * 5
        + "|"
    )
    for world in WORLDS:
        found: dict[str, list[Consistency]] = {way: [] for way in _WAYS}
        for seed in range(1000, 1000 + drives):
            recording = drive(world, seed)
            truth = Trajectory(recording.truth.stamps_ns, recording.truth.poses)
            for way in _WAYS:
                settings = profiles.build({"hypotheses": 0, "covariance": way})
                setup = memory.setup(recording, settings, seed=seed, alpha="auto")
                found[way].append(judged(list(replay(memory.events(recording), setup)), truth, (0.0, 0.0)))
        wall = f"{world.layout}, pieces {100 * world.off:.0f} cm off" if world.off else f"{world.layout}, right"
        lidar = f"σ {1e3 * world.sigma:.0f} mm" + ", 180°, 5.6 m" * world.half
        cells = [f"{_mean(found['sample'], 'anees'):.2f}, {_mean(found['sample'], 'ellipse'):.0%}"]
        worst = max(one.anees for one in found["sandwich"])
        cells.append(
            f"{_mean(found['sandwich'], 'anees'):.2f} ({worst:.2f}), {_mean(found['sandwich'], 'ellipse'):.0%}"
        )
        print(f"| {wall} | {lidar} | × {world.noise:g} | {' | '.join(cells)} |", flush=True)


def real(data: Path) -> None:
    """Logs with a reference, tracked from it."""
    print(
        "\n| log | reference ± | sample: ANEES/3, in 95 % | sandwich: ANEES/3, in 95 %, of x and y |\n"
        + "|---" * 4
        + "|"
    )
    for name, deviations in _REFERENCES.items():
        case, folder = (SAMPLES[name], Path()) if name in SAMPLES else ({**CASES, **WEAN}[name], data)
        if not (folder / case.log).exists():
            continue
        loaded, cells = Loaded.of(case, folder), []
        for way in _WAYS:
            points = loaded.run(loaded.setup(profiles.build({"hypotheses": 0, "covariance": way}), 0))
            c = judged(points, Trajectory(loaded.reference.stamps_ns, loaded.reference.poses), deviations)
            cells.append(f"{c.anees:.2f}, {c.ellipse:.0%}" + f", {c.ellipse_xy:.0%}" * (way == "sandwich"))
        print(
            f"| {name} | {100 * deviations[0]:.0f} cm, {math.degrees(deviations[1]):.0f}° | {' | '.join(cells)} |",
            flush=True,
        )


def _mean(found: Sequence[Consistency], name: str) -> float:
    return float(np.mean([getattr(one, name) for one in found]))


def main() -> None:
    """Run and print."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--drives", type=int, default=8)
    options.add_argument("--data", type=Path, default=Path("../shared/data"), help="folder of the real logs")
    chosen = options.parse_args()
    simulated(chosen.drives)
    real(chosen.data)


if __name__ == "__main__":
    main()
