"""Files of ROS 1's amcl: YAML for rosparam and roslaunch files, and that they mean what they mean there."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import pytest
from hypothesis import HealthCheck, given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st

from mclcli import load_settings
from mclcli.errors import InputError, MclError, UsageError
from mclcli.settings.robots import names, ros1
from mclcli.settings.robots.reading import FileParameters, load, settings_of
from mclcli.settings.robots.writing import to_nav2

if TYPE_CHECKING:
    import random
    from pathlib import Path

GIVEN = {
    "odom_model_type": "diff-corrected",
    "odom_alpha1": 0.15,
    "laser_max_beams": 40,
    "laser_z_hit": 0.9,
    "laser_sigma_hit": 0.17,
    "kld_err": 0.02,
    "max_particles": 1500,
    "gui_publish_rate": 5.0,
}
PARAMS = "".join(f'<param name="{name}" value="{value}"/>' for name, value in GIVEN.items())
LAUNCH = """\
<?xml version="1.0"?>
<launch>
  <arg name="use_map_topic" default="false"/>
  <arg name="prefix" default="robot"/>
  <arg name="base" default="$(arg prefix)_base"/>
  <param name="robot_description" command="$(find xacro)/xacro robot.xacro"/>
  <node pkg="map_server" type="map_server" name="map_server" args="$(find maps)/map.yaml"/>
  <group ns="$(arg prefix)">
    <rosparam ns="amcl">{odom_alpha1: 0.1, odom_alpha2: 0.3}</rosparam>
    <node pkg="amcl" type="amcl" name="amcl" output="screen">
      <param name="odom_model_type" value="omni"/>
      <param name="base_frame_id" value="$(arg base)"/>
      <param name="use_map_topic" value="$(arg use_map_topic)"/>
      <param name="odom_alpha1" value="0.25"/>
      <param name="laser_max_beams" value="50" if="$(arg use_map_topic)"/>
      <param name="laser_max_beams" value="60" unless="$(arg use_map_topic)"/>
      <rosparam>
        laser_z_hit: 0.7
        min_particles: 200
      </rosparam>
      <remap from="scan" to="/front/scan"/>
    </node>
  </group>
</launch>
"""


TWO = """<launch>
  <node pkg="amcl" type="amcl" name="a"><param name="kld_z" value="2.0"/></node>
  <node pkg="amcl" type="amcl" name="b"/>
</launch>"""


def yaml(**more: object) -> str:
    """A flat file."""
    return "".join(f"{name}: {value}\n" for name, value in {**GIVEN, **more}.items())


def node(*lines: str) -> str:
    """A launch file that starts amcl with these elements."""
    return f'<launch><node pkg="amcl" type="amcl" name="amcl">{"".join(lines)}</node></launch>'


def read(folder: Path, text: str, *, lenient: bool = False) -> FileParameters:
    """What a file of this text says."""
    (folder / "amcl.launch").write_text(text)
    return load(folder / "amcl.launch", lenient=lenient)


def test_the_table_leads_to_rows_that_exist() -> None:
    assert len(ros1.ROWS) == len(ros1.TABLE)
    for row in ros1.TABLE:
        assert row.nav2 in names.NAMES or (not row.nav2 and row.note)
        if row.nav2 and row.name != "odom_model_type":
            assert type(row.default) is names.NAMES[row.nav2].kind


@pytest.mark.parametrize(
    "text",
    [
        yaml(),
        "amcl:\n" + "".join(f"  {line}\n" for line in yaml().splitlines()),
        node(PARAMS),
        node(f"<rosparam>\n{yaml()}</rosparam>"),
        f'<launch><rosparam ns="amcl">\n{yaml()}</rosparam>{node().removeprefix("<launch>")}',
    ],
)
def test_every_form_says_the_same(tmp_path: Path, text: str) -> None:
    file = read(tmp_path, text)
    assert (file.dialect, file.profile, file.model, file.start) == ("ROS 1's amcl", "nav2", "likelihood_field", None)
    values = settings_of(file, {}).values()
    assert {
        name: values[name] for name in ("alpha1", "max_beams", "z_hit", "sigma_hit", "pf_err", "max_particles")
    } == {
        "alpha1": 0.15,
        "max_beams": 40,
        "z_hit": 0.9,
        "sigma_hit": 0.17,
        "pf_err": 0.02,
        "max_particles": 1500,
    }
    assert "gui_publish_rate (no part in a replay)" in file.remarks[1]


def test_where_the_file_is_silent_ros1s_defaults_count(tmp_path: Path) -> None:
    (tmp_path / "amcl.yaml").write_text("odom_alpha1: 0.15\n")
    settings = load_settings(tmp_path / "amcl.yaml")
    values = settings.values()
    expected: dict[str, names.Value] = {
        "alpha1": 0.15,
        "alpha2": 0.2,
        "max_beams": 30,
        "laser_max_range": -1.0,
        "z_hit": 0.95,
        "z_rand": 0.05,
    }
    expected |= {"min_particles": 100, "max_particles": 5000, "pf_err": 0.01, "pf_z": 0.99, "kld_quantile": "z"}
    expected |= {"resample_interval": 2, "resample_ess": 1.0, "update_min_d": 0.2, "update_min_a": math.pi / 6}
    expected |= {"recovery": "uniform", "recovery_alpha_slow": 0.001, "recovery_alpha_fast": 0.1}
    expected |= {"robot_model_type": "differential", "noise_expression": "deviation", "noise_scaling": "step"}
    expected |= {"base_frame_id": "", "odom_frame_id": "", "turn_noise": "folded"}
    assert {name: values[name] for name in expected} == expected


@pytest.mark.parametrize(
    ("word", "model", "expression"),
    [
        ("diff", "differential", "deviation"),
        ("omni", "omnidirectional", "deviation"),
        ("diff-corrected", "differential", "variance"),
        ("omni-corrected", "omnidirectional", "variance"),
    ],
)
def test_the_four_motion_models(tmp_path: Path, word: str, model: str, expression: str) -> None:
    file = read(tmp_path, yaml(odom_model_type=word))
    assert (file.values["robot_model_type"], file.values["noise_expression"]) == (model, expression)
    assert ("standard deviation" in file.remarks[-1]) == (expression == "deviation")


def test_a_pose_in_the_file_is_where_the_filter_starts(tmp_path: Path) -> None:
    start = read(tmp_path, yaml(initial_pose_x=1, initial_pose_a=0.5, initial_cov_aa=0.06)).start
    assert start is not None
    assert start.pose.tolist() == [1.0, 0.0, 0.5]
    assert start.covariance.diagonal().tolist() == [0.25, 0.25, 0.06]


def test_as_ros1_does_a_pose_that_is_no_number_is_passed_over_and_frames_have_no_slash(tmp_path: Path) -> None:
    file = read(tmp_path, yaml(initial_pose_x=".nan", initial_pose_y=2.0, base_frame_id="/base"))
    assert file.start is not None
    assert file.start.pose.tolist() == [0.0, 2.0, 0.0]
    assert file.values["base_frame_id"] == "base"


def test_of_a_dump_of_all_parameters_amcls_are_taken(tmp_path: Path) -> None:
    others = "move_base: {plugins: [{name: a}]}\nrosdistro: 'noetic\n\n  '\nrun_id: 1-x\n"
    file = read(tmp_path, others + "robot:\n  amcl: {kld_err: 0.02, gui_publish_rate: 1.0}\n")
    assert (file.namespace, file.values["pf_err"]) == ("/robot", 0.02)


def test_a_launch_file_is_read_as_roslaunch_reads_it(tmp_path: Path) -> None:
    file = read(tmp_path, LAUNCH)
    assert file.namespace == "/robot"
    expected: dict[str, names.Value] = {
        "alpha1": 0.25,
        "alpha2": 0.3,
        "max_beams": 60,
        "z_hit": 0.7,
        "min_particles": 200,
    }
    expected |= {"robot_model_type": "omnidirectional", "noise_expression": "deviation", "base_frame_id": "robot_base"}
    expected |= {"scan_topic": "/front/scan"}
    assert {name: file.values[name] for name in expected} == expected
    assert {"scan_topic", "base_frame_id"} <= file.tentative


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (yaml(laser_z_hitt=0.1, sigma_hit=0.2, qqq=1), "'laser_z_hitt', line 9 (did you mean 'laser_z_hit'?), "),
        (yaml(laser_z_hitt=0.1, sigma_hit=0.2, qqq=1), "'sigma_hit', line 10 (nav2_amcl's name of laser_sigma_hit)"),
        (yaml(odom_model_type="dif"), "odom_model_type = 'dif', line 1: not known; did you mean 'diff'?"),
        (yaml(odom_alpha2="x"), "odom_alpha2 = 'x', line 9: must be a number"),
        (node('<param name="odom_alpha1" value="1e-3"/>'), "odom_alpha1 = '1e-3', line 1: must be a number"),
        (
            node('<rosparam file="$(find x)/a.yaml" command="load"/>'),
            "only roslaunch can find the file $(find x)/a.yaml",
        ),
        (
            node('<param name="odom_alpha1" value="$(arg a)"/>'),
            "only roslaunch can find odom_alpha1 = $(arg a), line 1",
        ),
        (
            node('<param name="odom_alpha1" value="$(env A)"/>'),
            "only roslaunch can find odom_alpha1 = $(env A), line 1",
        ),
        (
            '<launch><group if="$(eval 1)"><node pkg="amcl" type="amcl" name="a"/></group></launch>',
            "if=$(eval 1), line 1",
        ),
        ("a: {amcl: {kld_err: 0.1}}\nb: {amcl: {pf_err: 0.2}}\n", "for several robots, differently: /a/amcl, /b/amcl"),
        (
            yaml(execution_policy="seq", map_service="m"),
            "parameters of Beluga's amcl for ROS 1, which mcl does not read",
        ),
        ("<launch><include file='x'/></launch>", "a launch file that starts no amcl of ROS 1; it includes x; name"),
        ('<launch><node pkg="amcl" type="set_pose.py" name="a"/></launch>', "that starts no amcl of ROS 1; name"),
        ('<launch><node pkg="emcl" type="emcl_node" name="a"/></launch>', "starts emcl2, which mcl does not read"),
        ("<robot/>", "XML, but no launch file (<robot>)"),
        ('<launch>\n<node pkg="nav2_amcl" exec="amcl" name="amcl"/></launch>', "a launch file of ROS 2, line 2"),
        (TWO, "amcl stands there for several robots, differently: /a, /b"),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(UsageError) as caught:
        read(tmp_path, text)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "text",
    [
        yaml(qqq=1),
        node(PARAMS, '<rosparam file="$(find x)/a.yaml" command="load"/>'),
        node(PARAMS, '<param name="odom_alpha5" value="$(arg a)"/>'),
        node(PARAMS, '<param name="qqq" value="1"/>'),
    ],
)
def test_what_cannot_be_read_can_be_passed_over(tmp_path: Path, text: str) -> None:
    file = read(tmp_path, text, lenient=True)
    assert file.values["z_hit"] == 0.9
    assert len(file.warnings) == 1


def test_where_the_robot_starts_and_its_frames_may_be_left_to_the_command_line(tmp_path: Path) -> None:
    lines = "".join(f'<param name="{name}" value="$(arg x)"/>' for name in ("initial_pose_x", "odom_frame_id"))
    file = read(tmp_path, node(PARAMS, lines, '<param name="initial_pose_y" value="2.0"/>'))
    assert file.start is None  # half a pose is none
    assert "odom_frame_id" not in file.values
    (warning,) = file.warnings
    assert "only roslaunch can find initial_pose_x = $(arg x), line 1, odom_frame_id = $(arg x), line 1" in warning


def test_a_name_that_only_roslaunch_can_find_is_amcl(tmp_path: Path) -> None:
    text = node(PARAMS).replace('name="amcl"', 'name="$(arg robot)_amcl"')
    assert read(tmp_path, text).values["z_hit"] == 0.9


def test_a_whole_number_may_be_written_as_a_real_one(tmp_path: Path) -> None:
    assert read(tmp_path, yaml(laser_max_beams=40.0)).values["max_beams"] == 40


BOMB = '<!DOCTYPE x [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;">]>\n' + node("<param name='kld_z' value='&b;'/>")
DOUBLING = "".join(f'<arg name="a{i + 1}" default="$(arg a{i})$(arg a{i})"/>' for i in range(60))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (BOMB, "a document type (<!DOCTYPE>), line 1"),
        ('<!DOCTYPE x SYSTEM "file:///etc/passwd">\n<launch/>', "a document type (<!DOCTYPE>), line 1"),
        ("<launch>&x;</launch>", "not XML that can be read"),
        ("<launch>" * 100, "nested deeper than 64"),
        ("<launch>\n<node>", "not XML that can be read: no element found, line 2"),
        (f"<launch>{' ' * 1024 * 1024}</launch>", "is longer than"),
        (node("<rosparam>a: [</rosparam>"), "within <rosparam>, line 1"),
    ],
)
def test_hostile_xml_is_refused(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(InputError) as caught:
        read(tmp_path, text)
    assert said in str(caught.value)


def test_arguments_that_grow_without_end_are_not_followed(tmp_path: Path) -> None:
    rest = node('<param name="kld_z" value="$(arg a60)"/>').removeprefix("<launch>")
    text = f'<launch><arg name="a0" default="x"/>{DOUBLING}{rest}'
    with pytest.raises(UsageError, match=r"only roslaunch can find kld_z = \$\(arg a60\)"):
        read(tmp_path, text)


@pytest.mark.parametrize("word", ["diff", "omni", "omni-corrected"])
def test_written_for_nav2_it_comes_back(tmp_path: Path, word: str) -> None:
    before = read(tmp_path, yaml(odom_model_type=word, initial_pose_x=1.0))
    settings = settings_of(before, {})
    path = tmp_path / "nav2.yaml"
    path.write_text(to_nav2(settings, before))
    after = load(path)
    assert settings_of(after, {}) == settings
    assert after.start is not None
    assert after.start.pose.tolist() == [1.0, 0.0, 0.0]


@given(st.sampled_from([LAUNCH, yaml()]), st.randoms(use_true_random=False))
@hypothesis_settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
def test_a_garbled_file_is_read_or_refused_in_one_line(tmp_path: Path, text: str, rng: random.Random) -> None:
    letters = list(text)
    for _ in range(rng.randint(1, 4)):
        at = rng.randrange(len(letters))
        letters[at : at + rng.randint(0, 9)] = rng.choices(
            "az09.:-_/*#&!|>{}[]'\"\n\t <>$()é\u202e\0", k=rng.randint(0, 3)
        )
    path = tmp_path / "amcl.launch"
    path.write_text("".join(letters), encoding="utf-8")
    try:
        said = f"{path}: {load_settings(path).profile}"
    except MclError as error:
        said = str(error)
    assert said.startswith(f"{path}")
    assert "\n" not in said
