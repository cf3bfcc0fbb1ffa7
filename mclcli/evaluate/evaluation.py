"""Everything there is to say about one track against a reference."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, final

import numpy as np

from mclcli.evaluate.association import Matching, Pairs, aligned, associate
from mclcli.evaluate.consistency import EXACT, Consistency, consistency
from mclcli.evaluate.events import CONVERGED, LOST, Loss, Rule, convergence, losses
from mclcli.evaluate.metrics import PoseErrors, Statistics, errors_of, relative_errors, share_within, statistics, way_of

if TYPE_CHECKING:
    from mclcli.geometry.trajectory import Trajectory

WITHIN = (0.05, 0.1, 0.2, 0.5)
_DEFAULT = Matching()


@final
@dataclass(frozen=True, slots=True)
class Protocol:
    """How an evaluation is made: association, alignment, and what counts as converged and as lost.

    ``truth_sd`` are the standard deviations of the reference [m], [rad].
    """

    matching: Matching = _DEFAULT
    align: bool = False
    converged: Rule = CONVERGED
    lost: Rule = LOST
    truth_sd: tuple[float, float] = EXACT


@final
@dataclass(frozen=True, slots=True, eq=False)
class Evaluation:
    """A track against a reference; statistics of yaw are of magnitudes [rad].

    ``rpe_*`` are None where no two poses are far enough apart, ``converged_after`` [s] where it never converged,
    ``consistency`` without covariances, ``motion`` (x, y, yaw) where nothing was aligned. ``within``: share
    of poses within so many metres. ``losses`` do not count the time before the robot was found first: ``found_after``
    [s] is that, 0 if it started right, None if it was never found.
    """

    name: str
    pairs: Pairs
    errors: PoseErrors
    translation: Statistics
    yaw: Statistics
    rpe_metre: Statistics | None
    rpe_metre_yaw: Statistics | None
    rpe_second: Statistics | None
    rpe_second_yaw: Statistics | None
    within: dict[float, float]
    converged_after: float | None
    found_after: float | None
    losses: tuple[Loss, ...]
    consistency: Consistency | None
    motion: tuple[float, float, float] | None

    @property
    def coverage(self) -> float:
        """Share of the track's poses that were compared."""
        return self.pairs.stamps_ns.size / self.pairs.total

    @property
    def recoveries(self) -> int:
        """How many losses ended."""
        return sum(loss.end_ns is not None for loss in self.losses)

    @property
    def duration(self) -> float:
        """Seconds from the first compared pose to the last."""
        return float(self.pairs.seconds[-1])

    @property
    def way(self) -> float:
        """Length of the reference's way over the compared poses [m]."""
        return float(way_of(self.pairs.expected)[-1])

    @property
    def lost_seconds(self) -> float:
        """Time in losses [s]."""
        last = int(self.pairs.stamps_ns[-1])
        return sum((loss.end_ns or last) - loss.start_ns for loss in self.losses) * 1e-9


def evaluate(track: Trajectory, reference: Trajectory, protocol: Protocol = Protocol(), name: str = "") -> Evaluation:
    """Evaluate a track against a reference.

    Raises
    ------
    InputError
        If the reference covers no pose of the track.
    UsageError
        If the protocol contradicts itself.

    """
    pairs, motion = associate(track, reference, protocol.matching), None
    if protocol.align:
        pairs, motion = aligned(pairs)
    errors = errors_of(pairs)
    lost = losses(pairs, errors, protocol.lost, protocol.converged)
    by_way, by_time = (relative_errors(pairs, per=per) for per in ("metre", "second"))
    translation, yaw = statistics(errors.translation), statistics(errors.yaw)
    assert translation is not None  # noqa: S101 - pairs are never empty
    assert yaw is not None  # noqa: S101
    return Evaluation(
        name=name,
        pairs=pairs,
        errors=errors,
        translation=translation,
        yaw=yaw,
        rpe_metre=statistics(by_way.translation),
        rpe_metre_yaw=statistics(by_way.yaw),
        rpe_second=statistics(by_time.translation),
        rpe_second_yaw=statistics(by_time.yaw),
        within={bound: share_within(errors.translation, bound) for bound in WITHIN},
        converged_after=convergence(pairs, errors, protocol.converged),
        found_after=_found_after(pairs, lost),
        losses=tuple(loss for loss in lost if not loss.from_start),
        consistency=consistency(pairs, protocol.truth_sd),
        motion=None if motion is None else (float(motion[0]), float(motion[1]), float(motion[2])),
    )


def _found_after(pairs: Pairs, lost: list[Loss]) -> float | None:
    if not lost or not lost[0].from_start:
        return 0.0
    end_ns = lost[0].end_ns
    return None if end_ns is None else (end_ns - int(pairs.stamps_ns[0])) * 1e-9


def as_plain(evaluation: Evaluation) -> dict[str, Any]:
    """An evaluation as JSON can hold it: metres, radians, seconds, absolute seconds for stamps, None for no value.

    Names of keys are part of the output of ``mcl eval --json``.
    """
    e = evaluation
    return {
        "track": e.name,
        "poses": e.pairs.total,
        "compared": e.pairs.stamps_ns.size,
        "coverage": e.coverage,
        "start": _seconds(int(e.pairs.stamps_ns[0])),
        "duration": e.duration,
        "way": e.way,
        "ape": {"translation": asdict(e.translation), "yaw": asdict(e.yaw)},
        "rpe_per_metre": _relative(e.rpe_metre, e.rpe_metre_yaw),
        "rpe_per_second": _relative(e.rpe_second, e.rpe_second_yaw),
        "within": {f"{bound:g}": share for bound, share in e.within.items()},
        "found_after": e.found_after,
        "converged_after": e.converged_after,
        "losses": [_loss(loss) for loss in e.losses],
        "recoveries": e.recoveries,
        "lost_seconds": e.lost_seconds,
        "consistency": None if e.consistency is None else asdict(e.consistency),
        "alignment": e.motion,
    }


def _relative(translation: Statistics | None, yaw: Statistics | None) -> dict[str, Any] | None:
    if translation is None or yaw is None:
        return None
    return {"translation": asdict(translation), "yaw": asdict(yaw)}


def _loss(loss: Loss) -> dict[str, Any]:
    end = None if loss.end_ns is None else _seconds(loss.end_ns)
    return {"start": _seconds(loss.start_ns), "end": end, "largest": loss.largest}


def _seconds(stamp_ns: int) -> float:
    return float(np.float64(stamp_ns) * 1e-9)
