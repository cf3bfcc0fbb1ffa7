"""A few of very many messages, evenly spread."""

from __future__ import annotations

import itertools

import pytest

from mclcli.io.recording.samples import EvenSample


def sampled(count: int, length: int, most: int) -> EvenSample[int]:
    sample: EvenSample[int] = EvenSample(length, most)
    for item in range(count):
        if sample.wants():
            sample.keep(item)
    return sample


@pytest.mark.parametrize("count", [0, 1, 5, 24, 25, 100, 1000, 9999])
@pytest.mark.parametrize(("length", "most"), [(1, 8), (3, 8), (3, 5)])
def test_runs_follow_each_other_and_are_evenly_spread(count: int, length: int, most: int) -> None:
    sample = sampled(count, length, most)
    assert sample.seen == count
    assert len(sample.runs) <= most
    for run in sample.runs:
        assert run == list(range(run[0], run[0] + len(run)))
    whole = [run for run in sample.runs if len(run) == length]
    assert len(whole) >= len(sample.runs) - 1
    gaps = {second[0] - first[0] for first, second in itertools.pairwise(sample.runs)}
    assert len(gaps) <= 1
    if count >= length * most:
        assert len(sample.runs) >= most // 2
        assert sample.runs[-1][0] >= count - 2 * gaps.pop()


def test_all_is_kept_of_few() -> None:
    assert sampled(24, 3, 8).items == list(range(24))
