"""Clouds of a trace: rounded as stated, and to the same bits by NumPy and by compiled code."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mclcli.io.traces import trace_messages
from mclcli.native import backend


@pytest.mark.parametrize("used", [False, True])
def test_clouds_are_rounded_as_stated(monkeypatch: pytest.MonkeyPatch, *, used: bool) -> None:
    monkeypatch.setattr(backend, "in_use", lambda: used)
    generator = np.random.default_rng(4)
    poses, weights = generator.normal([1.0, -2.0, 0.0], [100.0, 5.0, 2.0], (1300, 3)), generator.random(1300)
    rows, particles = trace_messages.rounded_clouds(poses, weights)
    assert np.array_equal(rows, particles[:, :7])
    assert np.array_equal(particles[:, 7], weights)
    assert np.abs(rows[:, :2] - poses[:, :2]).max() <= 2.0**-21
    assert np.array_equal(np.rint(rows[:, :2] * 2.0**20), rows[:, :2] * 2.0**20)
    assert not rows[:, 2:5].any()
    wanted = [[math.sin(0.5 * yaw), math.cos(0.5 * yaw)] for yaw in poses[:, 2].tolist()]
    assert np.abs(rows[:, 5:] - wanted).max() <= 2.0**-25 + 2.0**-52
    assert np.array_equal(np.rint(rows[:, 5:] * 2.0**24), rows[:, 5:] * 2.0**24)


@pytest.mark.parametrize("size", [0, 1, 512, 1300])
def test_both_ways_give_the_same_bits(monkeypatch: pytest.MonkeyPatch, size: int) -> None:
    generator = np.random.default_rng(size)
    poses, weights = generator.normal(0.0, [1e3, 1.0, 2.0], (size, 3)), generator.random(size)
    results = []
    for used in (False, True):
        monkeypatch.setattr(backend, "in_use", lambda used=used: used)
        results.append([part.tobytes() for part in trace_messages.rounded_clouds(poses, weights)])
    assert results[0] == results[1]
