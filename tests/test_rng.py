"""Random streams: repeatable, apart from each other, with fixed numbers."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from mclcli.rng import Purpose, stream


def test_the_same_key_gives_the_same_bytes() -> None:
    assert stream(7, Purpose.MOTION, 3).bytes(64) == stream(7, Purpose.MOTION, 3).bytes(64)


@pytest.mark.parametrize("seed", [0, 7, 2**53 + 1, 2**64 - 1])
def test_it_is_philox_with_this_key_and_counter(seed: int) -> None:
    key, counter = np.array([seed, 2], np.uint64), np.array([0, 0, 0, 9], np.uint64)
    philox = np.random.Philox(key=key, counter=counter)
    assert stream(seed, Purpose.MOTION, 9).bytes(64) == np.random.Generator(philox).bytes(64)


def test_seed_purpose_and_step_each_open_another_stream() -> None:
    keys = product((0, 1), (Purpose.MOTION, Purpose.RESAMPLE), (0, 1))
    assert len({stream(*key).bytes(32) for key in keys}) == 8


def test_the_purpose_numbers_are_part_of_every_output() -> None:
    numbers = {"INITIALISE": 1, "MOTION": 2, "RESAMPLE": 3, "RECOVERY": 4, "KLD": 5, "SCATTER": 6}
    assert {purpose.name: purpose.value for purpose in Purpose}.items() >= numbers.items()


def test_one_step_never_reaches_the_next_ones_numbers() -> None:
    long, following = stream(0, Purpose.MOTION, 0).random(40_000), stream(0, Purpose.MOTION, 1).random(8)
    assert not np.isin(following, long).any()
