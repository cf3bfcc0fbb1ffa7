"""Simulated logs, where the truth is known: ``python -m benchmarks.simulated kidnapped|sweep``."""

from __future__ import annotations

import argparse
import functools
from typing import TYPE_CHECKING

import numpy as np

from mclcli.geometry import se2
from mclcli.replay.loop import replay
from mclcli.settings import profiles
from samples.sim import memory
from samples.sim.layouts import office_floor
from samples.sim.recording import Recording, Scenario, simulate
from samples.sim.robot import Drive, OdometryNoise
from samples.sim.sensors import Lidar, Mount

if TYPE_CHECKING:
    from samples.sim.building import Building

_TOURS = (("lobby", "south2", "south3"), ("north4", "core1", "lobby", "south3", "south5"))
_FOUND = 0.5  # [m]


@functools.cache
def _floor() -> Building:
    return office_floor(seed=4, origin=(-9.6, -6.4, 0.0))


def simulated(seed: int, tours: tuple[tuple[str, ...], ...], noise: float = 1.0, sweep: float = 0.0) -> Recording:
    """Drive through the office; ``noise`` scales the odometry's."""
    plain = OdometryNoise()
    scaled = {
        name: getattr(plain, name) * noise
        for name in ("trans_per_trans", "yaw_per_trans", "yaw_per_yaw", "trans_per_yaw", "scale", "yaw_scale", "pull")
    }
    lidar = Lidar(Mount(0.1, 0.0, 0.2), sweep=sweep, rate=5.0)
    return simulate(
        Scenario(
            name="office",
            mapped=_floor(),
            tours=tours,
            lidar=lidar,
            noise=OdometryNoise(**scaled),
            drive=Drive(turn=1.6),
            seed=seed,
        )
    )


def kidnapped(seeds: int) -> None:
    """How often and how soon a robot that was carried away is found again."""
    recording = simulated(3, _TOURS)
    jump = int(np.argmax(np.hypot(*np.diff(recording.truth.poses[:, :2], axis=0).T)))
    carried_ns = int(recording.truth.stamps_ns[jump])
    events = memory.events(recording)
    left = (int(recording.truth.stamps_ns[-1]) - carried_ns) * 1e-9
    print(f"| particles | found again within {left:.0f} s | median time | drawn anew before |\n|---|---|---|---|")
    for number in (1000, 2000, 5000, 20_000):
        settings = profiles.build({"particles": number, "recovery": "uniform", "hypotheses": 0})
        results = []
        for seed in range(seeds):
            points = list(replay(events, memory.setup(recording, settings, seed=seed, alpha="auto")))
            stamps = np.array([point.stamp_ns for point in points])
            poses = np.array([point.estimate.pose for point in points])
            off = np.hypot(*(poses - recording.truth.at(stamps))[:, :2].T) >= _FOUND
            last = int(np.flatnonzero(off)[-1])
            before = [p.step.injected for p in points if p.step and p.stamp_ns <= carried_ns]
            back = (stamps[last + 1] - carried_ns) * 1e-9 if last + 1 < len(stamps) - 10 else np.inf
            results.append((back, sum(before) / number / len(before)))
        times, shares = np.array(results).T
        found = np.isfinite(times)
        typical = f"{np.median(times[found]):.0f} s" if found.any() else "–"
        print(f"| {number} | {found.sum()} of {seeds} | {typical} | {100 * shares.mean():.2f} % |", flush=True)


def sweep(seeds: int) -> None:
    """Errors with and without ``--deskew``."""
    print("| a turn of the lidar takes | deskew | RMSE [m] | RMSE [°] |\n|---|---|---|---|")
    settings = profiles.build({"hypotheses": 0})
    for lasting in (0.05, 0.1, 0.19):
        recording = simulated(3, _TOURS[:1], 1.0, lasting)
        for deskew in (False, True):
            errors = []
            for seed in range(seeds):
                setup = memory.setup(recording, settings, seed=seed, alpha="auto", deskew=deskew)
                points = list(replay(memory.events(recording), setup))
                wrong = np.array([p.estimate.pose for p in points]) - recording.truth.at(
                    np.array([p.stamp_ns for p in points])
                )
                errors.append((np.mean(wrong[:, 0] ** 2 + wrong[:, 1] ** 2), np.mean(se2.wrap(wrong[:, 2]) ** 2)))
            distance, yaw = np.sqrt(np.median(errors, axis=0))
            print(f"| {lasting * 1e3:.0f} ms | {'yes' if deskew else 'no'} | {distance:.3f} | {np.degrees(yaw):.2f} |")


TABLES = {"kidnapped": kidnapped, "sweep": sweep}


def main() -> None:
    """Run and print."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("table", choices=list(TABLES))
    options.add_argument("--seeds", type=int, default=20, help="seeds 0 to N−1")
    chosen = options.parse_args()
    TABLES[chosen.table](chosen.seeds)


if __name__ == "__main__":
    main()
