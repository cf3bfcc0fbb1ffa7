"""When a track was right and when it was not: convergence, losses, recoveries."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.errors import UsageError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from mclcli.arrays import BoolArray
    from mclcli.evaluate.association import Pairs
    from mclcli.evaluate.metrics import PoseErrors

_DEGREE = np.pi / 180.0


@final
@dataclass(frozen=True, slots=True)
class Rule:
    """A state of errors that holds: bounds of translation [m] and yaw [rad], for ``seconds`` and ``poses`` at least.

    What holds is either *inside* (both errors below the bounds) or *beyond* (one of them above).
    """

    translation: float
    yaw: float
    seconds: float
    poses: int = 3

    def inside(self, errors: PoseErrors) -> BoolArray:
        """Whether each pose has both errors below the bounds."""
        return (errors.translation < self.translation) & (np.abs(errors.yaw) < self.yaw)

    def beyond(self, errors: PoseErrors) -> BoolArray:
        """Whether each pose has an error above its bound."""
        return (errors.translation > self.translation) | (np.abs(errors.yaw) > self.yaw)


CONVERGED = Rule(translation=0.5, yaw=10 * _DEGREE, seconds=10.0)
LOST = Rule(translation=1.0, yaw=30 * _DEGREE, seconds=2.0)
APART = Rule(translation=0.5, yaw=10 * _DEGREE, seconds=2.0)


@final
@dataclass(frozen=True, slots=True)
class Loss:
    """A stretch without a usable pose: from ``start_ns`` to ``end_ns``, None if it lasts to the end of the track.

    ``largest`` is the greatest translation error in it [m]. ``from_start``: the track had never been right before.
    """

    start_ns: int
    end_ns: int | None
    largest: float
    from_start: bool = False


def convergence(pairs: Pairs, errors: PoseErrors, rule: Rule = CONVERGED) -> float | None:
    """Seconds from the first compared pose to the first from which the rule holds; None if it never does."""
    run = next(_held(rule.inside(errors), pairs, rule), None)
    return None if run is None else float(pairs.seconds[run.start])


def losses(pairs: Pairs, errors: PoseErrors, rule: Rule = LOST, back: Rule = CONVERGED) -> list[Loss]:
    """Every loss, in order of time.

    A track is lost from the first pose of a stretch that is beyond ``rule`` for as long as it demands, and found
    again at the first pose of a stretch inside the bounds of ``back`` that lasts as long as ``rule`` demands; what
    happens in between is the same loss. A track whose first pose is beyond ``rule`` starts lost.

    Raises
    ------
    UsageError
        If a pose could be lost by ``rule`` and right by ``back`` at once.

    """
    if back.translation > rule.translation or back.yaw > rule.yaw:
        raise UsageError("the bounds of a loss (--lost) must not be tighter than those of convergence (--converged)")
    beyond, inside = rule.beyond(errors), back.inside(errors)
    starts = [run.start for run in _held(beyond, pairs, rule)]
    returns = [run.start for run in _held(inside, pairs, rule)]
    if beyond[0] and (not starts or starts[0] != 0):
        starts.insert(0, 0)
    found: list[Loss] = []
    end = 0
    for start in starts:
        if start < end:
            continue
        end = next((i for i in returns if i >= start), errors.stamps_ns.size)
        found.append(_loss(errors, start, end, from_start=start == 0))
    return found


def stretches(pairs: Pairs, errors: PoseErrors, rule: Rule = APART) -> list[Loss]:
    """Every stretch that is beyond the rule for as long as it demands; each ends at the first pose after it."""
    runs = _held(rule.beyond(errors), pairs, rule)
    return [_loss(errors, run.start, run.stop, from_start=run.start == 0) for run in runs]


def _loss(errors: PoseErrors, start: int, end: int, *, from_start: bool) -> Loss:
    stamps = errors.stamps_ns
    end_ns = int(stamps[end]) if end < stamps.size else None
    return Loss(int(stamps[start]), end_ns, float(errors.translation[start:end].max()), from_start)


def _held(holds: BoolArray, pairs: Pairs, rule: Rule) -> Iterator[slice]:
    """Longest stretches of pairs without a hole where something holds, that last as long as the rule demands."""
    breaks = np.flatnonzero((np.diff(holds) != 0) | (np.diff(pairs.pieces) != 0)) + 1
    edges = [0, *breaks.tolist(), holds.size]
    for start, stop in pairwise(edges):
        lasted_ns = int(pairs.stamps_ns[stop - 1] - pairs.stamps_ns[start])
        if holds[start] and stop - start >= rule.poses and lasted_ns >= round(rule.seconds * 1e9):
            yield slice(start, stop)
