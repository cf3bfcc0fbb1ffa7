"""Who does what in a log: by the command line, by parameters, by the robot's own file where the log bears it out."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from mclcli.cli import console
from mclcli.errors import UsageError
from mclcli.filter.start import AroundPose
from mclcli.io.recording import roles, topic_names

if TYPE_CHECKING:
    from collections.abc import Collection

    from mclcli.cli.options import Chosen
    from mclcli.filter.start import Start
    from mclcli.io.recording.recording import Recording
    from mclcli.io.recording.survey import LogSurvey
    from mclcli.world.occupancy import OccupancyGrid

# The option that makes a parameter's wish idle.
_OVERRULED_BY = {"scan_topic": "scans", "map_topic": "map_file"}


def assign_roles(arguments: dict[str, Any], recording: Recording, chosen: Chosen) -> roles.Roles:
    """Roles of the log's topics and frames; says so where there was a choice.

    Raises
    ------
    UsageError
        If the log has no such topic as the command line or --set names.

    """
    if arguments["vision"] and arguments["landmarks"] is None:
        raise UsageError("--vision needs --landmarks: where the landmarks stand")
    overruled = {key for key, option in _OVERRULED_BY.items() if arguments[option]}
    names = names_in(recording.survey, chosen, overruled)
    requested = roles.RequestedRoles(
        scan=arguments["scans"] or ((names["scan_topic"],) if names["scan_topic"] else ()),
        odometry=arguments["odom"] or "",
        vision=arguments["vision"],
        map=names["map_topic"],
        base_frame=names["base_frame_id"],
        odom_frame=names["odom_frame_id"],
        map_frame=chosen.settings.frames.global_frame_id,
    )
    parts = roles.assign(recording.survey, requested)
    for role in ("scan", "odometry"):
        if "not " in (reason := parts.reasons.get(role, "")):
            console.remark(f"{role}: {' '.join(getattr(parts, role)) if role == 'scan' else parts.odometry}, {reason}")
    return parts


def names_in(survey: LogSurvey, chosen: Chosen, overruled: Collection[str] = ()) -> dict[str, str]:
    """Topics and frames by parameter: those set, and those of the robot's file that the log has; the rest is empty.

    ``overruled`` are parameters in whose place the command line has named something.
    """
    frames = chosen.settings.frames
    named = {key: getattr(frames, key) for key in ("base_frame_id", "odom_frame_id", "scan_topic", "map_topic")}
    for key, name in named.items():
        if key in overruled:
            named[key] = ""
        elif chosen.file is not None and key in chosen.tentative:
            named[key] = topic_names.find(survey, key, name, chosen.file.namespace)
            if not named[key]:
                console.remark(f"{chosen.file.name}: {key} '{name}' is not in the log; chosen as if not given")
        elif name and key.endswith("topic"):
            named[key] = f"/{name.lstrip('/')}"
    return named


def start_of_file(chosen: Chosen, grid: OccupancyGrid | None) -> Start | None:
    """The start that the robot's file states, None if it states none.

    Raises
    ------
    UsageError
        If it lies off the map.

    """
    file = chosen.file
    if file is None or file.start is None:
        return None
    from mclcli.replay.setup import describe_extent

    x, y, yaw = (float(value) for value in file.start.pose)
    if grid is not None and not grid.contains(file.start.pose[:2]):
        raise UsageError(
            f"{file.name}: its initial_pose ({x:g}, {y:g}) lies off the map; {describe_extent(grid)}; give --init"
        )
    spread = "with its covariance" if file.start.covariance.any() else "all particles there, as in nav2_amcl"
    console.remark(f"start: initial_pose of {file.name}, {x:g},{y:g},{yaw:g}, {spread}; --init says otherwise")
    return AroundPose(file.start.pose, file.start.covariance)
