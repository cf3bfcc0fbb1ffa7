"""The parameters of nav2_amcl and of Beluga's amcl, and what becomes of each: one table, docs/nav2.md is made from it.

Source: nav2_amcl's ``AmclNode::initParameters`` and Beluga's ``beluga_amcl`` as of 2026.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, final

from mclcli.motion import BELUGA_MOTIONS, MOTIONS

if TYPE_CHECKING:
    from collections.abc import Mapping

Value = bool | int | float | str

ROS1 = "ROS 1's amcl"  # the dialect whose names are in ``ros1``

# What a name can become besides a parameter of mcl.
MODEL, START, NOTHING = "--model", "--init", ""

_FIELDS = ("likelihood_field", "likelihood_field_prob")
_PROB = ("likelihood_field_prob",)
_FIELD = ("likelihood_field",)
_BEAM = ("beam",)

_LIDAR_MODELS: dict[Value, Value] = {name: name for name in (*_FIELDS, *_BEAM)}


@final
@dataclass(frozen=True, slots=True)
class Name:
    """One parameter of the robot's node.

    ``nav2`` and ``beluga`` are the defaults there, None where it has no such parameter; they say the type, too.
    ``becomes`` is mcl's parameter, ``--model``, ``--init`` or nothing. ``words`` are the values that exist, as mcl's
    own. ``models`` are the lidar models that it belongs to there, all if empty. ``low`` is the least value that works
    there. ``only`` says that mcl does what the default says, whatever the file does.
    """

    name: str
    nav2: Value | None
    beluga: Value | None
    becomes: str = NOTHING
    note: str = ""
    words: Mapping[Value, Value] = field(default_factory=dict)
    models: tuple[str, ...] = ()
    low: float | None = None
    only: bool = False

    @property
    def kind(self) -> type[Value]:
        """Type of its values."""
        default = self.beluga if self.nav2 is None else self.nav2
        return str if default is None else type(default)


def _same(name: str, default: Value, note: str = "", models: tuple[str, ...] = (), low: float | None = None) -> Name:
    """A parameter that all three have, with one default in the others."""
    return Name(name, default, default, name, note, models=models, low=low)


def _useless(name: str, nav2: Value | None, beluga: Value | None, note: str) -> Name:
    return Name(name, nav2, beluga, NOTHING, note)


_POSE = "used as `--init` if `set_initial_pose` is true and `--init` is not given"
_BINS = "mcl's bins are 0.5 m × 0.5 m × 10°; for another value there is a warning"
_LIVE = "publishing, which a replay does not do"
_NODE = "how the node is run"

TABLE: tuple[Name, ...] = (
    # Motion
    Name(
        "robot_model_type",
        "nav2_amcl::DifferentialMotionModel",
        "differential_drive",
        "robot_model_type",
        "also the names of nav2 before it had plugins, `differential` and `omnidirectional`",
        words=MOTIONS,
    ),
    _same("alpha1", 0.2),
    _same("alpha2", 0.2),
    _same("alpha3", 0.2),
    _same("alpha4", 0.2),
    _same("alpha5", 0.2),
    # Lidar
    Name("laser_model_type", "likelihood_field", "likelihood_field", MODEL, "`--model` goes before", _LIDAR_MODELS),
    _same("max_beams", 60, "nav2_amcl scores nothing below 2, so that is an error", low=2),
    Name("laser_min_range", -1.0, 0.0, "laser_min_range"),
    _same("laser_max_range", 100.0),
    _same("laser_likelihood_max_dist", 2.0, models=_FIELDS),
    _same("sigma_hit", 0.2),
    _same("z_hit", 0.5),
    _same("z_rand", 0.5),
    _same("z_short", 0.05, models=_BEAM),
    _same("z_max", 0.05, models=_BEAM),
    _same("lambda_short", 0.1, models=_BEAM),
    Name("do_beamskip", False, None, "do_beamskip", models=_PROB),
    Name("beam_skip_distance", 0.5, None, "beam_skip_distance", models=_PROB),
    Name("beam_skip_threshold", 0.3, None, "beam_skip_threshold", models=_PROB),
    Name("beam_skip_error_threshold", 0.9, None, "beam_skip_error_threshold", models=_PROB),
    Name(
        "model_unknown_space",
        None,
        False,
        "field_unknown",
        "Beluga's `likelihood_field_prob` does not have it",
        {True: "uniform", False: "free"},
        _FIELD,
    ),
    Name(
        "only_obstacle_boundaries",
        None,
        True,
        "obstacles",
        "Beluga's `likelihood_field_prob` does not have it",
        {True: "boundary", False: "occupied"},
        _FIELD,
    ),
    # Size, resampling, recovery
    _same("min_particles", 500),
    _same("max_particles", 2000),
    _same("pf_err", 0.05),
    _same(
        "pf_z",
        0.99,
        "there the normal quantile itself, whatever its name says: 0.99 is a probability of 84 %. From such a file it "
        "comes with `kld_quantile=z`, and with a warning if it looks like a probability",
    ),
    Name("spatial_resolution_x", None, 0.5, NOTHING, _BINS, only=True),
    Name("spatial_resolution_y", None, 0.5, NOTHING, _BINS, only=True),
    Name("spatial_resolution_theta", None, 0.174532925199433, NOTHING, _BINS, only=True),
    _same("resample_interval", 1, low=1),
    Name("selective_resampling", None, False, "resample_ess", "", {True: 0.5, False: 1.0}),
    _same("recovery_alpha_slow", 0.0, "0 is no recovery there; above 0 it comes with `recovery=uniform`"),
    _same("recovery_alpha_fast", 0.0),
    _same("update_min_d", 0.25),
    _same("update_min_a", 0.2),
    # Frames and topics
    Name("base_frame_id", "base_footprint", "base_footprint", "base_frame_id", "used if the log has it"),
    Name("odom_frame_id", "odom", "odom", "odom_frame_id", "used if the log has it"),
    _same("global_frame_id", "map", "parent of the transform to the odometry in an MCAP trace"),
    Name("scan_topic", "scan", "", "scan_topic", "used if the log has it; `--scan` goes before"),
    Name("map_topic", "map", "map", "map_topic", "used if the log has it; `--map` goes before"),
    Name("point_cloud_topic", None, "", NOTHING, "mcl reads laser scans; set, there is a warning", only=True),
    # Start
    Name("set_initial_pose", False, False, START, _POSE),
    Name("initial_pose.x", 0.0, 0.0, START, _POSE),
    Name("initial_pose.y", 0.0, 0.0, START, _POSE),
    Name("initial_pose.z", 0.0, None, NOTHING, "a robot on a plane has no height"),
    Name("initial_pose.yaw", 0.0, 0.0, START, _POSE),
    Name("initial_pose.covariance_x", None, 1e-6, START, "m²; nav2_amcl puts all particles at one point"),
    Name("initial_pose.covariance_y", None, 1e-6, START, "m²"),
    Name("initial_pose.covariance_yaw", None, 1e-6, START, "rad²"),
    Name("initial_pose.covariance_xy", None, 0.0, START, "m²"),
    Name("initial_pose.covariance_xyaw", None, 0.0, START, "m rad"),
    Name("initial_pose.covariance_yyaw", None, 0.0, START, "m rad"),
    # What has no part in a replay
    _useless("always_reset_initial_pose", False, False, "about a second map; a run has one"),
    _useless("first_map_only", False, False, "about a second map; a run has one"),
    _useless("initial_pose_topic", None, "initialpose", "`--init TOPIC` names a topic to start from"),
    _useless("initialize_at_saved_pose", False, None, "the file with the pose is on the robot; give `--init`"),
    _useless("saved_pose_filepath", "", None, "the file with the pose is on the robot; give `--init`"),
    _useless("save_pose_rate", 0.5, None, "about a file on the robot"),
    _useless("freespace_downsampling", False, None, "mcl draws anywhere within all free cells"),
    _useless("random_seed", -1, None, "without effect in nav2_amcl; `--seed` is mcl's"),
    _useless("tf_broadcast", True, True, _LIVE),
    _useless("transform_tolerance", 1.0, 1.0, _LIVE),
    _useless("execution_policy", None, "seq", "`--threads` is mcl's, and the results are the same"),
    _useless("debug", None, False, _LIVE),
    _useless("autostart", None, False, _NODE),
    _useless("autostart_delay", None, 0.0, _NODE),
    _useless("bond_timeout", None, 4.0, _NODE),
    _useless("allow_parameter_qos_overrides", True, None, _NODE),
)
NAMES: dict[str, Name] = {row.name: row for row in TABLE}

# Parameters that ROS gives to nodes of any kind, and nav2 to all of its own; whatever stands below the prefixes.
OF_ANY_NODE = (
    "use_sim_time",
    "start_type_description_service",
    "bond_heartbeat_period",
    "autostart_node",
    "introspection_mode",
    "service_introspection_mode",
    "use_realtime_priority",
)
OF_ANY_NODE_BELOW = ("qos_overrides.", "diagnostic_updater.")


def is_of_any_node(name: str) -> bool:
    """Whether ROS or nav2 give every node a parameter of that name."""
    return name in OF_ANY_NODE or name.startswith(OF_ANY_NODE_BELOW)


def is_belugas(name: str, value: object) -> bool:
    """Whether a parameter, or what it is set to, exists in Beluga only."""
    row = NAMES.get(name)
    if row is None:
        return False
    return row.nav2 is None or (name == "robot_model_type" and value in BELUGA_MOTIONS)
