"""The table of the robots' names: complete, and in step with mcl's parameters and profiles."""

from __future__ import annotations

import pytest

from mclcli.motion import MODELS as MOTION_MODELS
from mclcli.motion import MOTION_PLUGINS, MOTIONS
from mclcli.settings import Profile, profiles
from mclcli.settings.robots import names
from mclcli.settings.robots.names import MODEL, NOTHING, START

# All parameters that the sources declare, as of 2026.
OF_NAV2 = """
alpha1 alpha2 alpha3 alpha4 alpha5 base_frame_id odom_frame_id global_frame_id scan_topic map_topic laser_model_type
max_beams laser_max_range laser_min_range laser_likelihood_max_dist sigma_hit z_hit z_rand z_short z_max lambda_short
do_beamskip beam_skip_distance beam_skip_threshold beam_skip_error_threshold min_particles max_particles pf_err pf_z
recovery_alpha_slow recovery_alpha_fast resample_interval update_min_d update_min_a robot_model_type set_initial_pose
initial_pose.x initial_pose.y initial_pose.z initial_pose.yaw always_reset_initial_pose first_map_only tf_broadcast
transform_tolerance save_pose_rate initialize_at_saved_pose saved_pose_filepath freespace_downsampling
allow_parameter_qos_overrides random_seed
"""
OF_BELUGA_ALONE = """
point_cloud_topic initial_pose_topic initial_pose.covariance_x initial_pose.covariance_y initial_pose.covariance_yaw
initial_pose.covariance_xy initial_pose.covariance_xyaw initial_pose.covariance_yyaw spatial_resolution_x
spatial_resolution_y spatial_resolution_theta selective_resampling execution_policy model_unknown_space
only_obstacle_boundaries autostart autostart_delay bond_timeout debug
"""
OF_NAV2_ALONE = """
do_beamskip beam_skip_distance beam_skip_threshold beam_skip_error_threshold save_pose_rate initialize_at_saved_pose
saved_pose_filepath random_seed freespace_downsampling allow_parameter_qos_overrides initial_pose.z
"""


def test_every_parameter_of_both_is_there_once() -> None:
    of_nav2 = {row.name for row in names.TABLE if row.nav2 is not None}
    of_beluga = {row.name for row in names.TABLE if row.beluga is not None}
    assert of_nav2 == set(OF_NAV2.split())
    assert of_beluga - of_nav2 == set(OF_BELUGA_ALONE.split())
    assert of_nav2 - of_beluga == set(OF_NAV2_ALONE.split())
    assert len(names.NAMES) == len(names.TABLE)


def test_what_becomes_of_a_name_exists() -> None:
    known = {name for _, name, _, _ in profiles.table()} | {MODEL, START, NOTHING}
    assert {row.becomes for row in names.TABLE} <= known
    assert all(row.note for row in names.TABLE if row.becomes == NOTHING)


@pytest.mark.parametrize("row", names.TABLE, ids=lambda row: row.name)
def test_a_default_is_of_its_type_and_among_its_words(row: names.Name) -> None:
    for default in (row.nav2, row.beluga):
        assert default is None or type(default) is row.kind
        assert default is None or not row.words or default in row.words
    assert set(row.models) <= set(profiles.MODELS)


@pytest.mark.parametrize("model", list(profiles.MODELS))
@pytest.mark.parametrize("profile", ["nav2", "beluga"])
def test_a_robots_default_is_that_of_its_profile(profile: Profile, model: str) -> None:
    values = profiles.build({}, profile=profile, model=model).values()
    for row in names.TABLE:
        default = row.nav2 if profile == "nav2" else row.beluga
        if default is None or row.becomes not in values or (row.models and model not in row.models):
            continue
        if not row.name.endswith(("_topic", "_frame_id")):  # those are found in the log
            assert values[row.becomes] == row.words.get(default, default), row.name


def test_parameters_marked_as_nav2s_are_those_that_nav2_has_under_the_same_name() -> None:
    marked = {name for _, name, _, about in profiles.table() if about.in_nav2}
    assert marked == {row.name for row in names.TABLE if row.nav2 is not None and row.becomes == row.name}


def test_the_motion_models_of_others_are_ours() -> None:
    assert set(MOTIONS.values()) == set(MOTION_MODELS)
    assert {MOTIONS[plugin] for plugin in MOTION_PLUGINS.values()} == set(MOTION_PLUGINS)
    for name, model in MOTIONS.items():
        assert profiles.build({"robot_model_type": name}).motion.robot_model_type == model
