"""Putting a log, a map and settings together, and the errors where they do not fit."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from mclcli.errors import InputError, MclError, UsageError
from mclcli.filter.start import Anywhere, AroundPose
from mclcli.io.recording.roles import RequestedRoles, assign
from mclcli.motion.differential import DifferentialMotion
from mclcli.native.backend import COMPILED, NUMPY, Backend
from mclcli.records import LaserScan
from mclcli.replay import setup as replay_setup
from mclcli.replay.setup import describe_extent, prepare
from mclcli.sensors.instruments import Camera, Lidar
from mclcli.sensors.likelihood_field import LikelihoodField
from mclcli.settings import profiles
from mclcli.world.distance_field import DistanceField, compute
from mclcli.world.landmarks import Landmarks
from tests.io.surveys import LASER, MARKERS, ODOM, log_of
from tests.support import each_backend, transform
from tests.worlds import drawn

if TYPE_CHECKING:
    from mclcli.io.recording.survey import LogSurvey
    from mclcli.replay.loop import Setup
    from mclcli.world import FieldMethod
    from mclcli.world.occupancy import OccupancyGrid

GRID = drawn("#...\n....", 0.5, (-1.0, -2.0, 0.0))
POSTS = Landmarks(("1",), np.zeros((1, 3)))
TOPICS = (("/scan", LASER), ("/odom", ODOM), ("/aruco", MARKERS))
ODOM_FRAME, BASE = "odom", "base_footprint"


def log(*topics: tuple[str, str], mounted: bool = True) -> LogSurvey:
    found = log_of(*topics)
    for frame in ("laser", "camera") if mounted else ():
        found.of_transforms("/tf").add("/tf", [transform(0, BASE, frame, np.eye(4), static=True)])
    return found


def prepared(survey: LogSurvey, **changes: Any) -> Setup:
    return prepare(survey, assign(survey), **changes)


def test_everything_that_fits_takes_part() -> None:
    setup = prepared(log(*TOPICS), grid=GRID, landmarks=POSTS, seed=7)
    assert list(setup.instruments) == ["/scan", "/aruco"]
    assert [instrument.name for instrument in setup.instruments.values()] == ["lidar", "vision"]
    assert isinstance(setup.instruments["/scan"], Lidar)
    assert isinstance(setup.instruments["/aruco"], Camera)
    assert (setup.odometry, setup.odom_frame, setup.base_frame) == ("/odom", ODOM_FRAME, BASE)
    assert setup.localizer.seed == 7
    assert isinstance(setup.start, Anywhere)


def test_several_lidars_are_numbered_and_share_one_field() -> None:
    found = log(("/back", LASER), ("/front", LASER), ("/odom", ODOM))
    made: list[tuple[OccupancyGrid, FieldMethod, float]] = []

    def making(grid: OccupancyGrid, method: FieldMethod, max_dist: float, **how: Any) -> DistanceField:
        made.append((grid, method, max_dist))
        assert how == {"boundary_only": False, "mark_unknown": False}
        return compute(grid, method, max_dist, **how)

    roles = assign(found, RequestedRoles(scan=("/front", "/back")))
    settings = profiles.build({"field_method": "brushfire", "laser_likelihood_max_dist": 1.25})
    setup = prepare(found, roles, grid=GRID, settings=settings, make_field=making)
    assert [(topic, lidar.name) for topic, lidar in setup.instruments.items()] == [
        ("/front", "lidar_1"),
        ("/back", "lidar_2"),
    ]
    assert made == [(GRID, "brushfire", 1.25)]


def test_settings_and_temperature_reach_the_parts() -> None:
    settings = profiles.build({"max_beams": 12, "particles": 34, "alpha1": 0.5, "sigma_hit": 0.7})
    setup = prepared(
        log(*TOPICS), grid=GRID, landmarks=POSTS, settings=settings, temperature={"lidar": 0.125, "": "ess"}
    )
    lidar = setup.instruments["/scan"]
    assert isinstance(lidar, Lidar)
    assert lidar.selection.max_beams == 12
    assert isinstance(lidar.model, LikelihoodField)
    assert lidar.model.parameters.sigma_hit == 0.7
    assert setup.localizer.size.max_particles == 34
    assert [instrument.alpha for instrument in setup.instruments.values()] == [0.125, "ess"]


@pytest.mark.parametrize(("particles", "expected"), [(34, NUMPY), (100_000_000, COMPILED)])
def test_the_size_of_the_job_chooses_one_backend_for_all_parts(particles: int, expected: Backend) -> None:
    settings = profiles.build({"max_beams": 12, "particles": particles})
    setup = prepared(log(*TOPICS), grid=GRID, landmarks=POSTS, settings=settings)
    assert backends_of(setup) == {expected}


def test_the_job_is_as_large_as_what_is_scored() -> None:
    settings, start = profiles.build({"max_beams": 12, "particles": 34}), AroundPose(np.zeros(3), np.eye(3))
    sizes: list[float] = []

    def noted(steps: float, rounds: float) -> Backend:
        assert steps == 34 * rounds
        sizes.append(steps)
        return NUMPY

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(replay_setup, "choose", noted)
        prepared(log(*TOPICS), grid=GRID, landmarks=POSTS, settings=settings)
        prepared(log(*TOPICS), landmarks=POSTS, settings=settings, start=start)
    both, blind = sizes
    assert 0 < blind < both


def test_a_model_without_loops_in_numpy_brings_compiled_code_for_all_parts() -> None:
    setup = prepared(log(*TOPICS), grid=GRID, landmarks=POSTS, settings=profiles.build({}, model="beam"))
    assert backends_of(setup, lidar=False) == {COMPILED}


@each_backend
def test_a_backend_that_is_given_is_taken(backend: Backend) -> None:
    setup = prepared(log(*TOPICS), grid=GRID, landmarks=POSTS, backend=backend)
    assert backends_of(setup) == {backend}


def backends_of(setup: Setup, *, lidar: bool = True) -> set[Backend]:
    """Those of all parts that have one."""
    scan, camera = (setup.instruments[topic] for topic in ("/scan", "/aruco"))
    assert isinstance(scan, Lidar)
    assert isinstance(camera, Camera)
    assert isinstance(setup.localizer.motion, DifferentialMotion)
    found = {camera.model.backend, setup.localizer.backend, setup.localizer.motion.backend}
    if lidar:
        assert isinstance(scan.model, LikelihoodField)
        found.add(scan.model.backend)
    return found


def test_moving_transforms_are_read_only_where_they_are_needed() -> None:
    tf = ("/tf", "tf2_msgs/msg/TFMessage")
    assert prepared(log(*TOPICS, tf), grid=GRID).topics == {"/scan", "/odom"}
    swinging = log(*TOPICS, tf, mounted=False)
    for stamp in (0, 1):
        matrix = np.eye(4)
        matrix[0, 3] = stamp
        swinging.of_transforms("/tf").add("/tf", [transform(stamp, BASE, "laser", matrix)])
    assert prepared(swinging, grid=GRID).topics == {"/scan", "/odom", "/tf"}


@pytest.mark.parametrize(
    ("topics", "changes", "kind", "said"),
    [
        ((("/scan", LASER),), {"grid": GRID}, InputError, "no odometry"),
        ((("/scan", LASER), ("/odom", ODOM)), {}, InputError, "--map"),
        ((("/aruco", MARKERS), ("/odom", ODOM)), {"grid": GRID}, InputError, "--landmarks"),
        ((("/odom", ODOM),), {"grid": GRID}, InputError, "no laser scan"),
        ((("/aruco", MARKERS), ("/odom", ODOM)), {"landmarks": POSTS}, UsageError, "--init"),
        (TOPICS, {"grid": drawn("...\n.?.")}, InputError, "no cell is occupied"),
        (TOPICS, {"grid": GRID, "start": AroundPose(np.array([9.0, 0, 0]), np.eye(3))}, UsageError, "off the map"),
    ],
)
def test_what_is_missing_is_an_error_in_one_line(
    topics: tuple[tuple[str, str], ...], changes: dict[str, Any], kind: type[MclError], said: str
) -> None:
    with pytest.raises(kind) as caught:
        prepared(log(*topics), **changes)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_sensor_that_nothing_mounts_is_named_with_the_known_frames() -> None:
    found = log(*TOPICS, mounted=False)
    found.of_transforms("/tf").add("/tf", [transform(0, BASE, "roof", np.eye(4), static=True)])
    with pytest.raises(InputError, match=rf"from '{BASE}' to 'laser'; .*roof.*--mount laser="):
        prepared(found, grid=GRID)


@pytest.mark.parametrize("frame", ["laser", ""])
def test_a_stated_mount_is_enough(frame: str) -> None:
    setup = prepared(log(*TOPICS, mounted=False), grid=GRID, mounts={frame: np.eye(4)})
    assert list(setup.mounts) == [frame]
    assert isinstance(log(*TOPICS).topics["/scan"].sample, LaserScan)


def test_the_extent_of_a_turned_map() -> None:
    turned = drawn("....\n....", 0.5, (0.0, 0.0, math.pi / 2))
    assert describe_extent(GRID) == "the map spans x -1 to 1 m, y -2 to -1 m"
    assert "x -1 to" in describe_extent(turned)
    assert "y 0 to 2 m" in describe_extent(turned)
