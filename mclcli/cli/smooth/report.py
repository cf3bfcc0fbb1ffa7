"""What ``mcl smooth`` tells of a track: how well it fits, what was learned of the robot, and whether to believe it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from mclcli.filter.fit import PROBABLY_LOST
from mclcli.geometry import se2
from mclcli.replay.tally import Stretch
from mclcli.smooth.evidence import FEW_SCANS, MOST_TAU
from mclcli.text import counted

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mclcli.replay.smoothing import Smoothed
    from mclcli.smooth.mounting import Mounting
    from mclcli.smooth.noise import Drift
    from mclcli.smooth.scans import Law

_STRETCHES = 5  # that a summary names
_PSEUDO = (
    "a pseudo reference of mcl smooth, made from the log and its map: as right as the map, and blind to rooms that are "
    "drawn in a wrong place as a whole"
)
_WORTH_SAYING = 5  # [mm]
_MUCH = 0.02  # of the way: a track that is lost for longer is doubtful as a whole


def stretches_of(found: Smoothed) -> list[Stretch]:
    """Scans in a row that the map does not explain from where the track has them."""
    stretches: list[Stretch] = []
    losing = False
    rows = zip(found.stamps_ns, found.best.poses.tolist(), found.best.reliability.tolist(), strict=True)
    for stamp_ns, (x, y, _), reliability in rows:
        before, losing = losing, reliability < PROBABLY_LOST
        if not losing:
            continue
        if not before:
            stretches.append(Stretch(stamp_ns, stamp_ns, (x, y), (x, y), reliability))
            continue
        last = stretches[-1]
        last.last_ns, last.last = stamp_ns, (x, y)
        last.reliability = min(last.reliability, reliability)
        last.updates += 1
    return stretches


def lost_share(found: Smoothed) -> float:
    """Share of the way on which the track is probably lost, or off the map."""
    return float(np.mean(found.best.reliability[found.best.keys] < PROBABLY_LOST))


def is_doubtful(found: Smoothed) -> bool:
    """Whether the track may be another one altogether: it is lost for long, and smoothing finds no way back."""
    return lost_share(found) > _MUCH


def reasons(found: Smoothed) -> list[str]:
    """Why a track is no reference; none for one that may be."""
    told, evidence = [], found.best.learned.evidence
    if evidence.scarce:
        told.append(f"{counted(evidence.scans, 'scan')} on the way are too few to tell (at least {FEW_SCANS})")
    if evidence.repeated:
        told.append(
            f"scans repeat each other's errors, as they do on a wrong map (τ₁ {evidence.tau:.0f} > {MOST_TAU:g})"
        )
    if evidence.misfitting:
        off, most = 1e3 * evidence.misfit, 1e3 * evidence.limit
        told.append(f"walls are {off:.1f} mm from where the map has them, piece by piece of 2 m (> {most:.1f} mm)")
    told += _mounting(found.best.learned.mounting)
    if is_doubtful(found):
        told.append(f"the map does not explain {100 * lost_share(found):.0f} % of the way")
    return told


def _mounting(mounting: Mounting) -> list[str]:
    """What the log says of the lidar's clock and place, where they are not as stated."""
    (late, later), (ahead, further), (left, wider) = mounting.late, mounting.ahead, mounting.left
    told = []
    if mounting.is_late:
        told.append(f"scans fit better {1e3 * late:+.0f} ms from their stamps (± {1e3 * later:.0f} ms; --scan-offset)")
    if mounting.is_moved:
        by = f"{1e3 * ahead:+.0f} ± {1e3 * further:.0f} mm ahead and {1e3 * left:+.0f} ± {1e3 * wider:.0f} mm left"
        told.append(f"the lidar fits better {by} of where it is said to sit (--mount)")
    return told


def caveat(found: Smoothed) -> str:
    """What whoever takes the track for a reference has to know, in one line."""
    told = reasons(found)
    return f"a track of mcl smooth, not to be taken for a reference: {'; '.join(told)}" if told else _PSEUDO


def summary(found: Smoothed, seconds: float, first_ns: int) -> list[str]:
    """What was found, in a few lines; ``first_ns`` is the log's first stamp."""
    best, learned, scans = found.best, found.best.learned, len(found.best.poses)
    apart = best.poses - found.filtered
    moved = math.sqrt(float(np.mean(apart[:, 0] ** 2 + apart[:, 1] ** 2)))
    turned = math.degrees(math.sqrt(float(np.mean(se2.wrap(apart[:, 2]) ** 2))))
    where = f"{counted(scans, 'scan')} at {counted(len(best.keys), 'place')}"
    spread = np.sqrt(np.mean(best.covariances[:, range(3), range(3)], axis=0))
    sure = f"{1e3 * max(spread[:2]):.1f} mm and {math.degrees(spread[2]):.2f}°"
    left = f"scans {best.scan_costs.sum():.0f} nats, odometry {best.odometry_costs.sum():.0f} nats"
    lines = [
        f"smoothed {where} in {seconds:.2f} s; the filter's track was {moved:.3f} m and {turned:.2f}° from it (RMS)",
        f"stated uncertainty {sure} (1 σ, RMS over the track)",
        f"cost left: {left} over {counted(max(scans - 1, 0), 'increment')}",
        f"beams: {_beams(learned.law)}; temperature {learned.alpha:.2f}",
        f"odometry: {_odometry(learned.drift)}",
    ]
    if not best.converged:
        lines.append("the last steps still changed the track a little")
    return lines + _losses(stretches_of(found), scans, first_ns)


def _beams(law: Law) -> str:
    side = "before" if law.offset > 0 else "behind"
    ends = f"{abs(1e3 * law.offset):.0f} mm {side} the centres of its walls' cells"
    return f"σ {1e3 * law.sigma:.1f} mm, {100 * law.z:.0f} % end at what the map shows, {ends}"


def _odometry(drift: Drift) -> str:
    along, yaw = math.sqrt(drift.along_by_move), math.degrees(math.sqrt(drift.yaw_by_move))
    off = f"{100 * drift.length:+.1f} % of length and {100 * drift.turn:+.1f} % of turning"
    return f"{1e3 * along:.0f} mm and {yaw:.2f}° of noise in a metre; what it says is off by {off}"


def verdict(found: Smoothed) -> list[str]:
    """Whether the track may serve as a reference, and why not; and what the filter may learn from it."""
    told, evidence = reasons(found), found.best.learned.evidence
    if told:
        return [f"no reference: {'; '.join(told)}"]
    errors = f"τ₁ {evidence.tau:.1f}, at most {MOST_TAU:g}; walls {1e3 * evidence.misfit:.1f} mm from the map's"
    lines = [f"a pseudo reference, if the map is right: {errors}; rooms drawn in a wrong place as a whole are not seen"]
    offset = round(1e3 * found.best.learned.law.offset)
    if abs(offset) >= _WORTH_SAYING:
        lines.append(f"the filter is nearer to it with --set obstacles=boundary --set range_offset={offset}mm")
    return lines


def _losses(stretches: Sequence[Stretch], scans: int, first_ns: int) -> list[str]:
    """When and where the track is probably lost: the longest stretches, in order of time."""
    if not stretches:
        return []
    total = sum(stretch.updates for stretch in stretches)
    lines = [f"probably lost, or off the map, at {total} of {scans} scans (reliability < {PROBABLY_LOST:g}):"]
    longest = sorted(stretches, key=lambda one: -one.updates)[:_STRETCHES]
    lines += [f"  {_stretch(one, first_ns)}" for one in sorted(longest, key=lambda one: one.first_ns)]
    return lines + [f"  and {len(stretches) - _STRETCHES} more"] * (len(stretches) > _STRETCHES)


def _stretch(one: Stretch, first_ns: int) -> str:
    begin, end = ((stamp_ns - first_ns) * 1e-9 for stamp_ns in (one.first_ns, one.last_ns))
    (x0, y0), (x1, y1) = one.first, one.last
    where = f"{x0:.1f},{y0:.1f} to {x1:.1f},{y1:.1f}"
    return f"lost from {begin:.1f} to {end:.1f} s of the log, {where}, reliability {one.reliability:.2f}"


def facts(found: Smoothed) -> dict[str, object]:
    """What ``--json`` prints; names of keys are part of it. Metres, radians, nats."""
    best, learned = found.best, found.best.learned
    law, drift, evidence = learned.law, learned.drift, learned.evidence
    lost = [
        {"from_ns": s.first_ns, "to_ns": s.last_ns, "scans": s.updates, "reliability": s.reliability}
        for s in stretches_of(found)
    ]
    return {
        "scans": len(best.poses),
        "places": len(best.keys),
        "converged": best.converged,
        "cost": {"scans": float(best.scan_costs.sum()), "odometry": float(best.odometry_costs.sum())},
        "beams": {"sigma_hit": law.sigma, "z_hit": law.z, "range_offset": law.offset, "temperature": learned.alpha},
        "odometry": {
            "variance_along_per_metre": drift.along_by_move,
            "variance_along_per_radian": drift.along_by_turn,
            "variance_yaw_per_metre": drift.yaw_by_move,
            "variance_yaw_per_radian": drift.yaw_by_turn,
            "length": drift.length,
            "turn": drift.turn,
            "pull": drift.pull,
        },
        "mounting": {"late": learned.mounting.late, "ahead": learned.mounting.ahead, "left": learned.mounting.left},
        "evidence": {"godambe": evidence.godambe, "tau": evidence.tau, "misfit": evidence.misfit},
        "lost": lost,
        "lost_share": lost_share(found),
        "pseudo_reference": not reasons(found),
        "reasons": reasons(found),
    }
