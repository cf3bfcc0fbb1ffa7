"""Names that no amcl has, and files that are another localizer's."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from mclcli import load_settings
from mclcli.errors import UsageError
from mclcli.settings.robots.reading import FileParameters, load
from tests.settings.robots.robots import amcl, read

if TYPE_CHECKING:
    from pathlib import Path

EVERYONE = "/**:\n  ros__parameters:\n"
CONTROLLER = "controller_server:\n  ros__parameters: {controller_frequency: 20.0}\n"
STRANGE = ("sigma_hit: 0.17", "kld_err: 0.05", "initial_pose: {x: 1.0, a: 0.5}", "sigma_hitt: 0.3", "qqq: 1")
TOLD = (
    "'kld_err', line 4 (ROS 1's name of pf_err), 'initial_pose.a', line 5 (the yaw is initial_pose.yaw), "
    "'sigma_hitt', line 6 (did you mean 'sigma_hit'?), 'qqq', line 7"
)
# As the packages have them, in part.
EMCL2 = ("odom_freq: 20", "odom_frame_id: odom", "laser_max_range: 100.0", "num_particles: 500", "sensor_reset: false")
NDT = ("alpha1: 0.002", "max_beams: 10000", "set_initial_pose: true", "d1: 1.0", "d2: 0.6", "minimum_likelihood: 0.01")


def lenient(folder: Path, text: str) -> FileParameters:
    """What a file says when unknown names are passed over."""
    (folder / "robot.yaml").write_text(text)
    return load(folder / "robot.yaml", lenient=True)


def refused(folder: Path, text: str) -> str:
    """The line that refuses a file."""
    with pytest.raises(UsageError) as caught:
        read(folder, text)
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("head", ["amcl:\n  ros__parameters:\n", EVERYONE, "/robot/amcl:\n  ros__parameters:\n"])
def test_all_unknown_names_are_told_at_once(tmp_path: Path, head: str) -> None:
    said = refused(tmp_path, amcl(*STRANGE, head=head))
    assert said.endswith(f"{TOLD}; correct them, or pass over them as the robot does: --lenient")


@pytest.mark.parametrize("head", ["amcl:\n  ros__parameters:\n", EVERYONE])
def test_they_can_be_passed_over_as_the_robot_does(tmp_path: Path, head: str) -> None:
    file = lenient(tmp_path, amcl(*STRANGE, head=head))
    assert file.values == {"sigma_hit": 0.17}
    (warning,) = file.warnings
    assert warning.endswith(TOLD)
    assert load_settings(tmp_path / "robot.yaml", lenient=True).lidars["likelihood_field"].sigma_hit == 0.17


def test_a_value_that_does_not_fit_is_no_unknown_name(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="alpha1 = 'x', line 3: must be a number"):
        lenient(tmp_path, amcl("alpha1: x"))


@pytest.mark.parametrize("others", [amcl("z_hit: 0.6"), CONTROLLER])
def test_in_a_block_for_all_nodes_a_name_may_be_another_nodes(tmp_path: Path, others: str) -> None:
    file = read(tmp_path, amcl("alpha1: 0.1", "robot_radius: 0.2", "alpha_2: 0.3", head=EVERYONE) + others)
    assert file.values["alpha1"] == 0.1
    assert file.remarks[1].endswith("not used: robot_radius (not amcl's)")
    (warning,) = file.warnings
    assert warning.endswith("not amcl's, given to all nodes: 'alpha_2', line 5 (did you mean 'alpha2'?)")


def test_names_that_many_nodes_have_do_not_make_a_file_amcls(tmp_path: Path) -> None:
    text = amcl("odom_frame_id: odom", "scan_topic: scan", "debug: true", "map_size: 3", head=EVERYONE)
    assert "no block for amcl; it holds **" in refused(tmp_path, text)


@pytest.mark.parametrize(("lines", "whose"), [(EMCL2, "emcl2"), (NDT, "Beluga's NDT localizer")])
@pytest.mark.parametrize("head", ["amcl:\n  ros__parameters:\n", EVERYONE])
def test_another_localizers_file_is_called_what_it_is(
    tmp_path: Path, lines: tuple[str, ...], whose: str, head: str
) -> None:
    text = amcl(*lines, head=head)
    assert f"parameters of {whose}, which mcl does not read" in refused(tmp_path, text)
    with pytest.raises(UsageError, match="which mcl does not read"):
        lenient(tmp_path, text)


@pytest.mark.parametrize(("node", "whose"), [("emcl2", "emcl2"), ("robot1/ndt_amcl", "Beluga's NDT localizer")])
def test_another_localizers_node_is_known_by_its_name(tmp_path: Path, node: str, whose: str) -> None:
    text = amcl("odom_frame_id: odom", head=f"{node}:\n  ros__parameters:\n")
    assert f"parameters of {whose}, which" in refused(tmp_path, text)
    assert read(tmp_path, text + amcl("alpha1: 0.3")).values == {"alpha1": 0.3}


def test_mcls_own_names_are_told_at_once_too(tmp_path: Path) -> None:
    text = "sigma_hit: 0.1\nsigma_hitt: 0.2\nalpha_1: 0.2\n"
    said = refused(tmp_path, text)
    assert "mcl has no parameter: 'sigma_hitt', line 2 (did you mean 'sigma_hit'?), 'alpha_1', line 3 (" in said
    file = lenient(tmp_path, text)
    assert (file.values, len(file.warnings)) == ({"sigma_hit": 0.1}, 1)
    assert "mcl has no parameter: 'alpha_1', line 3" in refused(
        tmp_path,
        amcl("alpha1: 0.1", head="amcl:\n  ros__parameters:\n").replace("amcl", "mcl").replace("a1", "a_1")
        + amcl("alpha1: 0.2"),
    )


def test_below_0_every_scan_is_an_update_as_on_the_robot(tmp_path: Path) -> None:
    assert read(tmp_path, amcl("update_min_d: -0.1", "update_min_a: -1.0")).values == {
        "update_min_d": -0.1,
        "update_min_a": -1.0,
    }
