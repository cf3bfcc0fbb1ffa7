"""``mcl params`` and ``--params``: in mcl's dialect and in the robots', and what a run makes of a robot's file."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import pytest
from ruamel.yaml import YAML

from mclcli.settings import profiles
from tests.cli.support import OFFICE_MAP, Message, Result, decoded, made, mcl, single_error, write_mcap
from tests.settings.robots.robots import BELUGA, NAV2, amcl

if TYPE_CHECKING:
    from pathlib import Path

    from tests.cli.conftest import Runner

SETTINGS = ("--set", "z_hit=0.7", "--set", "sigma_bearing=5deg", "--set", "max_beams=33", "--set", "base_frame_id=base")


def values_of(result: Result) -> dict[str, object]:
    """What ``mcl params`` printed, read as YAML."""
    assert result.code == 0, result.err
    values = YAML(typ="safe", pure=True).load(result.out)
    assert isinstance(values, dict)
    return values


def run_with(log: Path, params: Path, *words: object) -> Result:
    """A run with a robot's file, and without --init."""
    return mcl("run", log, "--map", OFFICE_MAP, "--params", params, "--particles", 50, "--duration", 4, *words)


def metadata(trace: bytes) -> dict[str, object]:
    """The first line of a weight trace."""
    facts = json.loads(trace.splitlines()[0].removeprefix(b"#"))
    assert isinstance(facts, dict)
    return facts


# mcl's own dialect


def test_params_lists_every_parameter_with_its_default() -> None:
    result = mcl("params")
    assert (result.code, result.err) == (0, "")
    assert YAML(typ="safe", pure=True).load(result.out) == profiles.build({}).as_file()
    assert all(" # " in line for line in result.out.decode().splitlines())


def test_params_come_back_through_params(tmp_path: Path, run_short: Runner, short_track: bytes) -> None:
    changed = mcl("params", *SETTINGS)
    (tmp_path / "p.yaml").write_bytes(changed.out)
    assert mcl("params", "--params", tmp_path / "p.yaml").out == changed.out
    assert changed.out != mcl("params").out
    values = YAML(typ="safe", pure=True).load(changed.out)
    assert (values["z_hit"], values["max_beams"], values["base_frame_id"]) == (0.7, 33, "base")
    (tmp_path / "defaults.yaml").write_bytes(mcl("params").out)
    assert run_short("--params", tmp_path / "defaults.yaml").out == short_track


def test_a_flag_goes_before_set_and_set_before_params(tmp_path: Path) -> None:
    (tmp_path / "p.yaml").write_text("z_hit: 0.1\nz_rand: 0.2\n")
    words = ("--params", tmp_path / "p.yaml", "--set", "z_hit=0.3")
    values = YAML(typ="safe", pure=True).load(mcl("params", *words).out)
    assert (values["z_hit"], values["z_rand"]) == (0.3, 0.2)


def test_the_number_of_particles_of_the_flag_counts(run_short: Runner) -> None:
    steps = run_short("--steps", "-", "--set", "particles=50").table  # the fixture gives --particles 300
    assert set(steps["n"]) == {300.0}


def test_parameters_that_are_none(tmp_path: Path) -> None:
    (tmp_path / "p.yaml").write_text("sigma_hitt: 1\n")
    assert "did you mean 'sigma_hit'?" in single_error(mcl("params", "--params", tmp_path / "p.yaml"), 2)
    single_error(mcl("params", "--params", tmp_path / "none.yaml"), 2)
    (tmp_path / "list.yaml").write_text("- 1\n")
    assert "not a mapping" in single_error(mcl("params", "--params", tmp_path / "list.yaml"), 2)


@pytest.mark.parametrize("model", list(profiles.MODELS))
@pytest.mark.parametrize("profile", list(profiles.PROFILES))
@pytest.mark.parametrize("form", ["mcl", "nav2"])
def test_every_profile_and_model_comes_back_in_both_forms(tmp_path: Path, form: str, profile: str, model: str) -> None:
    given = ("--profile", profile, "--model", model)
    (tmp_path / "p.yaml").write_bytes(mcl("params", *given, "--format", form).out)
    again = mcl("params", "--params", tmp_path / "p.yaml", "-q")
    assert again.out == mcl("params", *given).out
    assert (values_of(again)["profile"], values_of(again)["model"]) == (profile, model)
    assert mcl("params", "--params", tmp_path / "p.yaml", "--format", form).out == (tmp_path / "p.yaml").read_bytes()


def test_which_dialect_was_read_is_said_on_demand(tmp_path: Path) -> None:
    (tmp_path / "p.yaml").write_text("z_hit: 0.1\n")
    assert mcl("params", "--params", tmp_path / "p.yaml").err == ""
    assert "p.yaml: parameters in mcl's own dialect" in mcl("params", "--params", tmp_path / "p.yaml", "-v").err


# The robots' dialects


def test_a_robots_file_brings_its_profile_and_model(tmp_path: Path) -> None:
    (tmp_path / "nav2.yaml").write_text(NAV2)
    (tmp_path / "beluga.yaml").write_text(BELUGA)
    result = mcl("params", "--params", tmp_path / "nav2.yaml")
    values = values_of(result)
    assert (values["profile"], values["model"], values["alpha1"]) == ("nav2", "likelihood_field_prob", 0.11)
    assert "profile nav2, model likelihood_field_prob" in result.err
    assert result.err.count("save_pose_rate") == 1
    assert "controller" not in result.err
    assert "mcl: warning: " in result.err
    assert "pf_z = 0.95" in result.err
    assert "--init 1.5,-2,0.5" in result.err
    assert values_of(mcl("params", "--params", tmp_path / "beluga.yaml"))["profile"] == "beluga"


def test_flag_before_set_before_the_robots_file_before_the_profile(tmp_path: Path) -> None:
    (tmp_path / "nav2.yaml").write_text(NAV2)
    words = ("--params", tmp_path / "nav2.yaml", "--set", "alpha1=0.5", "--set", "robot_model_type=stationary")
    values = values_of(mcl("params", *words, "--profile", "textbook", "--model", "likelihood_field"))
    assert (values["profile"], values["model"]) == ("textbook", "likelihood_field")
    assert (values["alpha1"], values["alpha3"], values["alpha5"]) == (0.5, 0.3, 0.1)
    assert (values["robot_model_type"], values["combination"]) == ("stationary", "log")


def test_a_tuned_file_keeps_what_the_robot_was_given_besides(tmp_path: Path) -> None:
    (tmp_path / "nav2.yaml").write_text(NAV2)
    result = mcl("params", "--params", tmp_path / "nav2.yaml", "--set", "alpha1=0.75", "--format", "nav2")
    read = YAML(typ="safe", pure=True).load(result.out)["amcl"]["ros__parameters"]
    assert (read["alpha1"], read["save_pose_rate"], read["initial_pose.x"]) == (0.75, 0.5, 1.5)
    assert (read["robot_model_type"], read["z_max"]) == ("nav2_amcl::DifferentialMotionModel", 0.06)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (amcl("alpha_1: 0.2"), "has: 'alpha_1', line 3 (did you mean 'alpha1'?); correct it, or pass over it"),
        ("planner_server:\n  ros__parameters: {a: 1}\n", "no block for amcl; it holds planner_server"),
    ],
)
def test_a_robots_file_that_cannot_be_used(tmp_path: Path, text: str, said: str) -> None:
    (tmp_path / "nav2.yaml").write_text(text)
    assert said in single_error(mcl("params", "--params", tmp_path / "nav2.yaml"), 2)


# Runs


def test_the_robots_start_is_used_where_no_other_is_given(short: Path, tmp_path: Path) -> None:
    params = tmp_path / "nav2.yaml"
    params.write_text(amcl("set_initial_pose: true", "initial_pose: {x: -7.45, y: 1.62, yaw: -1.48}"))
    result = run_with(short, params, "-o", "-")
    assert "start: initial_pose of " in result.err
    first = result.out.splitlines()[2].decode().split(",")
    np.testing.assert_allclose([float(value) for value in first[3:6]], [-7.45, 1.62, -1.48], atol=1e-9)
    facts = metadata(result.out)
    assert (facts["profile"], facts["model"]) == ("nav2", "likelihood_field")
    other = run_with(short, params, "--init", "/initialpose")
    assert other.code == 0
    assert "initial_pose" not in other.err


def test_a_start_off_the_map_names_the_file(short: Path, tmp_path: Path) -> None:
    (tmp_path / "nav2.yaml").write_text(amcl("set_initial_pose: true", "initial_pose: {x: 500.0}"))
    said = single_error(run_with(short, tmp_path / "nav2.yaml"), 2)
    assert said.startswith(f"{tmp_path / 'nav2.yaml'}: its initial_pose (500, 0) lies off the map; ")


def test_topics_and_frames_are_wishes(office_messages: list[Message], tmp_path: Path) -> None:
    scans = [message for message in office_messages if message.topic == "/scan"]
    second = [Message("/robot1/front", m.type, m.definition, m.log_ns, m.data) for m in scans]
    log = write_mcap(tmp_path / "log.mcap", sorted([*office_messages, *second], key=lambda m: m.log_ns))
    params = tmp_path / "nav2.yaml"
    lines = ("scan_topic: front", "base_frame_id: robot_base", "odom_frame_id: odom", "global_frame_id: hall")
    params.write_text(amcl(*lines, head="robot1/amcl:\n  ros__parameters:\n"))
    trace = tmp_path / "trace.mcap"
    result = run_with(log, params, "--init", "/initialpose", "-o", trace)
    assert result.code == 0
    assert "lidar /robot1/front:" in result.err
    assert "base_frame_id 'robot_base' is not in the log" in result.err
    from tests.cli.support import messages

    poses = [message for message in messages(trace) if message.topic == "/mcl/pose"]
    assert decoded(poses[0]).header.frame_id == "hall"
    assert "lidar /scan:" in run_with(log, params, "--init", "/initialpose", "--scan", "/scan").err
    missing = run_with(log, params, "--init", "/initialpose", "--set", "scan_topic=rear")
    assert "no topic '/rear' in the log" in single_error(missing, 2)


def test_the_maps_topic_is_chosen(office_messages: list[Message], tmp_path: Path) -> None:
    empty = {
        "header": {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": "map"},
        "info": {
            "map_load_time": {"sec": 0, "nanosec": 0},
            "resolution": 0.5,
            "width": 1,
            "height": 1,
            "origin": {"position": {"x": 0.0, "y": 0.0, "z": 0.0}, "orientation": {"x": 0, "y": 0, "z": 0, "w": 1.0}},
        },
        "data": np.zeros(1, np.int8),
    }
    kind = "nav_msgs/msg/OccupancyGrid"
    maps = [made(topic, kind, empty) for topic in ("/map", "/old/map")]
    log = write_mcap(tmp_path / "log.mcap", [*maps, *office_messages])
    params = tmp_path / "nav2.yaml"
    params.write_text(amcl("map_topic: old/map"))
    said = mcl("run", log, "--params", params, "--init", "/initialpose").err
    assert "map: from the log's topic /old/map" in said
    assert "map: from the log's topic /map" in mcl("run", log, "--init", "/initialpose").err


def test_score_takes_a_robots_file(short: Path, tmp_path: Path) -> None:
    (tmp_path / "nav2.yaml").write_text(amcl("laser_model_type: likelihood_field_prob", "max_beams: 30"))
    words = ("--map", OFFICE_MAP, "--pose", "-7.45,1.62,-1.48")
    result = mcl("score", short, *words, "--params", tmp_path / "nav2.yaml")
    same = mcl("score", short, *words, "--profile", "nav2", "--model", "likelihood_field_prob", "--set", "max_beams=30")
    assert (result.code, result.out) == (0, same.out)
    said = single_error(mcl("score", short, *words, "--set", "base_frame_id=wheel"), 1)
    assert said.startswith("no transform from 'wheel' to 'laser'")


# Names that nobody has, and maps that are turned


@pytest.mark.parametrize("command", ["run", "score", "locate", "params"])
def test_wherever_params_is_lenient_is(command: str) -> None:
    shown = mcl(command, "--help").out.decode()
    assert ("--params" in shown, "--lenient" in shown) == (True, True)


def test_a_run_with_unknown_names_passed_over_is_that_without_them(short: Path, tmp_path: Path) -> None:
    lines = ("alpha1: 0.3", "set_initial_pose: true", "initial_pose: {x: -7.45, y: 1.62, yaw: -1.48}")
    (tmp_path / "plain.yaml").write_text(amcl(*lines))
    (tmp_path / "more.yaml").write_text(amcl(*lines, "alpha_1: 0.9", "kld_err: 0.5"))
    plain = run_with(short, tmp_path / "plain.yaml", "-o", "-")
    more = run_with(short, tmp_path / "more.yaml", "-o", "-", "--lenient")
    assert "passed over, as on the robot; neither nav2_amcl nor Beluga has: 'alpha_1', line 6" in more.err
    assert more.out.splitlines()[1:] == plain.out.splitlines()[1:]
    assert single_error(run_with(short, tmp_path / "more.yaml"), 2).endswith("as the robot does: --lenient")


def test_a_run_with_a_file_of_ros1_starts_at_its_pose(short: Path, tmp_path: Path) -> None:
    pose = "initial_pose_x: -7.45\ninitial_pose_y: 1.62\ninitial_pose_a: -1.48\n"
    (tmp_path / "amcl.yaml").write_text(f"odom_model_type: diff\nodom_alpha1: 0.2\n{pose}")
    result = run_with(short, tmp_path / "amcl.yaml")
    assert result.code == 0, result.err
    assert "-7.45,1.62,-1.48, with its covariance" in result.err


def test_a_turned_map_that_the_profile_does_not_turn_is_told(short: Path, tmp_path: Path) -> None:
    (tmp_path / OFFICE_MAP.with_suffix(".pgm").name).write_bytes(OFFICE_MAP.with_suffix(".pgm").read_bytes())
    text = OFFICE_MAP.read_text()
    (tmp_path / "map.yaml").write_text(text.replace("0.0]", "0.25]"))
    words = ("run", short, "--map", tmp_path / "map.yaml", "--init", "-7.45,1.62,-1.48", "--duration", 2)
    told = "the map's origin has a yaw of 0.25 rad, which profile nav2 ignores"
    assert told in mcl(*words, "--profile", "nav2").err
    assert "yaw of" not in mcl(*words).err
    assert "yaw of" not in mcl(*words, "--profile", "nav2", "--set", "origin_yaw=use").err
