"""Finding a robot that may be anywhere: readings and settings put together into a search, also for the filter."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.filter import particles, temperature
from mclcli.filter.recovery import Proposed
from mclcli.filter.start import Patience, Placed
from mclcli.geometry import se2, se3
from mclcli.records import LandmarkSightings, LaserScan
from mclcli.search import lattice, locating, scene, window
from mclcli.search.scene import Scene, Sight, Stretch, View
from mclcli.sensors import beams, bearing
from mclcli.sensors.beam import BeamModel
from mclcli.sensors.beam_forms import BeamParameters
from mclcli.sensors.bearing import BearingModel
from mclcli.smooth.odometry import Jumps, Odometry
from mclcli.world.raycast import make_caster

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from mclcli.arrays import FloatArray, IntArray
    from mclcli.filter.recovery import Situation
    from mclcli.filter.start import Opening
    from mclcli.search.locating import Location
    from mclcli.sensors import Temperature
    from mclcli.sensors.beams import Beams, BeamSelection
    from mclcli.sensors.likelihood_field import LikelihoodField
    from mclcli.sensors.observation import Observation
    from mclcli.settings.profiles import Settings
    from mclcli.world.distance_field import DistanceField
    from mclcli.world.landmarks import Landmarks
    from mclcli.world.occupancy import OccupancyGrid
    from mclcli.world.pyramid import Pyramid

    MakePyramid = Callable[[DistanceField], Pyramid]

_STRETCH = 4  # scans whose odometry is as good as rigid
_BEAMS_OF_A_SIGHT = 60
_JUMPS = Jumps(0.05, 5.0)
_WHITE = 0.04  # nats²
_MODES = 16  # places that particles are shared among
_SURE = 0.9  # share of the best place from which on a start needs to see no more; hardly any is above 0.93
_LOOKS = np.array([0.5, 1.0, 2.0, 4.0, 8.0])  # m on the way at which a start in doubt looks again; then it begins
_LEAST_SPREAD = np.square([0.05, 0.05, math.radians(1.0)])  # particles closer together would be one


@final
@dataclass(frozen=True, slots=True)
class Limits:
    """Where to search: a box x0, y0, x1, y1 [m], a disc x, y, r [m], and a yaw [rad] with how far from it; in map."""

    region: tuple[float, float, float, float] | None = None
    disc: tuple[float, float, float] | None = None
    about: tuple[float, float] = (0.0, math.pi)


@final
@dataclass(frozen=True, slots=True, eq=False)
class GlobalSearch:
    """A map made ready and how readings are used; ``alpha`` is a temperature, or ``auto``."""

    scene: Scene
    settings: Settings
    landmarks: Landmarks | None = None
    alpha: Temperature = temperature.AUTO

    def find(self, observations: Sequence[Observation], k: int) -> Location | None:
        """The k most probable places of the base at the last observation; None if it can be nowhere, or saw nothing."""
        view = self.view(observations)
        if view is None or not (_sees(view.beams) or any(b.angles.size for b in view.bearings)):
            return None  # every place would be as good, and all of them be looked at
        return locating.locate(self.scene, view, self.settings.search, k, self._temper)

    def view(self, observations: Sequence[Observation]) -> View | None:
        """What was seen, from the base at the last observation; None without a laser scan."""
        now = observations[-1].odom_from_base
        scans = self._chosen([o for o in observations if isinstance(o.reading, LaserScan)])
        if not scans:
            return None
        poses = np.array([scan.odom_from_base for scan in scans])
        joined = self._selection(len(scans))
        return View(
            _joined(scans, now, joined),
            tuple(self._sight(scan, len(scans)) for scan in scans),
            self._between(poses),
            window.ways(poses),
            tuple(
                Stretch(part[-1], _joined([scans[i] for i in part], poses[part[-1]], self._selection(len(part))))
                for part in window.stretches(len(scans), _STRETCH)
            ),
            tuple(self._bearings(o, now) for o in observations if isinstance(o.reading, LandmarkSightings)),
            BearingModel(self.settings.bearing),
        )

    def _sight(self, scan: Observation, scans: int) -> Sight:
        """One scan alone."""
        assert isinstance(scan.reading, LaserScan)  # noqa: S101 - see view()
        selection = self._selection(1)
        if scans > 1:
            selection = dataclasses.replace(selection, max_beams=min(selection.max_beams, _BEAMS_OF_A_SIGHT))
        rays = dataclasses.replace(selection, max_range="no_return", beam_origin="sensor")
        chosen = (beams.select(scan.reading, scan.base_from_sensor, how) for how in (selection, rays))
        return Sight(*chosen)

    def _between(self, poses: FloatArray) -> Odometry | None:
        """Odometry between places (n, 3) by itself."""
        if len(poses) == 1:
            return None
        steps = se2.between(poses[:-1], poses[1:])
        return Odometry(steps, window.noise(steps), _JUMPS)

    def first_of(self, observations: Sequence[Observation]) -> FloatArray:
        """Where odometry was (3,) at the first scan of the window that is looked at."""
        return self._chosen([o for o in observations if isinstance(o.reading, LaserScan)])[0].odom_from_base

    def _selection(self, scans: int) -> BeamSelection:
        """Beams of each of so many scans; what saw nothing is left out, whatever the lidar's own model makes of it."""
        p, chosen = self.settings.search, self.settings.beams
        each = p.locate_beams if scans == 1 else min(p.locate_beams, max(2, p.window_beams // scans))
        max_range = "skip" if chosen.max_range == "as_read" else chosen.max_range
        # Beams shorter than a cell end where the robot is, wherever that is: of zeros, every place would be as good.
        shortest = max(chosen.laser_min_range, self.scene.model.field.resolution)
        return dataclasses.replace(chosen, max_beams=each, max_range=max_range, laser_min_range=shortest)

    def _chosen(self, scans: list[Observation]) -> list[Observation]:
        """Scans of every lidar, spread along the way, in order of time."""
        topics = list(dict.fromkeys(o.topic for o in scans))
        chosen: list[Observation] = []
        for topic in topics:
            own = [o for o in scans if o.topic == topic]
            odometry = np.array([o.odom_from_base for o in own])
            chosen += [
                own[i] for i in window.spread(odometry, max(1, self.settings.search.window_scans // len(topics)))
            ]
        return sorted(chosen, key=lambda o: o.reading.stamp_ns)

    def _bearings(self, observation: Observation, now: FloatArray) -> bearing.Bearings:
        assert self.landmarks is not None  # noqa: S101 - without landmarks no camera takes part
        assert isinstance(observation.reading, LandmarkSightings)  # noqa: S101 - see view()
        then = se2.between(now, observation.odom_from_base)
        return bearing.observe(
            observation.reading, se3.from_planar(then) @ observation.base_from_sensor, self.landmarks
        )

    def _temper(self, each: FloatArray) -> float:
        """α for beams with these log p (B,): from their correlation, or as it was given.

        Where all beams fit, what is left of log p is rounding, whose correlation means nothing: white noise is added.
        """
        if self.alpha != temperature.AUTO:
            return float(self.alpha)
        found = temperature.correlate(each)
        white = np.zeros_like(found.covariances)
        white[0] = _WHITE
        return dataclasses.replace(found, covariances=found.covariances + white).alpha


def _sees(beams: Beams) -> bool:
    """Whether any beam has a return."""
    return bool((beams.ranges < beams.r_max).any())


def _joined(scans: Sequence[Observation], now: FloatArray, selection: BeamSelection) -> Beams:
    """Beams of scans as of one, seen from where the base is now."""
    parts = []
    for scan in scans:
        assert isinstance(scan.reading, LaserScan)  # noqa: S101 - see GlobalSearch.view
        chosen = beams.select(scan.reading, scan.base_from_sensor, selection)
        parts.append((chosen, se2.between(now, scan.odom_from_base)))
    return window.join(parts)


def make_global_search(
    grid: OccupancyGrid,
    model: LikelihoodField,
    settings: Settings,
    make_pyramid: MakePyramid,
    *,
    limits: Limits | None = None,
    landmarks: Landmarks | None = None,
    alpha: Temperature = temperature.AUTO,
) -> GlobalSearch:
    """Make a map ready for searches: ``model`` is its likelihood field."""
    limits = limits or Limits()
    model = scene.for_search(model)
    asked: BeamParameters = settings.lidars["beam"]
    rays = BeamModel(make_caster(grid, ray_unknown=asked.ray_unknown), _censored(settings))
    allowed = scene.allowed_cells(grid, settings.search.base_cells, limits.region, limits.disc)
    ready = Scene(
        model,
        make_pyramid(model.field),
        rays,
        lattice.count_places(allowed),
        scene.count_known(grid, model),
        limits.about,
    )
    return GlobalSearch(ready, settings, landmarks, alpha)


def _censored(settings: Settings) -> BeamParameters:
    """The beam model that looks at the foremost places: the one asked for if it is a density, else the default."""
    asked: BeamParameters = settings.lidars["beam"]
    if settings.model == "beam" and asked.beam_form == "textbook":
        return dataclasses.replace(asked, no_return="censored")
    return BeamParameters(no_return="censored")


@final
@dataclass(frozen=True, slots=True, eq=False)
class FoundOnMap:
    """Start where the first readings are found on the map; while they leave doubt, it looks again further on the way.

    Each place gets particles by its share; what is left to chance is spread over the map.
    """

    search: GlobalSearch
    grid: OccupancyGrid

    def place(self, opening: Opening, n: int, rng: np.random.Generator) -> Placed | Patience:
        """Particles at ``opening.stamp_ns``, and how probable each place is."""
        odometry = np.array([o.odom_from_base for o in opening.observations])
        way = np.append(0.0, np.cumsum(window.ways(odometry)))
        last = opening.complete or way[-1] >= _LOOKS[-1]
        if not last and len(way) > 1 and not ((way[-2] < _LOOKS) & (way[-1] >= _LOOKS)).any():
            return Patience.HOLD  # it has seen little that is new
        location = self.search.find(opening.observations, _MODES)
        if not last and (location is None or location.modes[0].share < _SURE):
            return Patience.HOLD
        if location is None:
            poses, modes = particles.uniform(self.grid, n, rng), np.zeros(n, np.int64)
            return Placed(poses, modes, np.empty((0, 3)), np.empty(0), 0.0)
        then = se2.between(self.search.first_of(opening.observations), odometry[0])
        places = [Around(mode.began, mode.spread, mode.share) for mode in location.modes]
        poses, modes = _drawn(places, self.grid, n, rng, then)
        at = se2.compose(np.array([place.pose for place in places]), then)
        return Placed(poses, modes, at, np.array([place.share for place in places]), location.elsewhere)


@final
@dataclass(frozen=True, slots=True, eq=False)
class FoundAgain:
    """Proposal for a lost robot: where the readings of the update are found on the map."""

    search: GlobalSearch
    grid: OccupancyGrid

    def __call__(self, situation: Situation, n: int, rng: np.random.Generator) -> Proposed:
        """Poses (n, 3) at the update's stamp."""
        location = self.search.find(situation.observations, _MODES) if situation.observations else None
        places = [Around(mode.pose, mode.covariance, mode.share) for mode in location.modes] if location else []
        poses, modes = _drawn(places, self.grid, n, rng, np.zeros(3))
        return Proposed(poses, np.array([*(place.share for place in places), 0.0])[modes])


@final
@dataclass(frozen=True, slots=True, eq=False)
class Around:
    """A place to draw particles at: a pose (3,) with covariance (3, 3), and the probability of being there."""

    pose: FloatArray
    covariance: FloatArray
    share: float


def _drawn(
    places: Sequence[Around], grid: OccupancyGrid, n: int, rng: np.random.Generator, then: FloatArray
) -> tuple[FloatArray, IntArray]:
    """Poses (n, 3): by their shares around the places, each moved by ``then`` (3,), the others anywhere on the map.

    And which place each is at (n,), for the others the number of places.
    """
    shares = np.array([place.share for place in places])
    placed = min(n, round(n * float(shares.sum())))
    if not placed:
        return particles.uniform(grid, n, rng), np.full(n, len(places), np.int64)
    edges = np.round(placed * np.cumsum(shares) / shares.sum()).astype(int)
    counts = np.diff(edges, prepend=0)
    parts = [
        particles.gaussian(place.pose, place.covariance + np.diag(_LEAST_SPREAD), count, rng)
        for place, count in zip(places, counts.tolist(), strict=True)
    ]
    around = se2.compose(np.concatenate(parts), then)
    modes = np.repeat(np.arange(len(shares) + 1), [*counts.tolist(), n - placed])
    return np.concatenate([around, particles.uniform(grid, n - placed, rng)]), modes
