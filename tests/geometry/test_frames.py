"""The tree of frames: chains, time, what never moves, and what is not known."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest

from mclcli.geometry import se3
from mclcli.geometry.frames import TransformTree
from tests.support import SECOND, transform

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray


def at(x: float, y: float = 0.0, yaw: float = 0.0) -> FloatArray:
    return se3.from_planar([x, y, yaw])


def tree_of(*edges: tuple[float, str, str, FloatArray, bool], keep_history: bool = True) -> TransformTree:
    tree = TransformTree(keep_history=keep_history)
    for seconds, parent, child, matrix, static in edges:
        tree.add(transform(int(seconds * SECOND), parent, child, matrix, static=static))
    return tree


ROBOT = (
    (0.0, "base_link", "laser", se3.from_rpy([0.2, 0.0, 0.3], math.pi, 0.0, 0.5), True),
    (0.0, "base_link", "mast", at(0.0, 0.1, 1.0), True),
    (0.0, "mast", "camera", at(0.3, 0.0, -0.2), True),
    (1.0, "odom", "base_link", at(1.0, 0.0, 0.0), False),
    (3.0, "odom", "base_link", at(3.0, 0.0, 1.0), False),
)


def known(matrix: FloatArray | None) -> FloatArray:
    assert matrix is not None
    return matrix


def test_chains_are_multiplied_in_order() -> None:
    tree = tree_of(*ROBOT)
    np.testing.assert_allclose(known(tree.lookup("base_link", "camera", 0)), at(0, 0.1, 1.0) @ at(0.3, 0, -0.2))
    laser_from_camera = known(tree.lookup("laser", "camera", 0))
    expected = se3.inverse(ROBOT[0][3]) @ at(0, 0.1, 1.0) @ at(0.3, 0, -0.2)
    np.testing.assert_allclose(laser_from_camera, expected, atol=1e-12)
    np.testing.assert_allclose(se3.inverse(laser_from_camera), known(tree.lookup("camera", "laser", 0)), atol=1e-12)


def test_a_frame_is_at_home_in_itself() -> None:
    assert known(tree_of(*ROBOT).lookup("laser", "laser", 99)).tolist() == np.eye(4).tolist()
    assert known(TransformTree().lookup("anything", "anything", 0)).tolist() == np.eye(4).tolist()


def test_what_moves_is_interpolated() -> None:
    tree = tree_of(*ROBOT)
    middle = known(tree.lookup("odom", "base_link", 2 * SECOND))
    np.testing.assert_allclose(se3.to_planar(middle), [2.0, 0.0, 0.5], atol=1e-12)
    np.testing.assert_array_equal(known(tree.lookup("odom", "base_link", 3 * SECOND)), at(3.0, 0.0, 1.0))


@pytest.mark.parametrize("stamp", [SECOND - 1, 3 * SECOND + 1])
def test_what_moves_is_never_extrapolated(stamp: int) -> None:
    tree = tree_of(*ROBOT)
    assert tree.lookup("odom", "base_link", stamp) is None
    assert tree.lookup("odom", "laser", stamp) is None
    assert tree.lookup("base_link", "laser", stamp) is not None


def test_what_is_never_seen_to_move_holds_for_the_whole_log() -> None:
    tree = tree_of((5.0, "base", "laser", at(0.1), False), (6.0, "base", "laser", at(0.1), False))
    assert not tree.moves("laser")
    np.testing.assert_array_equal(known(tree.lookup("base", "laser", 0)), at(0.1))


def test_no_path_is_no_transform() -> None:
    tree = tree_of(*ROBOT, (0.0, "elsewhere", "thing", at(1.0), True))
    assert tree.lookup("base_link", "thing", 0) is None
    assert tree.lookup("base_link", "nowhere", 0) is None
    assert not tree.connected("base_link", "thing")
    assert tree.connected("laser", "camera")


def test_the_latest_parent_and_the_latest_static_value_count() -> None:
    tree = tree_of((0.0, "a", "laser", at(1.0), True), (0.0, "a", "laser", at(2.0), True))
    np.testing.assert_array_equal(known(tree.lookup("a", "laser", 0)), at(2.0))
    tree.add(transform(0, "b", "laser", at(3.0), static=True))
    assert tree.parent("laser") == "b"
    assert tree.lookup("a", "laser", 0) is None


def test_samples_out_of_order_do_not_break_the_history() -> None:
    tree = tree_of(*ROBOT)
    tree.add(transform(2 * SECOND, "odom", "base_link", at(99.0), static=False))
    np.testing.assert_allclose(se3.to_planar(known(tree.lookup("odom", "base_link", 2 * SECOND))), [2.0, 0.0, 0.5])


def test_a_loop_of_frames_ends() -> None:
    tree = tree_of((0.0, "a", "b", at(1.0), True), (0.0, "b", "a", at(-1.0), True))
    assert set(tree.ancestors("a")) == {"a", "b"}
    assert tree.lookup("a", "nowhere", 0) is None


def test_names_and_what_moves() -> None:
    tree = tree_of(*ROBOT)
    assert tree.frames == ["base_link", "camera", "laser", "mast", "odom"]
    assert tree.ancestors("camera") == ["camera", "mast", "base_link", "odom"]
    assert [tree.moves(frame) for frame in ("base_link", "laser", "odom")] == [True, False, False]
    assert tree.moves_between("odom", "laser")
    assert not tree.moves_between("laser", "camera")


def test_the_latest_stamp_at_which_a_chain_is_known() -> None:
    tree = tree_of(
        (1.0, "odom", "footprint", at(0.0), False),
        (4.0, "odom", "footprint", at(1.0), False),
        (0.0, "footprint", "base", at(0.0), False),
        (3.0, "footprint", "base", at(0.1), False),
    )
    assert tree.latest_common("odom", "base") == 3 * SECOND
    assert tree_of(*ROBOT).latest_common("base_link", "laser") is None


def test_forgetting_keeps_what_later_stamps_need() -> None:
    tree = tree_of(*((float(t), "odom", "base", at(float(t)), False) for t in range(10)))
    tree.forget_before(int(4.5 * SECOND))
    assert known(tree.lookup("odom", "base", int(4.5 * SECOND)))[0, 3] == pytest.approx(4.5)
    assert tree.lookup("odom", "base", 3 * SECOND) is None


def test_reading_again_knows_statics_from_the_start_and_motion_not_yet() -> None:
    tree = tree_of(*ROBOT, keep_history=False).replayed()
    assert tree.lookup("base_link", "laser", 0) is not None
    assert tree.lookup("odom", "base_link", 2 * SECOND) is None
    assert tree.latest_common("odom", "base_link") is None
    for seconds, parent, child, matrix, static in ROBOT[3:]:
        tree.add(transform(int(seconds * SECOND), parent, child, matrix, static=static))
    assert known(tree.lookup("odom", "base_link", 2 * SECOND))[0, 3] == pytest.approx(2.0)


def test_reading_again_leaves_the_first_tree_as_it_was() -> None:
    survey = tree_of(*ROBOT, keep_history=False)
    survey.replayed().add(transform(0, "base_link", "laser", at(7.0), static=True))
    np.testing.assert_array_equal(known(survey.lookup("base_link", "laser", 0)), ROBOT[0][3])


@pytest.mark.parametrize(("by", "moves"), [(0.0, False), (1e-7, False), (-9e-5, False), (2e-4, True), (-1.0, True)])
@pytest.mark.parametrize("what", ["metres", "radians"])
def test_a_transform_that_trembles_by_less_than_0_1_mm_is_fixed(by: float, what: str, *, moves: bool) -> None:
    again = at(0.1 + by, 0.0, 0.0) if what == "metres" else at(0.1, 0.0, by)
    tree = tree_of((1.0, "base", "laser", at(0.1), False), (2.0, "base", "laser", again, False))
    assert tree.moves("laser") is moves
    assert (tree.lookup("base", "laser", 0) is None) is moves  # before the first stamp only what never moves is known


def test_a_transform_that_creeps_moves() -> None:
    """No step is more than a tremble; all of them are."""
    steps = ((float(i), "base", "laser", at(0.1 + 4e-5 * i), False) for i in range(5))
    assert tree_of(*steps).moves("laser")


def contested_tree() -> TransformTree:
    """Two nodes state where the base is, below different parents, by turns; what each states moves."""
    tree = TransformTree(keep_history=False)
    for i in range(4):
        tree.add(transform(2 * i * SECOND, "odom", "base_link", at(float(i))))
        tree.add(transform((2 * i + 1) * SECOND, "odom_combined", "base_link", at(10.0 + i)))
    return tree


def test_two_parents_by_turns_are_told_and_one_can_be_chosen() -> None:
    tree = contested_tree()
    assert tree.contested == {"base_link": ["odom", "odom_combined"]}
    tree.choose_parent("base_link", "odom")
    assert tree.ancestors("base_link") == ["base_link", "odom"]
    assert tree.moves("base_link")
    again = tree.replayed()
    for seconds, parent, x in ((0, "odom", 0.0), (1, "odom_combined", 10.0), (2, "odom", 1.0)):
        again.add(transform(seconds * SECOND, parent, "base_link", at(x)))
    assert known(again.lookup("odom", "base_link", SECOND))[0, 3] == pytest.approx(0.5)


def test_a_frame_that_is_moved_to_another_parent_once_is_not_contested() -> None:
    tree = tree_of((0.0, "a", "laser", at(1.0), False), (1.0, "b", "laser", at(2.0), False))
    assert tree.contested == {}
    assert tree.parent("laser") == "b"


def test_a_union_prefers_the_earlier_tree_and_knows_what_moves() -> None:
    own = tree_of((0.0, "base_link", "laser", at(1.0), True), keep_history=False)
    other = tree_of(
        (0.0, "base_link", "laser", at(2.0), True),
        (0.0, "odom", "base_link", at(0.0), False),
        (1.0, "odom", "base_link", at(1.0), False),
        keep_history=False,
    )
    both = TransformTree.union([own, other])
    np.testing.assert_array_equal(known(both.lookup("base_link", "laser", 0)), at(1.0))
    assert both.moves("base_link")
    np.testing.assert_array_equal(known(both.nominal("odom", "laser")), at(1.0))
