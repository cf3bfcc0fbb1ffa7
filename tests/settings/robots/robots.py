"""Parameter files as robots have them, and reading them from text."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mclcli.settings.robots.reading import FileParameters, load

if TYPE_CHECKING:
    from pathlib import Path

    from mclcli.settings import Profile

# A whole robot: other nodes around amcl, with launch substitutions, lists, words for truth, and a key twice.
NAV2 = """\
# Robot in the hall
bt_navigator:
  ros__parameters:
    use_sim_time: true
    use_sim_time: true
    default_nav_to_pose_bt_xml: "$(find-pkg-share hall_robot)/trees/go.xml"
    plugin_lib_names: [nav2_spin_action_bt_node, nav2_wait_action_bt_node]

amcl:
  ros__parameters:
    use_sim_time: True
    qos_overrides./scan.subscription.depth: 5
    robot_model_type: "nav2_amcl::DifferentialMotionModel"
    alpha1: 0.11
    alpha2: 1   # a whole number
    alpha3: 3e-1
    alpha4: .4
    base_frame_id: "base_footprint"
    odom_frame_id: odom
    global_frame_id: map
    laser_model_type: "likelihood_field_prob"
    do_beamskip: on
    beam_skip_distance: 0.4
    laser_max_range: 12.0
    max_beams: 72
    min_particles: 300
    max_particles: 1500
    pf_z: 0.95
    z_hit: 0.7
    z_max: 0.06
    save_pose_rate: 0.5
    tf_broadcast: true
    scan_topic: scan
    set_initial_pose: true
    initial_pose: {x: 1.5, y: -2, z: 0.0, yaw: 0.5}

local_costmap:
  local_costmap:
    ros__parameters:
      width: 3
      voxel_layer:
        scan: {topic: <robot_namespace>/scan, clearing: True}
"""

BELUGA = """\
amcl:
  ros__parameters:
    robot_model_type: differential_drive
    alpha1: 0.1
    execution_policy: par
    laser_model_type: likelihood_field
    model_unknown_space: true
    only_obstacle_boundaries: false
    selective_resampling: true
    pf_z: 3.0
    do_beamskip: true
    set_initial_pose: true
    initial_pose.x: 0.5
    initial_pose.yaw: 0.25
    initial_pose.covariance_x: 0.25
    initial_pose.covariance_y: 0.16
    initial_pose.covariance_yaw: 0.09
    initial_pose.covariance_xy: 0.01
"""


def amcl(*lines: str, head: str = "amcl:\n  ros__parameters:\n") -> str:
    """A file with these lines as parameters of amcl."""
    return head + "".join(f"    {line}\n" for line in lines)


def read(folder: Path, text: str, *, profile: Profile | None = None, model: str | None = None) -> FileParameters:
    """What a file of this text says."""
    path = folder / "robot.yaml"
    path.write_text(text, encoding="utf-8")
    return load(path, profile=profile, model=model)
