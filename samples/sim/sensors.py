"""What the robot sees: a lidar with people in its way, and a camera that knows landmarks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.geometry import se2
from samples.sim.raycast import cast, cast_circles
from samples.sim.streams import Purpose, stream

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mclcli.arrays import BoolArray, FloatArray, IntArray
    from samples.sim.building import Building
    from samples.sim.robot import Trajectory

PERSON_RADIUS = 0.2
_STEP_ASIDE = 0.75  # m: nobody comes nearer to the robot's middle


@final
@dataclass(frozen=True, slots=True)
class Mount:
    """Where a sensor sits on the base: x, y, z [m], yaw [rad]; ``upside_down`` is a roll of π before the yaw."""

    x: float
    y: float
    z: float
    yaw: float = 0.0
    upside_down: bool = False


@final
@dataclass(frozen=True, slots=True)
class Lidar:
    """A planar lidar.

    ``beams`` readings from ``angle_min`` in steps of ``angle_increment`` [rad], ``rate`` sweeps a second, each lasting
    ``sweep`` [s] (0: all beams at once). Readings have noise ``sigma`` [m]; a share ``dropout`` is lost (+inf), a
    share ``short`` ends before its target (dust, sunlight). They come in steps of 2⁻¹⁰ m, as from a digital device.
    """

    mount: Mount
    beams: int = 360
    angle_min: float = -np.pi
    angle_increment: float = 2 * np.pi / 360
    range_min: float = 0.1
    range_max: float = 12.0
    rate: float = 8.0
    sweep: float = 0.0
    sigma: float = 0.015
    dropout: float = 0.02
    short: float = 0.01

    @property
    def angles(self) -> FloatArray:
        """Beam angles (B,) [rad] in the sensor's frame, from the float32 fields that a LaserScan has."""
        start, step = (float(np.float32(v)) for v in (self.angle_min, self.angle_increment))
        return start + step * np.arange(self.beams, dtype=np.float64)


@final
@dataclass(frozen=True, slots=True)
class Camera:
    """A level camera that recognises landmarks.

    It sees ``fov`` [rad] wide and ``reach`` [m] far, ``rate`` images a second, bearings with noise ``sigma`` [rad]. A
    share ``missed`` of what is in view goes unseen, a share ``wrong`` gets another landmark's id, a share ``unknown``
    an id that no map has.
    """

    mount: Mount
    fov: float = 1.5
    reach: float = 7.0
    rate: float = 4.0
    sigma: float = 0.02
    missed: float = 0.1
    wrong: float = 0.04
    unknown: float = 0.02


@final
@dataclass(frozen=True, slots=True, eq=False)
class Sighting:
    """One image: ``ids`` (M,) and ``bearings`` (M,) float64 [rad] in the camera's frame."""

    stamp_ns: int
    ids: tuple[str, ...]
    bearings: FloatArray


@final
@dataclass(frozen=True, slots=True, eq=False)
class People:
    """Walkers to and fro on ``routes`` (each (K, 2) [m]) at ``speed`` [m/s], starting ``phases`` [m] along them."""

    routes: tuple[FloatArray, ...] = ()
    phases: tuple[float, ...] = ()
    speed: float = 1.1

    def positions(self, stamps_ns: IntArray, robot: FloatArray) -> FloatArray:
        """Positions (T, P, 2) [m]; whoever meets the robot at ``robot`` (T, 3) keeps clear of it."""
        if not self.routes:
            return np.empty((len(stamps_ns), 0, 2))
        walked = self.speed / 1e9 * stamps_ns.astype(np.float64)
        there = np.stack([_along(r, walked + p) for r, p in zip(self.routes, self.phases, strict=True)], axis=1)
        offset = there - robot[:, np.newaxis, :2]
        distance = np.maximum(np.hypot(offset[..., 0], offset[..., 1]), 1e-6)[..., np.newaxis]
        return robot[:, np.newaxis, :2] + offset * np.maximum(1.0, _STEP_ASIDE / distance)


def scans(
    lidar: Lidar, building: Building, people: People, truth: Trajectory, seed: int
) -> tuple[IntArray, NDArray[np.float32]]:
    """Stamps (S,) of the first beams and ranges (S, B) float32 [m] of every whole sweep within the truth."""
    stamps = _ticks(truth, lidar.rate, lidar.sweep)
    beam_ns = np.int64(round(lidar.sweep * 1e9 / lidar.beams)) * np.arange(lidar.beams)
    base = truth.at(stamps[:, np.newaxis] + beam_ns)
    mount = lidar.mount
    sensor = se2.compose(base, [mount.x, mount.y, mount.yaw]).reshape(-1, 3)
    angles = sensor[:, 2] + np.tile(-lidar.angles if mount.upside_down else lidar.angles, len(stamps))
    exact = cast(building.occupied, building.resolution, sensor[:, :2], angles, 1.1 * lidar.range_max)
    walkers = np.repeat(people.positions(stamps, base[:, 0]), lidar.beams, axis=0)
    exact = np.minimum(exact, cast_circles(sensor[:, :2], angles, walkers, PERSON_RADIUS))
    return stamps, _measured(lidar, exact.reshape(len(stamps), lidar.beams), seed)


def sightings(camera: Camera, building: Building, truth: Trajectory, seed: int) -> list[Sighting]:
    """Every image within the truth, also those that show nothing."""
    rng = stream(seed, Purpose.CAMERA)
    stamps = _ticks(truth, camera.rate, 0.0)
    mount, marks = camera.mount, building.landmarks
    poses = se2.compose(truth.at(stamps), [mount.x, mount.y, mount.yaw])
    offset = marks.positions[np.newaxis, :, :2] - poses[:, np.newaxis, :2]
    distance = np.hypot(offset[..., 0], offset[..., 1])
    direction = np.arctan2(offset[..., 1], offset[..., 0])
    bearings = se2.wrap(direction - poses[:, 2:])
    seen = (np.abs(bearings) < camera.fov / 2) & (distance < camera.reach)
    image, mark = np.nonzero(seen)
    wall = cast(building.occupied, building.resolution, poses[image, :2], direction[seen], distance[seen])
    seen[image, mark] = np.isinf(wall)
    return [
        _recognised(rng, camera, marks.ids, int(t), row, b) for t, row, b in zip(stamps, seen, bearings, strict=True)
    ]


def _ticks(truth: Trajectory, rate: float, sweep: float) -> IntArray:
    last = int(truth.stamps_ns[-1]) - round(sweep * 1e9)
    period = round(1e9 / rate)
    return np.arange(period // 2, last, period, dtype=np.int64)


def _along(route: FloatArray, walked: FloatArray) -> FloatArray:
    """Points (T, 2) after ``walked`` metres to and fro on a polyline."""
    legs = np.hypot(*np.diff(route, axis=0).T)
    marks = np.concatenate([[0.0], np.cumsum(legs)])
    folded = marks[-1] - np.abs(walked % (2 * marks[-1]) - marks[-1])
    return np.stack([np.interp(folded, marks, route[:, k]) for k in (0, 1)], axis=-1)


def _measured(lidar: Lidar, exact: FloatArray, seed: int) -> NDArray[np.float32]:
    """Exact ranges (S, B) as the device reports them."""
    rng = stream(seed, Purpose.LIDAR)
    noise, lot, cut = rng.standard_normal(exact.shape), rng.random(exact.shape), rng.random(exact.shape)
    shortened = lidar.range_min + cut * (np.minimum(exact, lidar.range_max) - lidar.range_min)
    ranges = np.where(lot < lidar.short, shortened, exact + lidar.sigma * noise)
    steps = np.round(ranges * 1024.0) / 1024.0
    lost = (lot > 1.0 - lidar.dropout) | ~(steps > lidar.range_min) | ~(steps < lidar.range_max)
    return np.where(lost, np.inf, steps).astype(np.float32)


def _recognised(
    rng: np.random.Generator,
    camera: Camera,
    ids: tuple[str, ...],
    stamp_ns: int,
    seen: BoolArray,
    bearings: FloatArray,
) -> Sighting:
    """One image of the landmarks ``seen`` (L,) at ``bearings`` (L,)."""
    kept = [int(k) for k in np.flatnonzero(seen) if rng.random() >= camera.missed]
    names = [_label(rng, camera, ids, k) for k in kept]
    noisy = se2.wrap(bearings[kept] + camera.sigma * rng.standard_normal(len(kept)))
    return Sighting(stamp_ns, tuple(names), noisy)


def _label(rng: np.random.Generator, camera: Camera, ids: tuple[str, ...], mark: int) -> str:
    lot = float(rng.random())
    if lot < camera.unknown:
        return f"x{int(rng.integers(100))}"
    if lot < camera.unknown + camera.wrong:
        return ids[(mark + int(rng.integers(1, len(ids)))) % len(ids)]
    return ids[mark]
