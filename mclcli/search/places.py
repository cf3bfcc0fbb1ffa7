"""Places: candidates refined on the interpolated field, merged where they are one, each with its volume.

Of one scan, a place is a pose; of a window, a path of poses, one for each scan, joined by odometry's own uncertainty.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.geometry import se2
from mclcli.search import refine, tracks
from mclcli.search.calibration import LAW
from mclcli.search.tracks import Ends

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray, IntArray
    from mclcli.search.candidates import Candidates, Temper
    from mclcli.search.parameters import SearchParameters
    from mclcli.search.scene import Scene, View
    from mclcli.sensors.beams import Beams

_FOLLOWED = 40  # paths that are smoothed
_CLOSE = 0.5  # of the distance of places: nearer paths lead to one place, before they are smoothed
_SMOOTHING = 12  # steps
_ALPHA = 0.3  # before the beams' correlation at the best path is known


@final
@dataclass(frozen=True, slots=True, eq=False)
class Places:
    """Distinct places: ``paths`` (M, n, 3) of the base in map at every scan, and the covariance (M, 3, 3) of the ends.

    ``first`` (M, 3, 3) is that of the first poses. ``log_volumes`` (M,) are those of the modes, in so many dimensions;
    ``odometry`` (M,) what the paths cost by odometry; ``ends`` are the scans' factors with their temperatures.
    """

    paths: FloatArray
    covariances: FloatArray
    first: FloatArray
    log_volumes: FloatArray
    odometry: FloatArray
    ends: Ends

    @property
    def poses(self) -> FloatArray:
        """Poses (M, 3) of the base at the last scan."""
        return np.asarray(self.paths[:, -1])


def find_places(
    scene: Scene,
    view: View,
    found: list[tuple[Candidates, int, Beams]],
    parameters: SearchParameters,
    temper: Temper,
) -> Places:
    """The distinct places among candidates, each with the number of the scan that they are of and its beams.

    The first candidates are those of all scans together.
    """
    models = [tracks.interpolating(scene.model, LAW.outliers, sight.beams.r_max) for sight in view.sights]
    beams = [sight.beams for sight in view.sights]
    cell = scene.model.field.resolution
    spacing = np.array([cell, cell, found[0][0].spacing])
    radii = np.array([parameters.mode_distance, parameters.mode_distance, parameters.mode_angle])
    if view.odometry is None:
        ends = Ends(models, beams, np.array([found[0][0].alpha]))
        return _of_one_scan(found[0][0], ends, view, spacing, radii)
    ends = Ends(models, beams, np.full(len(models), _ALPHA))
    paths = _followed(view, found, ends, spacing)
    costs = tracks.costs_of(paths, ends, view)
    paths = paths[distinct(paths[:, -1], costs, _CLOSE * radii)[:_FOLLOWED]]
    each = [model.each(scan, pose[np.newaxis])[0] for model, scan, pose in zip(models, beams, paths[0], strict=True)]
    alphas = [temper(log_p) if log_p.size > 1 else 1.0 for log_p in each]
    ends = Ends(models, beams, np.full(len(models), float(np.mean(alphas))))
    smoothed = tracks.settle(paths, ends, view, _SMOOTHING)
    paths = smoothed.poses.copy()
    for k in (0, -1):  # errors of odometry that are the same all along, a wrong scale, bend a path at its ends
        how = refine.after_drift(spacing, 1.0)
        paths[:, k], _ = refine.refine(models[k], beams[k], paths[:, k], how)
    return _merged(paths, smoothed.costs, smoothed.odometry_costs.sum(axis=1), ends, view, spacing, radii)


def _of_one_scan(found: Candidates, ends: Ends, view: View, spacing: FloatArray, radii: FloatArray) -> Places:
    """Places of a single scan."""
    how = refine.on_lattice(spacing, found.alpha)
    poses, _ = refine.refine(ends.models[0], ends.beams[0], found.nodes, how)
    paths = poses[:, np.newaxis]
    return _merged(paths, ends.costs(paths)[:, 0], np.zeros(len(paths)), ends, view, spacing, radii)


def _merged(
    paths: FloatArray,
    costs: FloatArray,
    odometry: FloatArray,
    ends: Ends,
    view: View,
    spacing: FloatArray,
    radii: FloatArray,
) -> Places:
    """Distinct places among refined paths (M, n, 3), which cost so much (M,), and so much of it by odometry.

    A covariance is at least that of a pose somewhere in a step of the lattice, ``spacing`` (3,).
    """
    factor = tracks.factorised(paths, ends, view)
    log_volumes = 1.5 * paths.shape[1] * math.log(2.0 * math.pi) - 0.5 * factor.log_determinants()
    kept = distinct(paths[:, -1], costs - log_volumes, radii)
    covariances = factor.marginals()[0][kept] + np.diag(spacing**2 / 12.0)
    return Places(
        paths=paths[kept],
        covariances=covariances[:, -1],
        first=covariances[:, 0],
        log_volumes=log_volumes[kept] + _inside(covariances[:, -1], radii),
        odometry=odometry[kept],
        ends=ends,
    )


def _followed(view: View, found: list[tuple[Candidates, int, Beams]], ends: Ends, spacing: FloatArray) -> FloatArray:
    """Paths (M, n, 3) of all candidates.

    Drift of odometry displaces early scans of a whole window, so that its candidates are refined on the last few alone.
    """
    paths = []
    for candidates, last, beams in found:
        poses, _ = refine.refine(
            ends.models[last], beams, candidates.nodes, refine.on_lattice(spacing, candidates.alpha)
        )
        if beams is found[0][2] and view.stretches:
            how = refine.after_drift(spacing, candidates.alpha)
            poses, _ = refine.refine(ends.models[last], view.stretches[-1].beams, poses, how)
        paths.append(tracks.follow(poses, last, ends, view, spacing))
    return np.concatenate(paths)


def distinct(poses: FloatArray, costs: FloatArray, radii: FloatArray) -> IntArray:
    """Numbers of the poses (M, 3) that are at no cheaper place, the cheapest first; ``radii`` (3,) as of a place."""
    left, kept = np.argsort(costs, kind="stable"), []
    while left.size:
        off = se2.between(poses[left[0]], poses[left])
        near = (np.hypot(off[:, 0], off[:, 1]) < radii[0]) & (np.abs(off[:, 2]) < radii[2])
        near[0] = True
        kept.append(left[0])
        left = left[~near]
    return np.array(kept, np.int64)


def _inside(covariances: FloatArray, radii: FloatArray) -> FloatArray:
    """Logarithm (M,) of the share of each mode that is at its place: along a corridor it is longer than that."""
    scaled = np.linalg.eigvalsh(covariances / np.outer(radii, radii))
    wide = math.sqrt(2.0 * math.pi) * np.sqrt(np.maximum(scaled, 1e-12))
    return np.asarray(-np.log(np.maximum(wide, 1.0)).sum(axis=1))
