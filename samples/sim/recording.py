"""One run of one robot through one building, and everything that was measured on the way."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.geometry import se2
from samples.sim.planning import plan, terrain
from samples.sim.robot import Drive, OdometryNoise, Trajectory, odometry, travel
from samples.sim.sensors import Camera, Lidar, People, Sighting, scans, sightings
from samples.sim.streams import Purpose, stream

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mclcli.arrays import FloatArray, IntArray
    from samples.sim.building import Building

START_NS = 1_715_697_000_000_000_000  # 2024-05-14T14:30:00Z: any fixed time, so that the bytes stay the same


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Scenario:
    """What is simulated.

    ``mapped`` is the building as the map shows it, ``today`` as it is (the same, where None). ``tours`` are names of
    places, one tour after each kidnapping; ``walks`` pairs of places that a person each walks between. Equal ``seed``
    means equal noise. ``chain`` names the frames from the odometry's child to the frame the sensors are mounted on.
    """

    name: str
    mapped: Building
    tours: tuple[tuple[str, ...], ...]
    lidar: Lidar
    camera: Camera | None = None
    today: Building | None = None
    drive: Drive = field(default_factory=Drive)
    noise: OdometryNoise = field(default_factory=OdometryNoise)
    walks: tuple[tuple[str, str], ...] = ()
    seed: int = 0
    chain: tuple[str, ...] = ("base_link",)


@final
@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Recording:
    """Everything measured in a run; stamps count from its start.

    ``truth`` is in map at the odometry's stamps; ``twists`` (T, 3) [m/s, rad/s] belong to ``odom``; ``ranges`` (S, B)
    float32 [m] to ``scan_stamps_ns`` (S,). ``initial`` (3,) is where an operator said the robot was at the start.
    """

    scenario: Scenario
    truth: Trajectory
    odom: Trajectory
    twists: FloatArray
    scan_stamps_ns: IntArray
    ranges: NDArray[np.float32]
    sightings: tuple[Sighting, ...]
    initial: FloatArray


def simulate(scenario: Scenario) -> Recording:
    """Run a scenario.

    Raises
    ------
    KeyError
        If a place does not exist.
    ValueError
        If no way leads to a place.

    """
    today = scenario.today or scenario.mapped
    truth = travel(today, terrain(today), scenario.tours, scenario.drive)
    odom, twists = odometry(truth, scenario.noise, scenario.seed)
    people = _people(scenario, today)
    stamps, ranges = scans(scenario.lidar, today, people, truth, scenario.seed)
    seen = sightings(scenario.camera, today, truth, scenario.seed) if scenario.camera else []
    in_map = Trajectory(odom.stamps_ns, today.to_map(truth.at(odom.stamps_ns)))
    return Recording(
        scenario=scenario,
        truth=in_map,
        odom=odom,
        twists=twists,
        scan_stamps_ns=stamps,
        ranges=ranges,
        sightings=tuple(seen),
        initial=_stated(in_map.poses[0], scenario.seed),
    )


def drift(recording: Recording) -> FloatArray:
    """Error (T,) [m] of odometry alone, laid on the true pose at the start."""
    start = recording.truth.poses[0]
    guess = se2.compose(start, recording.odom.poses)
    return np.asarray(np.hypot(*(guess - recording.truth.poses)[:, :2].T), dtype=np.float64)


def _people(scenario: Scenario, today: Building) -> People:
    ground = terrain(today)
    routes = tuple(plan(ground, today.places[a], today.places[b]) for a, b in scenario.walks)
    phases = stream(scenario.seed, Purpose.PEOPLE).uniform(0.0, 40.0, len(routes))
    return People(routes, tuple(float(phase) for phase in phases))


def _stated(truth: FloatArray, seed: int) -> FloatArray:
    """Pose as an operator clicks it: some 15 cm and 4° off."""
    error = stream(seed, Purpose.OPERATOR).normal(0.0, [0.15, 0.15, 0.07])
    return se2.compose(truth, error)
