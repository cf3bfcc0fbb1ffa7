"""Other localizers whose files look like amcl's, so that they are called what they are.

Sources, as of 2026: emcl2_ros2's ``config/emcl2.param.yaml``; Beluga's ``ndt_amcl_node.cpp``, and its 3D
sibling, and ``beluga_example/params/default.ros.yaml``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Collection

_ENOUGH = 2  # names that nobody else has
_OTHERS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "emcl2": (
        ("emcl", "emcl2", "emcl_node", "emcl2_node"),
        (
            "num_particles",
            "odom_freq",
            "footprint_frame_id",
            "odom_fw_dev_per_fw",
            "odom_fw_dev_per_rot",
            "odom_rot_dev_per_fw",
            "odom_rot_dev_per_rot",
            "alpha_threshold",
            "open_space_threshold",
            "expansion_radius_position",
            "expansion_radius_orientation",
            "extraction_rate",
            "range_threshold",
            "sensor_reset",
            "scan_increment",
        ),
    ),
    "Beluga's amcl for ROS 1": (
        (),
        ("map_service", "execution_policy", "initial_cov_xy", "initial_cov_xa", "initial_cov_ya", "initial_pose_topic"),
    ),
    "Beluga's NDT localizer": (("ndt_amcl", "ndt_amcl_3d"), ("minimum_likelihood", "d1", "d2", "map_path")),
}


def localizer(names: Collection[str], nodes: Collection[str] = ()) -> str:
    """Whose parameters have these names, or whose these nodes are: another localizer than amcl, or empty."""
    for whose, (called, own) in _OTHERS.items():
        if len(set(own) & set(names)) >= _ENOUGH or set(called) & set(nodes):
            return whose
    return ""
