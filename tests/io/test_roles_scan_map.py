"""Which lidar and which grid are used where a log has several."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from mclcli.io.recording import map_topics
from mclcli.io.recording.roles import RequestedRoles, assign
from mclcli.world.occupancy import OCCUPIED, UNKNOWN, OccupancyGrid
from tests.io import drives
from tests.io.drives import GRID, SCAN, TF, Drive, at, every, surveyed

if TYPE_CHECKING:
    from typing import Any

    from tests.cli.support import Message
    from tests.io.drives import Pose


def lidar(topic: str, frame: str, mount: Pose, **form: Any) -> list[Message]:
    """Another lidar, and where it sits."""
    scans = every(0.2, 10.0, lambda t: at(t, topic, SCAN, drives.scan(t, mount, frame, **form)))
    return [at(0.0, "/tf_static", TF, drives.transform(0.0, "base_link", frame, mount)), *scans]


def renamed(messages: list[Message], old: str, new: str) -> list[Message]:
    return [replace(message, topic=new) if message.topic == old else message for message in messages]


@pytest.mark.parametrize(
    ("front", "other"),
    [
        ("/front_scan", lidar("/rear_scan", "rear", (-0.2, 0.0, 3.14))),
        ("/front_lidar/scan", lidar("/cam/scan", "cam", (0.1, 0.0, 0.0), half=0.5, range_max=3.0)),
        ("/front_laser/data", lidar("/scan", "rear", (-0.2, 0.0, 3.14))),
    ],
)
def test_the_lidar_that_sees_most_ahead_is_used(front: str, other: list[Message]) -> None:
    survey = surveyed(renamed(Drive().messages(), "/scan", front), other)
    roles = assign(survey)
    assert roles.scan == (front,)
    assert "sees most ahead" in roles.reasons["scan"]
    assert other[-1].topic in roles.reasons["scan"]
    assert assign(survey, RequestedRoles(scan=("all",))).scan == (front, other[-1].topic)


def test_a_lidar_that_nothing_mounts_goes_last() -> None:
    wide = every(0.2, 10.0, lambda t: at(t, "/scan", SCAN, drives.scan(t, (0.0, 0.0, 0.0), "loose", half=3.1)))
    roles = assign(surveyed(renamed(Drive().messages(), "/scan", "/front"), wide))
    assert roles.scan == ("/front",)
    assert "whose place on the base is known" in roles.reasons["scan"]


@pytest.mark.parametrize(
    ("other", "frame"),
    [
        ("/local_costmap/costmap", "odom"),
        ("/costmap", "odom"),
        ("/a_costmap", "map"),
        ("/keepout_filter_mask", "map"),
        ("/elevation/grid", "map"),
        ("/a", "base_link"),
        ("/a_map", "odom"),
    ],
)
def test_the_map_is_no_costmap_and_no_mask(other: str, frame: str) -> None:
    grids = [at(0.0, other, GRID, drives.grid(frame, 20)), at(0.1, "/map", GRID, drives.grid())]
    roles = assign(surveyed(Drive().messages(), grids))
    assert roles.map == "/map"
    assert other in roles.reasons["map"]
    alone = assign(surveyed(Drive().messages(), grids[:1]))
    assert alone.map == ""


def test_each_robot_has_the_map_of_its_namespace() -> None:
    grids = [at(0.0, f"/robot{n}/map", GRID, drives.grid()) for n in (1, 2)]
    survey = surveyed(Drive("/robot1").messages(), Drive("/robot2", lead=3.0).messages(), grids)
    assert assign(survey, RequestedRoles(robot="robot2")).map == "/robot2/map"


def part(columns: int) -> OccupancyGrid:
    whole = drives.room()
    return OccupancyGrid(whole.cells[:, :columns], whole.resolution, whole.origin)


def test_of_a_map_that_grows_the_last_message_counts() -> None:
    warnings: list[str] = []
    grids = [part(40), part(90), drives.room()]
    assert map_topics.pick("/map", grids, "auto", warnings.append) is grids[-1]
    assert map_topics.pick("/map", grids, "first", warnings.append) is grids[0]
    assert warnings == []


def test_of_maps_that_do_not_go_on_from_each_other_the_first_counts_with_a_warning() -> None:
    warnings: list[str] = []
    cells = np.zeros_like(drives.room().cells)
    cells[40, :] = OCCUPIED
    others = [
        OccupancyGrid(cells, 0.05, np.zeros(3)),
        OccupancyGrid(drives.room().cells, 0.1, np.zeros(3)),
        OccupancyGrid(drives.room().cells, 0.05, np.array([30.0, 0.0, 0.0])),
        part(40),
    ]
    for other in others:
        assert (
            map_topics.pick("/map", [drives.room(), other], "auto", warnings.append).digest() == drives.room().digest()
        )
        assert map_topics.pick("/map", [drives.room(), other], "last", warnings.append) is other
    assert len(warnings) == len(others)
    assert "map_update=last" in warnings[0]


def test_a_map_that_was_empty_at_first_has_grown() -> None:
    blank = OccupancyGrid(np.full((3, 3), UNKNOWN, np.int8), 0.05, np.zeros(3))
    assert map_topics.contains(drives.room(), blank)
