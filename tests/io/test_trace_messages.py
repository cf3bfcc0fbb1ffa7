"""Clouds of a trace: rounded as stated, and to the same bits by NumPy and by compiled code."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest

from mclcli.io.traces import trace_messages
from tests.support import BACKENDS, each_backend

if TYPE_CHECKING:
    from mclcli.native.backend import Backend


@each_backend
def test_clouds_are_rounded_as_stated(backend: Backend) -> None:
    generator = np.random.default_rng(4)
    poses, weights = generator.normal([1.0, -2.0, 0.0], [100.0, 5.0, 2.0], (1300, 3)), generator.random(1300)
    rows, particles = trace_messages.rounded_clouds(poses, weights, backend)
    assert np.array_equal(rows, particles[:, :7])
    assert np.array_equal(particles[:, 7], weights)
    assert np.abs(rows[:, :2] - poses[:, :2]).max() <= 2.0**-21
    assert np.array_equal(np.rint(rows[:, :2] * 2.0**20), rows[:, :2] * 2.0**20)
    assert not rows[:, 2:5].any()
    wanted = [[math.sin(0.5 * yaw), math.cos(0.5 * yaw)] for yaw in poses[:, 2].tolist()]
    assert np.abs(rows[:, 5:] - wanted).max() <= 2.0**-25 + 2.0**-52
    assert np.array_equal(np.rint(rows[:, 5:] * 2.0**24), rows[:, 5:] * 2.0**24)


@pytest.mark.parametrize("size", [0, 1, 512, 1300])
def test_both_backends_give_the_same_bits(size: int) -> None:
    generator = np.random.default_rng(size)
    poses, weights = generator.normal(0.0, [1e3, 1.0, 2.0], (size, 3)), generator.random(size)
    one, other = (trace_messages.rounded_clouds(poses, weights, backend) for backend in BACKENDS)
    assert [part.tobytes() for part in one] == [part.tobytes() for part in other]
