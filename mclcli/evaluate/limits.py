"""Limits that a track has to keep, and one sentence for each that it misses."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, final

if TYPE_CHECKING:
    from collections.abc import Iterator

    from mclcli.evaluate.evaluation import Evaluation


@final
@dataclass(frozen=True, slots=True)
class Limits:
    """What is asked of a track; None asks nothing.

    ``max_ape`` [m] and ``max_yaw`` [rad] bound the RMSE, ``max_error`` [m] the largest translation error,
    ``max_rpe`` [m/m] the RMSE per metre, ``max_convergence`` [s] the time to convergence, ``max_losses`` the losses;
    ``min_within`` is (share, metres), ``min_coverage`` a share of the poses, ``min_ellipse`` one of the updates, inside
    their 95 % ellipse.
    """

    max_ape: float | None = None
    max_yaw: float | None = None
    max_error: float | None = None
    max_rpe: float | None = None
    max_losses: int | None = None
    max_convergence: float | None = None
    max_anees: float | None = None
    min_within: tuple[float, float] | None = None
    min_coverage: float | None = None
    min_ellipse: float | None = None


def missed(evaluation: Evaluation, limits: Limits) -> list[str]:
    """One sentence for each limit that a track misses; a limit on a figure that is unknown counts as missed."""
    e = evaluation
    return [*_errors_missed(e, limits), *_events_missed(e, limits), *_shares_missed(e, limits)]


def _errors_missed(e: Evaluation, limits: Limits) -> Iterator[str]:
    if limits.max_ape is not None and e.translation.rmse > limits.max_ape:
        yield f"APE {e.translation.rmse:.4f} m (RMSE) is more than --max-ape {limits.max_ape:g} m"
    if limits.max_error is not None and e.translation.max > limits.max_error:
        yield f"largest error {e.translation.max:.4f} m is more than --max-error {limits.max_error:g} m"
    if limits.max_yaw is not None and e.yaw.rmse > limits.max_yaw:
        bound = math.degrees(limits.max_yaw)
        yield f"yaw error {math.degrees(e.yaw.rmse):.3f} deg (RMSE) is more than --max-yaw {bound:g} deg"
    if limits.max_rpe is not None:
        if e.rpe_metre is None:
            yield f"RPE unknown: the robot did not drive a metre; --max-rpe {limits.max_rpe:g} asks for one"
        elif e.rpe_metre.rmse > limits.max_rpe:
            yield f"RPE {e.rpe_metre.rmse:.4f} m per m (RMSE) is more than --max-rpe {limits.max_rpe:g}"


def _events_missed(e: Evaluation, limits: Limits) -> Iterator[str]:
    if limits.max_losses is not None:
        if e.found_after is None:
            yield f"lost from start to end, never found; --max-losses {limits.max_losses} asks for a robot that was"
        elif len(e.losses) > limits.max_losses:
            times = "once" if len(e.losses) == 1 else f"{len(e.losses)} times"
            yield f"lost {times}, {e.lost_seconds:.1f} s in all; --max-losses is {limits.max_losses}"
    if limits.max_convergence is not None:
        if e.converged_after is None:
            yield f"never converged; --max-convergence is {limits.max_convergence:g} s"
        elif e.converged_after > limits.max_convergence:
            yield f"converged after {e.converged_after:.1f} s; --max-convergence is {limits.max_convergence:g} s"
    if limits.max_anees is not None:
        if e.consistency is None:
            yield f"ANEES unknown: the track states no covariance; --max-anees {limits.max_anees:g} needs a track CSV"
        elif e.consistency.anees > limits.max_anees:
            yield f"ANEES {e.consistency.anees:.2f} is more than --max-anees {limits.max_anees:g}"


def _shares_missed(e: Evaluation, limits: Limits) -> Iterator[str]:
    if limits.min_within is not None:
        share, bound = limits.min_within
        found = float((e.errors.translation <= bound).mean())
        if found < share:
            yield f"{100 * found:.1f} % of the poses are within {bound:g} m; --min-within asks for {100 * share:g} %"
    if limits.min_ellipse is not None:
        asked = f"--min-ellipse {100 * limits.min_ellipse:g} %"
        if e.consistency is None:
            yield f"coverage of the 95 % ellipse unknown: the track states no covariance; {asked} needs a track CSV"
        elif e.consistency.ellipse < limits.min_ellipse:
            yield f"{100 * e.consistency.ellipse:.1f} % of the updates are inside their 95 % ellipse; less than {asked}"
    if limits.min_coverage is not None and e.coverage < limits.min_coverage:
        yield (
            f"the reference covers {100 * e.coverage:.1f} % of the poses; --min-coverage asks for "
            f"{100 * limits.min_coverage:g} %"
        )
