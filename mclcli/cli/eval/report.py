"""What ``mcl eval`` and ``mcl run --truth`` say of evaluations, for people: tables and sentences."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from mclcli.cli.clock import clock_text
from mclcli.cli.tables import rendered
from mclcli.text import clean

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from rich.table import Table

    from mclcli.evaluate.evaluation import Evaluation, Protocol
    from mclcli.evaluate.events import Loss, Rule
    from mclcli.evaluate.metrics import Statistics
    from mclcli.evaluate.spread import Spread

_NAMED = 8  # losses told one by one
_DEGREES = {"rad": "deg"}
_DIGITS = {"rad": 3, "s": 1, "": 3}


def describe(evaluation: Evaluation, protocol: Protocol, origin_ns: int | None = None, word: str = "in") -> str:
    """One track: what was compared, a table of errors, and sentences on the rest.

    Moments are told in seconds since ``origin_ns``, the first compared pose by default, with a word that says so.
    """
    e = evaluation
    origin_ns = int(e.pairs.stamps_ns[0]) if origin_ns is None else origin_ns
    aligned = "not aligned" if e.motion is None else _motion(e.motion)
    compared = (
        f"{e.pairs.stamps_ns.size} of {e.pairs.total} poses compared ({100 * e.coverage:.1f} %), "
        f"{e.duration:.1f} s, {e.way:.1f} m; {aligned}"
    )
    lines = [compared, "", rendered(_errors_table(e)), ""]
    shares = ", ".join(f"{100 * share:.1f} % within {100 * bound:g} cm" for bound, share in e.within.items())
    return "\n".join([*lines, shares, *_events(e, protocol, origin_ns, word), *_consistency(e)])


def describe_all(evaluations: Sequence[Evaluation], spreads: dict[str, Spread], protocol: Protocol) -> str:
    """Several tracks: a row each, then median and mean of every figure with their bootstrap bands."""
    rule = _bounds(protocol.converged)
    note = f"converged: under {rule} for {protocol.converged.seconds:g} s; bands: bootstrap over tracks, 5 to 95 %"
    tables = [rendered(_tracks_table(evaluations)), "", rendered(_spread_table(spreads)), "", note]
    return "\n".join([*tables, *_moments(evaluations, protocol.truth_sd)])


def _table(first: str, rest: Iterable[str]) -> Table:
    from rich.table import Table

    table = Table(box=None, pad_edge=False, header_style="bold")
    table.add_column(first, no_wrap=True, overflow="ellipsis")
    for heading in rest:
        table.add_column(heading, justify="right", no_wrap=True)
    return table


def _errors_table(e: Evaluation) -> Table:
    table = _table("", ("rmse", "mean", "median", "std", "min", "max"))
    rows: tuple[tuple[str, Statistics | None, float], ...] = (
        ("APE, translation [m]", e.translation, 1.0),
        ("APE, yaw [deg]", e.yaw, 180.0 / math.pi),
        ("RPE per metre [m]", e.rpe_metre, 1.0),
        ("RPE per metre [deg]", e.rpe_metre_yaw, 180.0 / math.pi),
        ("RPE per second [m]", e.rpe_second, 1.0),
        ("RPE per second [deg]", e.rpe_second_yaw, 180.0 / math.pi),
    )
    for heading, s, factor in rows:
        values = () if s is None else (s.rmse, s.mean, s.median, s.std, s.min, s.max)
        table.add_row(heading, *(f"{factor * value:.4f}" for value in values) if values else ("-",) * 6)
    return table


def _events(e: Evaluation, protocol: Protocol, origin_ns: int, word: str) -> list[str]:
    rule = f"under {_bounds(protocol.converged)} for at least {protocol.converged.seconds:g} s"
    after = "never converged" if e.converged_after is None else f"converged after {e.converged_after:.1f} s"
    lines = [f"{after} ({rule})"]
    if e.found_after is None:
        return [*lines, "lost from start to end: never found"]
    if e.found_after > 0.0:
        lines.append(f"not right at the start, found after {e.found_after:.1f} s")
    lost = f"over {_bounds(protocol.lost, ' or ')} for at least {protocol.lost.seconds:g} s"
    if not e.losses:
        return [*lines, f"no loss ({lost})"]
    times = "once" if len(e.losses) == 1 else f"{len(e.losses)} times"
    lines.append(
        f"lost {times}, {e.lost_seconds:.1f} s in all, found again {e.recoveries} of {len(e.losses)} ({lost}):"
    )
    return lines + [f"  {moment(loss, origin_ns, word)}" for loss in told(e.losses)] + rest(e.losses)


def told(losses: Sequence[Loss]) -> Sequence[Loss]:
    """The losses that are told one by one."""
    return losses[:_NAMED]


def rest(losses: Sequence[Loss]) -> list[str]:
    """How many more there are."""
    return [f"  and {len(losses) - _NAMED} more"] if len(losses) > _NAMED else []


def moment(loss: Loss, origin_ns: int, word: str) -> str:
    """When something happened, for how long, and how bad it was."""
    since = f"{(loss.start_ns - origin_ns) * 1e-9:.1f} s {word}"
    ended = "to the end" if loss.end_ns is None else f"for {(loss.end_ns - loss.start_ns) * 1e-9:.1f} s"
    return f"{clock_text(loss.start_ns)} ({since}) {ended}, at most {loss.largest:.2f} m off"


def _consistency(e: Evaluation) -> list[str]:
    c = e.consistency
    if c is None:
        return []
    verdict = "overconfident" if c.anees > c.band[1] else "underconfident" if c.anees < c.band[0] else "consistent"
    average = f"ANEES {c.anees:.2f} over {c.count} updates, {verdict}"
    band = f"95 % band {c.band[0]:.2f} to {c.band[1]:.2f} if updates were independent"
    lines = [f"{average} ({band}); {100 * c.inside:.1f} % of the NEES within the band of a single one"]
    ellipses = f"{100 * c.ellipse:.1f} % inside the 95 % ellipse of x, y and yaw, {100 * c.ellipse_xy:.1f} % of x and y"
    lines.append(f"median NEES {c.median_nees:.2f} (2.37 if consistent); {ellipses}")
    if any(c.truth_sd):
        truth = f"{c.truth_sd[0]:g} m and {math.degrees(c.truth_sd[1]):.4g} deg"
        lines.append(f"the reference's own standard deviations of {truth} were added to those of the track")
    if c.singular:
        lines.append(f"{c.singular} updates state no regular covariance and are left out of it")
    if c.near_singular:
        bounds = "less than 0.1 mm or 0.0006 deg in some direction, as of a single particle"
        lines.append(f"{c.near_singular} updates state a nearly singular covariance ({bounds}) and are left out of it")
    return lines


def _moments(evaluations: Sequence[Evaluation], truth_sd: tuple[float, float]) -> list[str]:
    from mclcli.evaluate.consistency import consistency_over_runs

    found = consistency_over_runs([e.pairs for e in evaluations], truth_sd)
    if found is None:
        return []
    share = f"{100 * found.inside:.1f} % of the ANEES within {found.band[0]:.2f} to {found.band[1]:.2f}"
    return [f"at each of {found.moments} updates that all made: {share}, the 95 % band of runs with independent noise"]


def _bounds(rule: Rule, word: str = " and ") -> str:
    return f"{rule.translation:g} m{word}{math.degrees(rule.yaw):.4g} deg"


def _motion(motion: tuple[float, float, float]) -> str:
    x, y, yaw = motion
    return f"aligned: the track was moved by x {x:.4f} m, y {y:.4f} m, yaw {math.degrees(yaw):.4f} deg"


def _tracks_table(evaluations: Sequence[Evaluation]) -> Table:
    table = _table(
        "track", ("compared", "APE [m]", "max [m]", "yaw [deg]", "<10 cm", "converged", "lost", "ANEES", "in 95 %")
    )
    for e in evaluations:
        table.add_row(
            clean(e.name, 60),
            f"{100 * e.coverage:.1f} %",
            f"{e.translation.rmse:.4f}",
            f"{e.translation.max:.3f}",
            f"{math.degrees(e.yaw.rmse):.3f}",
            f"{100 * e.within[0.1]:.1f} %",
            "never" if e.converged_after is None else f"{e.converged_after:.1f} s",
            "always" if e.found_after is None else str(len(e.losses)),
            "-" if e.consistency is None else f"{e.consistency.anees:.2f}",
            "-" if e.consistency is None else f"{100 * e.consistency.ellipse:.1f} %",
        )
    return table


def _spread_table(spreads: dict[str, Spread]) -> Table:
    from mclcli.evaluate.spread import FIGURES

    table = _table("over the tracks", ("median", "5 to 95 %", "mean", "5 to 95 %", "min", "max", "of"))
    for name, s in spreads.items():
        unit = FIGURES[name][0]
        factor = 180.0 / math.pi if unit == "rad" else 1.0
        digits = _DIGITS.get(unit, 4)
        shown = [f"{factor * v:.{digits}f}" for v in (s.median, *s.median_band, s.mean, *s.mean_band, s.min, s.max)]
        median, low, high, mean, mean_low, mean_high, least, most = shown
        heading = f"{name} [{_DEGREES.get(unit, unit)}]" if unit else name
        table.add_row(
            heading, median, f"{low} to {high}", mean, f"{mean_low} to {mean_high}", least, most, str(s.count)
        )
    return table
