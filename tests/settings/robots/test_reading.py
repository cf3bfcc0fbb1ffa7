"""Files of robots: what they come to, where their blocks stand, and what is wrong with them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import HealthCheck, given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st

from mclcli import load_settings
from mclcli.errors import MclError, UsageError
from mclcli.settings import profiles
from tests.settings.robots.robots import BELUGA, NAV2, amcl, read

if TYPE_CHECKING:
    import random
    from pathlib import Path


GARBAGE = "az09.:-_/*#&!|>{}[]'\"\n\t %@,é\u202e\0"


def refused(folder: Path, text: str) -> str:
    """The line that refuses a file, without the file's name."""
    with pytest.raises(UsageError) as caught:
        read(folder, text)
    name = f"{folder / 'robot.yaml'}: "
    assert str(caught.value).startswith(name)
    assert "\n" not in str(caught.value)
    return str(caught.value).removeprefix(name)


def test_a_whole_robots_file(tmp_path: Path) -> None:
    file = read(tmp_path, NAV2)
    assert (file.dialect, file.profile, file.model, file.namespace) == (
        "nav2_amcl",
        "nav2",
        "likelihood_field_prob",
        "",
    )
    assert file.values == {
        "robot_model_type": "differential",
        "alpha1": 0.11,
        "alpha2": 1.0,
        "alpha3": 0.3,
        "alpha4": 0.4,
        "base_frame_id": "base_footprint",
        "odom_frame_id": "odom",
        "global_frame_id": "map",
        "do_beamskip": True,
        "beam_skip_distance": 0.4,
        "laser_max_range": 12.0,
        "max_beams": 72,
        "min_particles": 300,
        "max_particles": 1500,
        "pf_z": 0.95,
        "kld_quantile": "z",
        "z_hit": 0.7,
        "scan_topic": "scan",
    }
    assert file.tentative == {"base_frame_id", "odom_frame_id", "scan_topic"}
    assert file.start is not None
    assert file.start.pose.tolist() == [1.5, -2.0, 0.5]
    assert not file.start.covariance.any()


def test_what_a_robots_file_is_told_to_have_no_part_is_said_once(tmp_path: Path) -> None:
    chose, unused = (line.partition(": ")[2] for line in read(tmp_path, NAV2).remarks)
    assert chose == "parameters of nav2_amcl, node /amcl: profile nav2, model likelihood_field_prob"
    assert unused == (
        "not used: z_max (not of model likelihood_field_prob); save_pose_rate, tf_broadcast, initial_pose.z, "
        "use_sim_time, qos_overrides./scan.subscription.depth (no part in a replay)"
    )


def test_belugas_file_is_known_by_its_own_names(tmp_path: Path) -> None:
    file = read(tmp_path, BELUGA)
    assert (file.dialect, file.profile, file.model) == ("Beluga", "beluga", "likelihood_field")
    assert file.values == {
        "robot_model_type": "differential",
        "alpha1": 0.1,
        "field_unknown": "uniform",
        "obstacles": "occupied",
        "resample_ess": 0.5,
        "pf_z": 3.0,
        "kld_quantile": "z",
    }
    assert file.start is not None
    np.testing.assert_array_equal(file.start.covariance, [[0.25, 0.01, 0.0], [0.01, 0.16, 0.0], [0.0, 0.0, 0.09]])
    assert "do_beamskip (unknown to Beluga)" in file.remarks[1]
    assert file.warnings == ()


@pytest.mark.parametrize(
    "line", ["robot_model_type: stationary", "debug: false", "initial_pose: {covariance_x: 0.1}", "autostart: true"]
)
def test_one_name_of_belugas_is_enough(tmp_path: Path, line: str) -> None:
    assert read(tmp_path, amcl("alpha1: 0.1", line)).profile == "beluga"


def test_a_name_of_belugas_for_all_nodes_is_not_enough(tmp_path: Path) -> None:
    everyone = "/**:\n  ros__parameters:\n    autostart: true\n"
    assert read(tmp_path, everyone + amcl("alpha1: 0.1")).profile == "nav2"


@pytest.mark.parametrize("motion", ["omnidirectional", "omnidirectional_drive", '"nav2_amcl::OmniMotionModel"'])
def test_all_names_of_a_motion_model(tmp_path: Path, motion: str) -> None:
    assert read(tmp_path, amcl(f"robot_model_type: {motion}")).values["robot_model_type"] == "omnidirectional"


@pytest.mark.parametrize(
    ("head", "namespace"),
    [
        ("amcl:\n  ros__parameters:\n", ""),
        ("/amcl:\n  ros__parameters:\n", ""),
        ("robot1/amcl:\n  ros__parameters:\n", "/robot1"),
        ("/fleet/robot1/amcl:\n  ros__parameters:\n", "/fleet/robot1"),
        ("robot1:\n amcl:\n  ros__parameters:\n", "/robot1"),
        ("/**:\n  ros__parameters:\n", ""),
        ("/**/amcl:\n  ros__parameters:\n", ""),
        ("/**:\n amcl:\n  ros__parameters:\n", ""),
    ],
)
def test_wherever_the_block_stands(tmp_path: Path, head: str, namespace: str) -> None:
    file = read(tmp_path, amcl("alpha1: 0.125", head=head))
    assert (file.values, file.namespace) == ({"alpha1": 0.125}, namespace)


def test_of_several_blocks_for_a_node_later_ones_go_before(tmp_path: Path) -> None:
    everyone = "/**:\n  ros__parameters:\n    alpha1: 0.1\n    robot_radius: 0.2\n    alpha2: 0.2\n"
    one = amcl("alpha1: 0.3")
    assert read(tmp_path, everyone + one).values == {"alpha1": 0.3, "alpha2": 0.2}
    assert read(tmp_path, one + everyone).values == {"alpha1": 0.1, "alpha2": 0.2}


def test_a_pattern_for_other_namespaces_does_not_count(tmp_path: Path) -> None:
    elsewhere = "/robot2/**:\n  ros__parameters:\n    alpha1: 0.9\n"
    one = amcl("alpha1: 0.3", head="robot1/amcl:\n  ros__parameters:\n")
    assert read(tmp_path, one + elsewhere).values == {"alpha1": 0.3}


def test_robots_that_are_alike_are_one(tmp_path: Path) -> None:
    both = "".join(amcl("alpha1: 0.3", head=f"robot{i}/amcl:\n  ros__parameters:\n") for i in (1, 2))
    assert read(tmp_path, both).values == {"alpha1": 0.3}
    said = refused(tmp_path, both.replace("0.3", "0.4", 1))
    assert said.startswith("amcl stands there for several robots, differently: /robot1/amcl, /robot2/amcl; ")


def test_mcls_own_block_goes_before(tmp_path: Path) -> None:
    own = "mcl:\n  ros__parameters:\n    profile: textbook\n    alpha1: 0.5\n    sigma_bearing: 3deg\n"
    file = read(tmp_path, own + amcl("alpha1: 0.3", "alpha2: 0.4"))
    assert file.values == {"alpha1": 0.5, "alpha2": 0.4, "sigma_bearing": "3deg"}
    assert file.profile == "textbook"


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        (["alpha1: 0.2", "sigma_hitt: 0.2"], "neither nav2_amcl nor Beluga has: 'sigma_hitt', line 4 (did you mean "),
        (["laser_z_hit: 0.2"], "nor Beluga has: 'laser_z_hit', line 3 (ROS 1's name of z_hit); correct it, or "),
        (["gui_publish_rate: 0.2"], "nor Beluga has: 'gui_publish_rate', line 3 (ROS 1's); correct it, or "),
        (
            ["qqq: 0.2"],
            "neither nav2_amcl nor Beluga has: 'qqq', line 3; correct it, or pass over it as the robot does",
        ),
        (["initial_pose: {xx: 0.2}"], "has: 'initial_pose.xx', line 3 (did you mean 'initial_pose.x'?)"),
        (["initial_pose: {a: 0.2}"], "has: 'initial_pose.a', line 3 (the yaw is initial_pose.yaw)"),
        (["initial_pose: [0.0, 0.2]"], "has: 'initial_pose', line 3 (a list is no pose there"),
        (["alpha1: 3deg"], "alpha1 = '3deg', line 3: must be a number (units are mcl's own dialect)"),
        (["alpha1: '0.2'"], "alpha1 = '0.2', line 3: must be a number"),
        (["alpha1: true"], "alpha1 = True, line 3: must be a number"),
        (["alpha1: [0.2]"], "alpha1 = [0.2], line 3: must be a number"),
        (["alpha1:"], "alpha1 = None, line 3: must be a number"),
        (["max_beams: 60.0"], "max_beams = 60.0, line 3: must be a whole number"),
        (["max_beams: 1"], "max_beams = 1, line 3: must be at least 2"),
        (["do_beamskip: 2"], "do_beamskip = 2, line 3: must be true or false"),
        (["do_beamskip: perhaps"], "do_beamskip = 'perhaps', line 3: must be true or false"),
        (["scan_topic: 5"], "scan_topic = 5, line 3: must be a word"),
        (["laser_model_type: beem"], "laser_model_type = 'beem', line 3: not known; did you mean 'beam'?"),
        (["robot_model_type: differental"], "robot_model_type = 'differental', line 3: not known; did you mean"),
        (["robot_model_type: legs"], "robot_model_type = 'legs', line 3: not known; it is one of nav2_amcl::Diff"),
        (["pf_err: 0.0"], "parameter pf_err = 0.0: must be greater than 0, line 3; see"),
        (["alpha2: .inf"], "parameter alpha2 = inf rad²/m²: must be a finite number, line 3; see"),
        (["min_particles: 9", "max_particles: 8"], "parameter min_particles = 9: must be at most max_particles"),
        (["tf_broadcast: maybe"], "tf_broadcast = 'maybe', line 3: must be true or false"),
        (
            ["set_initial_pose: true", "initial_pose: {covariance_x: -1.0}"],
            "initial_pose.covariance_…: not a covariance",
        ),
        (["set_initial_pose: true", "initial_pose: {x: .nan}"], "the initial pose or its covariance is not a number"),
    ],
)
def test_what_is_wrong_is_named_with_its_line(tmp_path: Path, lines: list[str], said: str) -> None:
    (tmp_path / "robot.yaml").write_text(amcl(*lines))
    with pytest.raises(UsageError) as caught:
        load_settings(tmp_path / "robot.yaml")
    assert said in str(caught.value)
    assert str(caught.value).startswith(f"{tmp_path / 'robot.yaml'}: ")


@pytest.mark.parametrize(("word", "truth"), [("true", True), ("On", True), ("1", True), ("FALSE", False), ("0", False)])
def test_words_for_truth(tmp_path: Path, word: str, truth: bool) -> None:  # noqa: FBT001 - a value under test
    file = read(tmp_path, amcl("laser_model_type: likelihood_field_prob", f"do_beamskip: {word}"))
    assert file.values["do_beamskip"] is truth


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            "controller_server: {ros__parameters: {a: 1}}\nlocal_costmap: {local_costmap: {ros__parameters: {b: 1}}}\n",
            "no block for amcl; it holds controller_server, local_costmap/local_costmap; name",
        ),
        ("/**:\n  ros__parameters: {use_sim_time: true}\n", "no block for amcl; it holds **; name"),
        ("amcl:\n  alpha1: 0.2\n", "no block 'ros__parameters' below amcl; in a ROS file"),
        (amcl("alpha1: 1.0") + amcl("alpha2: 1.0"), "the block of /amcl, line 5, stands there twice; join the two"),
    ],
)
def test_files_without_what_is_needed(tmp_path: Path, text: str, said: str) -> None:
    assert refused(tmp_path, text).startswith(said)


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        (
            ["pf_z: 0.99"],
            "pf_z = 0.99, line 3, is a normal quantile to nav2_amcl, so a probability of 0.839; 99%",
        ),
        (["alpha1: 0.1", "alpha1: 0.2"], "alpha1 stands there twice; the last one counts, line 4, as on the robot"),
        (["point_cloud_topic: /cloud"], "point_cloud_topic = /cloud, line 3, is not followed: mcl reads laser scans"),
        (["spatial_resolution_x: 0.1"], "spatial_resolution_x = 0.1, line 3, is not followed: mcl's bins are 0.5 m"),
    ],
)
def test_warnings(tmp_path: Path, lines: list[str], said: str) -> None:
    (warning,) = read(tmp_path, amcl(*lines)).warnings
    assert warning.partition(": ")[2].startswith(said)


@pytest.mark.parametrize("line", ["pf_z: 3.0", 'point_cloud_topic: ""', "spatial_resolution_theta: 0.1745"])
def test_what_needs_no_warning(tmp_path: Path, line: str) -> None:
    assert read(tmp_path, amcl(line)).warnings == ()


def test_a_pose_counts_only_where_it_is_to_be_set(tmp_path: Path) -> None:
    assert read(tmp_path, amcl("initial_pose: {x: 1.0}")).start is None
    assert read(tmp_path, amcl("set_initial_pose: false", "initial_pose: {x: 1.0}")).start is None


@pytest.mark.parametrize(("yaw", "told"), [("90.0", True), ("-7", True), ("3.2", False)])
def test_a_yaw_of_more_than_a_turn_looks_like_degrees(tmp_path: Path, yaw: str, told: bool) -> None:  # noqa: FBT001
    settings = read(tmp_path, amcl("set_initial_pose: true", f"initial_pose: {{yaw: {yaw}}}"))
    assert told == any("looks like degrees" in line for line in settings.warnings)


def test_belugas_poses_have_its_default_covariance(tmp_path: Path) -> None:
    start = read(tmp_path, amcl("set_initial_pose: true", "debug: false")).start
    assert start is not None
    np.testing.assert_array_equal(start.covariance, np.eye(3) * 1e-6)


def test_what_the_user_wants_goes_before_the_file(tmp_path: Path) -> None:
    (tmp_path / "robot.yaml").write_text(NAV2)
    settings = load_settings(
        tmp_path / "robot.yaml", {"alpha1": 0.5, "z_max": 0.2}, profile="beluga", model="likelihood_field"
    )
    assert (settings.profile, settings.model) == ("beluga", "likelihood_field")
    assert (settings.motion.alpha1, settings.motion.alpha3) == (0.5, 0.3)
    assert not settings.lidars["likelihood_field"].do_beamskip  # nav2_amcl has it in likelihood_field_prob alone


def test_pf_z_stays_a_quantile_whatever_the_profile(tmp_path: Path) -> None:
    (tmp_path / "robot.yaml").write_text(amcl("pf_z: 2.5"))
    assert load_settings(tmp_path / "robot.yaml", profile="textbook").kld.z == 2.5


def test_the_robots_rates_of_recovery_switch_it_on_whatever_the_profile(tmp_path: Path) -> None:
    path = tmp_path / "robot.yaml"
    path.write_text(amcl("recovery_alpha_slow: 0.001", "recovery_alpha_fast: 0.1"))
    assert load_settings(path, profile="textbook").recovery.enabled
    assert not load_settings(path, {"recovery": "off"}, profile="textbook").recovery.enabled
    path.write_text(amcl("recovery_alpha_slow: 0.0", "recovery_alpha_fast: 0.0"))
    assert not load_settings(path, profile="textbook").recovery.enabled
    path.write_text(amcl("recovery_alpha_slow: 0.1", "recovery_alpha_fast: 0.05"))  # nav2_amcl takes that
    assert load_settings(path).recovery.recovery_alpha_fast == 0.05


@given(st.sampled_from([NAV2, BELUGA]), st.randoms(use_true_random=False))
@hypothesis_settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
def test_a_garbled_file_is_read_or_refused_in_one_line(tmp_path: Path, text: str, rng: random.Random) -> None:
    letters = list(text)
    for _ in range(rng.randint(1, 4)):
        at = rng.randrange(len(letters))
        letters[at : at + rng.randint(0, 9)] = rng.choices(GARBAGE, k=rng.randint(0, 3))
    path = tmp_path / "robot.yaml"
    path.write_text("".join(letters), encoding="utf-8")
    try:
        said = f"{path}: {load_settings(path).profile}"
    except MclError as error:
        said = str(error)
    assert said.startswith(f"{path}: ")
    assert "\n" not in said


def test_mcls_own_files_name_profile_and_model(tmp_path: Path) -> None:
    file = read(tmp_path, "profile: nav2\nmodel: beam\nparticles: 10:90\nsigma_hit: 5cm\n")
    assert (file.dialect, file.profile, file.model, file.remarks) == ("mcl", "nav2", "beam", ())
    settings = load_settings(tmp_path / "robot.yaml")
    assert settings == profiles.build(
        {"sigma_hit": 0.05, "min_particles": 10, "max_particles": 90}, profile="nav2", model="beam"
    )
    assert load_settings(tmp_path / "robot.yaml", profile="beluga").profile == "beluga"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("profile: nav3\n", "profile = nav3, line 1: must be one of textbook, nav2, beluga; did you mean 'nav2'?"),
        ("alpha1: 0.2\nmodel: lidar\n", "model = lidar, line 2: must be one of likelihood_field, "),
        ("alpha1: 0.2\nsigma_hitt: 0.2\n", "mcl has no parameter: 'sigma_hitt', line 2 (did you mean 'sigma_hit'?)"),
        ("alpha1: -1\n", "parameter alpha1 = -1.0: must be at least 0, line 1; see `mcl params`"),
        ("particles: 5:x\n", "parameter max_particles: 'x' is not a number, line 1"),
    ],
)
def test_mcls_own_files_name_the_line_too(tmp_path: Path, text: str, said: str) -> None:
    assert refused(tmp_path, text).startswith(said)
