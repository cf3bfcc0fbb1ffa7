"""The parameters of ROS 1's amcl, and which parameter of nav2_amcl or Beluga each is: a table, and reading by it.

Source: ``AmclNode::AmclNode`` and ``updatePoseFromServer`` in amcl_node.cpp (noetic-devel).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, final

from mclcli.io.tables.params_yaml import Given
from mclcli.settings.robots import names

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

    from mclcli.settings.robots.names import Value

MOTIONS = {
    "diff": ("differential", "deviation"),
    "omni": ("omnidirectional", "deviation"),
    "diff-corrected": ("differential", "variance"),
    "omni-corrected": ("omnidirectional", "variance"),
}


@final
@dataclass(frozen=True, slots=True)
class Ros1Name:
    """One parameter of ROS 1's amcl, its default there, and the name of a row of ``names`` that means the same.

    Without such a row it has no part in a replay, and ``note`` says why.
    """

    name: str
    default: Value
    nav2: str = ""
    note: str = ""


def _same(name: str, default: Value) -> Ros1Name:
    return Ros1Name(name, default, name)


_LIVE = "publishing, which a replay does not do"
_ONCE = "about a service call or an operator's pose; `--follow-initialpose` is mcl's"
_PART = "the pose the filter starts at if the file has one of `initial_pose_x`, `_y`, `_a` and `--init` is not given"

TABLE: tuple[Ros1Name, ...] = (
    # Motion
    Ros1Name(
        "odom_model_type",
        "diff",
        "robot_model_type",
        "`diff`, `omni`: with `noise_expression=deviation`; `diff-corrected`, `omni-corrected`: with `variance`",
    ),
    *(Ros1Name(f"odom_alpha{i}", 0.2, f"alpha{i}") for i in range(1, 6)),
    # Lidar
    _same("laser_model_type", "likelihood_field"),
    Ros1Name("laser_max_beams", 30, "max_beams"),
    _same("laser_min_range", -1.0),
    _same("laser_max_range", -1.0),
    _same("laser_likelihood_max_dist", 2.0),
    Ros1Name("laser_sigma_hit", 0.2, "sigma_hit"),
    Ros1Name("laser_z_hit", 0.95, "z_hit"),
    Ros1Name("laser_z_rand", 0.05, "z_rand"),
    Ros1Name("laser_z_short", 0.1, "z_short"),
    Ros1Name("laser_z_max", 0.05, "z_max"),
    Ros1Name("laser_lambda_short", 0.1, "lambda_short"),
    _same("do_beamskip", False),
    _same("beam_skip_distance", 0.5),
    _same("beam_skip_threshold", 0.3),
    _same("beam_skip_error_threshold", 0.9),
    # Size, resampling, recovery
    _same("min_particles", 100),
    _same("max_particles", 5000),
    Ros1Name("kld_err", 0.01, "pf_err"),
    Ros1Name("kld_z", 0.99, "pf_z", "the normal quantile itself, as `pf_z`"),
    _same("resample_interval", 2),
    _same("selective_resampling", False),
    Ros1Name("recovery_alpha_slow", 0.001, "recovery_alpha_slow", "recovery is on there unless a file sets 0"),
    _same("recovery_alpha_fast", 0.1),
    _same("update_min_d", 0.2),
    _same("update_min_a", math.pi / 6.0),
    # Frames
    _same("base_frame_id", "base_link"),
    _same("odom_frame_id", "odom"),
    _same("global_frame_id", "map"),
    # Start
    Ros1Name("initial_pose_x", 0.0, "initial_pose.x", _PART),
    Ros1Name("initial_pose_y", 0.0, "initial_pose.y", _PART),
    Ros1Name("initial_pose_a", 0.0, "initial_pose.yaw", _PART),
    Ros1Name("initial_cov_xx", 0.25, "initial_pose.covariance_x", "m²"),
    Ros1Name("initial_cov_yy", 0.25, "initial_pose.covariance_y", "m²"),
    Ros1Name("initial_cov_aa", (math.pi / 12.0) ** 2, "initial_pose.covariance_yaw", "rad²"),
    # What has no part in a replay
    _same("first_map_only", False),
    _same("tf_broadcast", True),
    _same("transform_tolerance", 0.1),
    _same("save_pose_rate", 0.5),
    Ros1Name("use_map_topic", False, note="`--map` says where the map is"),
    Ros1Name("gui_publish_rate", -1.0, note=_LIVE),
    Ros1Name("std_warn_level_x", 0.2, note=_LIVE),
    Ros1Name("std_warn_level_y", 0.2, note=_LIVE),
    Ros1Name("std_warn_level_yaw", 0.1, note=_LIVE),
    Ros1Name("force_update_after_initialpose", False, note=_ONCE),
    Ros1Name("force_update_after_set_map", False, note=_ONCE),
    Ros1Name("bag_scan_period", -1.0, note="for reading a bag; mcl does that"),
    Ros1Name("restore_defaults", False, note="a button of dynamic reconfiguration"),
)
ROWS = {row.name: row for row in TABLE}
TO_NAV2 = {row.name: row.nav2 for row in TABLE if row.name not in names.NAMES}
KNOWN = {*ROWS, "scan_topic", "map_topic"}  # the latter come from a launch file, which remaps them
FROM_NAV2 = {row.nav2: row.name for row in TABLE if row.nav2 and row.name != row.nav2}
_TOPICS = ("scan_topic", "map_topic")  # remapped in a launch file
POSE = ("initial_pose_x", "initial_pose_y", "initial_pose_a")


def is_ros1(given: Collection[str], own: Collection[str]) -> bool:
    """Whether these are names of ROS 1's amcl: more are its alone than mcl's alone (``own`` are all of mcl's)."""
    of_ros1 = sum(name in TO_NAV2 for name in given)
    of_mcl = sum(name in own and name not in ROWS for name in given)
    return of_ros1 > of_mcl


def is_found_elsewhere(name: str) -> bool:
    """Whether a parameter can be missing without another filter: a frame, the start, or one without a part."""
    if name not in ROWS:
        return False
    nav2 = ROWS[name].nav2
    return not nav2 or name.endswith("_frame_id") or names.NAMES[nav2].becomes in {names.START, names.NOTHING}


def in_navs_names(values: Mapping[str, Given]) -> tuple[dict[str, Given], dict[str, str]]:
    """Values by nav2's or Beluga's names, with ROS 1's defaults (line 0), and what each is called in the file.

    Names that ROS 1's amcl does not have are left out, and so are those that have no part.
    """
    found = {row.nav2: Given(row.default, 0) for row in TABLE if row.nav2 and not row.nav2.endswith("_frame_id")}
    found |= {name: values[name] for name in _TOPICS if name in values}
    given = {row.nav2: values[row.name] for row in TABLE if row.nav2 and row.name in values}
    found |= {name: _as_read_there(name, value) for name, value in given.items() if not _is_left_out(name, value)}
    if any(name in values for name in POSE):
        found["set_initial_pose"] = Given(True, 0)
    return found, {row.nav2: row.name for row in TABLE if row.nav2}


def instead(given: Given, value: Value) -> Given:
    """The same place with another value."""
    return replace(given, value=value)


def _is_left_out(name: str, given: Given) -> bool:
    """Whether ROS 1 keeps its default: where the pose or its covariance is not a number."""
    return name.startswith("initial_pose") and isinstance(given.value, float) and math.isnan(given.value)


def _as_read_there(name: str, given: Given) -> Given:
    """30.0 as the whole number that it is, and frames without a slash before them."""
    if name.endswith("_frame_id") and isinstance(given.value, str):
        return instead(given, given.value.removeprefix("/"))
    whole = names.NAMES[name].kind is int and isinstance(given.value, float) and given.value.is_integer()
    return instead(given, int(given.value)) if whole else given
