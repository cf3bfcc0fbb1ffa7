"""The places that compete, each with the mass of the poses around it, and their shares.

Places are peaks that suppress their neighbours. The beam model looks at the foremost of them before they are weighed.

The likelihood field looks at endpoints alone: a beam may pass through any wall. The beam model does not, and so
corrects each place's mass by exp(α·(its log p − the field's)), both relative to the best place.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.geometry import se2
from mclcli.search.calibration import Figures

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray, IntArray
    from mclcli.search.branching import Found, Search
    from mclcli.search.lattice import Lattice
    from mclcli.search.scene import Scene, View

MOST = 32  # peaks that are looked for
RESCORED = 16  # places that the beam model looks at
_CLEAREST = 50.0  # nats between which odds are told


@final
@dataclass(frozen=True, slots=True, eq=False)
class Peaks:
    """Peaks, the highest first: ``keys`` (M,), ``values`` (M,) and ``masses`` (M,).

    A mass is Σ exp(alpha·(value − best)) over the leaves around a peak; ``rest`` is that of those around none of them.
    """

    keys: IntArray
    values: FloatArray
    masses: FloatArray
    rest: float


def find_peaks(found: Found, lattice: Lattice, alpha: float, radius: float, angle: float) -> Peaks:
    """Peaks of the leaves; those within ``radius`` [cells] and ``angle`` [rad] of a higher peak belong to it."""
    poses, mass = lattice.poses(found.keys), np.exp(alpha * (found.values - found.best))
    left = np.arange(found.keys.size)
    numbers: list[int] = []
    masses: list[float] = []
    while left.size and len(numbers) < MOST:
        peak = poses[left[0]]
        offset = poses[left] - peak
        near = (offset[:, 0] ** 2 + offset[:, 1] ** 2 <= radius**2) & (np.abs(se2.wrap(offset[:, 2])) <= angle)
        numbers.append(int(left[0]))
        masses.append(float(mass[left[near]].sum()))
        left = left[~near]
    return Peaks(found.keys[numbers], found.values[numbers], np.array(masses), float(mass[left].sum()))


@final
@dataclass(frozen=True, slots=True, eq=False)
class Weighing:
    """Places by share: ``order`` (M,) numbers of peaks, ``shares`` (M,) in that order, and of being ``elsewhere``.

    ``log_beam`` (≤ M,) by number of peak. Everything is as the models say, before the calibration.
    """

    order: IntArray
    shares: FloatArray
    elsewhere: float
    log_beam: FloatArray
    figures: Figures


def weigh(
    scene: Scene, view: View, search: Search, found: Found, peaks: Peaks, alpha: float, off_map_prior: float
) -> Weighing:
    """Weigh the places against each other and against not being on this map."""
    nodes = scene.to_map(search.lattice.poses(peaks.keys[:RESCORED]))
    judge = scene.rays.measure("lidar", view.rays)
    log_beam = judge.log_likelihood(nodes)
    log_off = _log_off_map(scene, view, search, found.best, alpha, off_map_prior)
    field = np.log(peaks.masses)
    corrected = field.copy()
    log_field = scene.model.measure("lidar", view.beams).log_likelihood(nodes)  # without the sightings
    gain = (log_beam - log_beam[0]) - (log_field - log_field[0])
    corrected[: len(nodes)] += np.clip(alpha * gain, -_CLEAREST, _CLEAREST)
    order = np.argsort(-corrected, kind="stable")
    rest = math.log(peaks.rest) if peaks.rest > 0.0 else -math.inf
    everything = np.logaddexp.reduce([*corrected, log_off, rest])
    first = min(int(order[0]), len(nodes) - 1)
    beams = view.beams.ranges.size
    figures = Figures(
        log_odds=_log_odds(corrected, int(order[0]), log_off, rest),
        log_odds_field=_log_odds(field, int(order[0]), log_off, rest),
        misfit=float(search.log_p.max()) - float(log_field[first]) / max(beams, 1),
        misfit_rays=(judge.log_peak - float(log_beam[first])) / max(judge.count, 1),
    )
    shares = np.exp(corrected[order] - everything)
    return Weighing(order, shares, float(np.exp(log_off - everything)), log_beam, figures)


def _log_off_map(scene: Scene, view: View, search: Search, best: float, alpha: float, prior: float) -> float:
    """Log mass of being elsewhere, in the unit of the others: e^{alpha·best} at one pose.

    There beams end in any known cell, and landmarks stand in any direction.
    """
    if prior == 0.0:
        return -math.inf
    stray = view.beams.ranges.size * scene.log_stray(view.beams.r_max)
    stray -= len(search.sightings.marks) * math.log(2.0 * math.pi)
    return math.log(prior / (1.0 - prior)) + math.log(search.lattice.size) + alpha * (stray - best)


def _log_odds(log_masses: FloatArray, first: int, log_off: float, rest: float) -> float:
    """Log odds of one place against all else, bounded."""
    others = np.logaddexp.reduce([*np.delete(log_masses, first), log_off, rest])
    return float(np.clip(log_masses[first] - others, -_CLEAREST, _CLEAREST))
