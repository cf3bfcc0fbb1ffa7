"""Odometry between its samples: interpolated, never extrapolated."""

from __future__ import annotations

import numpy as np
import pytest

from mclcli.geometry import se2
from mclcli.motion.odometry import OdometryPath


def path_of(*stamps: int) -> OdometryPath:
    path = OdometryPath()
    for stamp in stamps:
        assert path.append(stamp, np.array([stamp / 100, 0.0, 0.0]))
    return path


def test_a_sample_is_given_back_as_it_came() -> None:
    path = OdometryPath()
    pose = np.array([0.1, 0.2, 0.3])
    path.append(5, np.zeros(3))
    path.append(10, pose)
    assert path.at(10).tobytes() == pose.tobytes()
    assert path.at(5).tolist() == [0.0, 0.0, 0.0]


def test_between_samples_the_twist_is_constant() -> None:
    path = OdometryPath()
    start, end = np.array([1.0, 2.0, 3.0]), np.array([1.5, 2.5, -2.9])
    path.append(0, start)
    path.append(1000, end)
    np.testing.assert_allclose(path.at(250), se2.interpolate(start, end, 0.25), atol=1e-12)
    assert abs(path.at(500)[2]) > 3.0  # the short way, across ±π


@pytest.mark.parametrize("stamp", [20, 19, 0])
def test_what_is_not_newer_is_left_out(stamp: int) -> None:
    path = path_of(10, 20)
    assert not path.append(stamp, np.array([9.0, 9.0, 9.0]))
    assert path.last_ns == 20
    assert path.at(20)[0] == 0.2


def test_the_span() -> None:
    empty, path = OdometryPath(), path_of(10, 20)
    assert [path.covers(t) for t in (9, 10, 15, 20, 21)] == [False, True, True, True, False]
    assert [path.ends_after(t) for t in (19, 20)] == [True, False]
    assert (empty.last_ns, empty.covers(0), empty.ends_after(0)) == (None, False, False)


def test_forgetting_keeps_what_later_stamps_need() -> None:
    path = path_of(*range(0, 1000, 100))
    path.forget_before(450)
    assert path.at(450)[0] == pytest.approx(4.5)
    assert not path.covers(399)
    path.forget_before(10_000)
    assert path.at(900)[0] == 9.0


def test_large_stamps_lose_no_nanosecond() -> None:
    epoch = 1_700_000_000_000_000_000
    path = OdometryPath()
    path.append(epoch, np.zeros(3))
    path.append(epoch + 1_000_000, np.array([1.0, 0.0, 0.0]))
    assert path.at(epoch + 1)[0] == pytest.approx(1e-6, rel=1e-9)
