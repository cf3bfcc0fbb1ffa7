"""The reliability figure of robots that are tracked and of lost ones, in every profile and with every model.

``python -m benchmarks.lost [--data FOLDER] [--logs NAME...] [--profiles P...] [--models M...] [--seconds S]``.

Lost ones are begun around poses drawn from the free cells of the map, where the filter has to believe them, at moments
spread over the log. *Corridor*: updates where the scan, put where the robot really is, fits as well a metre further
along some direction; being off along it is nothing that a scan could tell. They do not count as undetected.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import mclcli as mcl
from benchmarks.accuracy import CASES, SAMPLES, Loaded
from mclcli.filter import particles
from mclcli.filter.fit import PROBABLY_LOST
from mclcli.filter.start import GIVEN_SPREAD
from mclcli.sensors.beams import BeamSelection, select
from mclcli.sensors.likelihood_field import LikelihoodField, LikelihoodFieldParameters
from mclcli.sensors.models import LIDAR_MODELS
from mclcli.settings.profiles import PROFILES
from mclcli.world import distance_field

if TYPE_CHECKING:
    from mclcli.records import TrackPoint
    from mclcli.settings.profiles import Settings

_LOGS = ("office sample", "warehouse sample", "intel", "olin", "trace0", "simpath2")
_RIGHT, _WRONG = 0.3, 1.0  # [m]
_SLID, _AS_WELL = 1.0, 0.05  # [m] along a corridor, and the fit that this may cost
_DIRECTIONS = np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False)


@dataclass(frozen=True)
class Judged:
    """Reliability of updates (U,), error of position [m] there, and whether they are in a corridor."""

    fits: np.ndarray
    errors: np.ndarray
    corridor: np.ndarray

    def row(self, name: str) -> str:
        """A line of the table."""
        healthy, off = self.fits[self.errors < _RIGHT], self.errors > _WRONG
        told, plain = self.fits < PROBABLY_LOST, off & ~self.corridor
        alarms = f"{100 * np.mean(healthy < PROBABLY_LOST):.1f} %" if healthy.size else ""
        least = f"{np.percentile(healthy, 1):.2f}" if healthy.size else ""
        every, without = (f"{100 * np.mean(told[of]):.0f} %" if of.any() else "" for of in (off, plain))
        return f"| {name} | {healthy.size} | {least} | {alarms} | {off.sum()} | {every} | {plain.sum()} | {without} |"


def pooled(parts: list[Judged]) -> Judged:
    """All of them as one."""
    return Judged(*(np.concatenate([getattr(p, name) for p in parts]) for name in ("fits", "errors", "corridor")))


class Corridors:
    """Tells where a scan says nothing of where along a line the robot is."""

    def __init__(self, loaded: Loaded) -> None:
        self._loaded = loaded
        grid = mcl.load_map(loaded.data / loaded.case.grid)
        self._model = LikelihoodField(distance_field.compute(grid, "exact", 2.0), LikelihoodFieldParameters())

    def among(self, points: list[TrackPoint]) -> np.ndarray:
        """Whether each point (N,) is in one."""
        reference, frames = self._loaded.reference, self._loaded.recording.survey.frames
        base = self._loaded.recording.roles().base_frame
        found = np.zeros(len(points), np.bool_)
        for i, point in enumerate(points):
            assert point.scan is not None  # noqa: S101 - all logs have a lidar
            mount = frames.lookup(base, point.scan.frame_id, point.stamp_ns)
            assert mount is not None  # noqa: S101 - they were just run
            measured = self._model.measure("lidar", select(point.scan, mount, BeamSelection()))
            true = reference.poses[int(np.argmin(np.abs(reference.stamps_ns - point.stamp_ns)))]
            slid = np.tile(true, (_DIRECTIONS.size + 1, 1))
            slid[1:, :2] += _SLID * np.stack([np.cos(_DIRECTIONS), np.sin(_DIRECTIONS)], axis=-1)
            span = measured.log_peak - measured.log_floor
            fits = measured.log_likelihood(slid) / span if span else np.zeros(len(slid))
            found[i] = fits[1:].max() > fits[0] - _AS_WELL
        return found


def judged(loaded: Loaded, points: list[TrackPoint], corridors: Corridors) -> Judged:
    """What the updates of a run say."""
    updated = [point for point in points if point.step]
    fits = np.array([point.step.reliability for point in updated if point.step])
    return Judged(fits, loaded.errors(updated), corridors.among(updated))


def measured(loaded: Loaded, settings: Settings, starts: int, seconds: float, corridors: Corridors) -> Judged:
    """One log: tracked from its reference, and lost from several moments on."""
    first, last = int(loaded.reference.stamps_ns[0]), int(loaded.reference.stamps_ns[-1])
    length = int(seconds * 1e9)
    setup = loaded.setup(settings, 0)
    runs = [replace(setup, window_ns=(first, first + 3 * length))]
    grid = mcl.load_map(loaded.data / loaded.case.grid)
    drawn = particles.uniform(grid, starts, np.random.default_rng(0))
    for pose, begin in zip(drawn, np.linspace(first, max(first, last - length), starts).astype(int), strict=True):
        setup = loaded.setup(settings, 0, mcl.AroundPose(pose, GIVEN_SPREAD))
        runs.append(replace(setup, window_ns=(int(begin), int(begin) + length)))
    return pooled([judged(loaded, loaded.run(run), corridors) for run in runs])


def main() -> None:
    """Run and print."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--data", type=Path, default=Path("../shared/data"), help="folder of the real logs")
    options.add_argument("--logs", nargs="+", default=list(_LOGS))
    options.add_argument("--profiles", nargs="+", default=list(PROFILES), choices=list(PROFILES))
    options.add_argument("--models", nargs="+", default=list(LIDAR_MODELS), choices=list(LIDAR_MODELS))
    options.add_argument("--lost", type=int, default=6, help="wrong starts per log")
    options.add_argument("--seconds", type=float, default=40.0, help="of each wrong start; tracked thrice as long")
    chosen = options.parse_args()
    cases = {name: (CASES[name], chosen.data) if name in CASES else (SAMPLES[name], Path()) for name in chosen.logs}
    logs = {name: Loaded.of(case, data) for name, (case, data) in cases.items() if (data / case.log).exists()}
    corridors = {name: Corridors(loaded) for name, loaded in logs.items()}
    head = f"| profile, model, log | healthy | 1 % | below {PROBABLY_LOST:g} | > 1 m off | told | no corridor | told |"
    print(f"{head}\n|---|---|---|---|---|---|---|---|")
    for profile in chosen.profiles:
        for model in chosen.models:
            settings = mcl.settings({"hypotheses": 0}, profile=profile, model=model)
            parts = []
            for name, loaded in logs.items():
                parts.append(measured(loaded, settings, chosen.lost, chosen.seconds, corridors[name]))
                print(parts[-1].row(f"{profile}, {model}, {name}"), flush=True)
            print(pooled(parts).row(f"**{profile}, {model}**"), flush=True)


if __name__ == "__main__":
    main()
