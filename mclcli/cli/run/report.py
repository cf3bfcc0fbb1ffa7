"""What ``mcl run`` tells its user at the end: a summary, a picture."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.cli import console
from mclcli.cli.run import beginnings
from mclcli.filter.fit import PROBABLY_LOST
from mclcli.text import clean, counted

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from PIL.Image import Image

    from mclcli.arrays import BoolArray, IntArray
    from mclcli.cli.run.ends import Ends
    from mclcli.cli.run.options import RunOptions
    from mclcli.cli.run.outcome import Outcome
    from mclcli.cli.run.outputs import Outputs
    from mclcli.cli.run.references import Findings
    from mclcli.geometry.trajectory import Track
    from mclcli.io.recording.recording import Recording
    from mclcli.replay.loop import ReplayTally, Setup
    from mclcli.replay.tally import Stretch
    from mclcli.sensors.instruments import Instrument
    from mclcli.world.occupancy import OccupancyGrid

_STRETCHES = 5  # that a summary names


def extent(tally: ReplayTally, track: Track) -> str:
    """How much was driven, without anything that differs from one run to the next."""
    return f"{counted(tally.updates, 'update')} over {track.seconds:.1f} s and {tally.distance:.1f} m"


@final
@dataclass(frozen=True, slots=True)
class Summary:
    """Lines on what a run did: ``facts``, ``doubts`` that change what its result means, and ``details`` of the last."""

    facts: list[str]
    doubts: list[str]
    details: list[str]


def summarise(outcome: Outcome) -> Summary:
    """What the run did, in a few lines."""
    outputs = outcome.outputs
    return summary_of(outcome.recording, outcome.setup, outcome.tally, outputs.track, outputs.ends, outcome.seconds)


def summary_of(
    recording: Recording, setup: Setup, tally: ReplayTally, track: Track, ends: Ends, seconds: float
) -> Summary:
    """The same, of a run that took so many seconds, whatever became of its outputs."""
    facts = [f"{extent(tally, track)} in {seconds:.2f} s ({track.seconds / seconds:.0f} × real time)"]
    facts += beginnings.repeated(recording, tally)
    facts += ends.lines(recording.first_ns)
    doubts = beginnings.undecided(tally, ends.last_ns)
    for topic, instrument in setup.instruments.items():
        facts.append(f"{instrument.name} {clean(topic)}: {tally.used[topic]} used{_skipped(tally, topic)}")
        facts += _scored(instrument, tally)
        doubts += _unscored(instrument, tally)
    if tally.odometry_gaps:
        facts.append(
            f"odometry {clean(setup.odometry)}: {counted(tally.odometry_gaps, 'gap')} over 1 s, the longest "
            f"{tally.longest_gap_ns * 1e-9:.1f} s; interpolated"
        )
    if tally.degenerate:
        doubts.append(f"{counted(tally.degenerate, 'update')} ignored the measurement: no weight was left (degenerate)")
    losses = _losses(recording, tally)
    doubts += _resets(recording, setup, tally) + _unread(recording) + ends.doubts() + losses[:1]
    return Summary(facts + _events_of(setup, tally), doubts, losses[1:])


def _losses(recording: Recording, tally: ReplayTally) -> list[str]:
    """When and where the robot was probably lost, or where the map knows nothing: the first stretches."""
    if not tally.lost:
        return []
    total = sum(stretch.updates for stretch in tally.lost)
    lines = [f"probably lost, or off the map, at {total} of {tally.updates} updates (reliability < {PROBABLY_LOST:g})"]
    for stretch in tally.lost[:_STRETCHES]:
        begin, end = ((stamp_ns - recording.first_ns) * 1e-9 for stamp_ns in (stretch.first_ns, stretch.last_ns))
        (x0, y0), (x1, y1) = stretch.first, stretch.last
        where = f"{x0:.1f},{y0:.1f} to {x1:.1f},{y1:.1f}"
        lines.append(
            f"  lost from {begin:.1f} to {end:.1f} s of the log, {where}, reliability {stretch.reliability:.2f}"
        )
    more = len(tally.lost) - _STRETCHES
    return lines + [f"  and {more} more; column lost of --steps has them all"] * (more > 0)


def _resets(recording: Recording, setup: Setup, tally: ReplayTally) -> list[str]:
    """Where odometry was set back or jumped, and what was done: the first time in full."""
    more = tally.odometry_jumps - sum(not reset.doubtful for reset in tally.resets)
    lines = [f"odometry {clean(setup.odometry)}: {more} more jumps, taken for no motion"] * bool(more)
    if not tally.resets:
        return lines
    first, again = tally.resets[0], len(tally.resets) - 1
    jump, name = first.jump, f"odometry {clean(setup.odometry)}"
    far = f"{jump.moved:.1f} m" if jump.moved >= 0.1 else f"{np.degrees(jump.turned):.0f}°"
    gap = f" in a gap of {jump.seconds:.1f} s" if jump.in_gap else ""
    where = f"{name} jumps by {far}{gap} at {(jump.before_ns - recording.first_ns) * 1e-9:.1f} s of the log"
    why = "reset, or the robot was carried: what is seen after it does not fit" if first.doubtful else "reset"
    done = "the robot was searched for again" if first.searched else "the filter went on from where it was"
    hint = "" if first.searched or setup.search is not None else " (--init global or --recovery locate search again)"
    return [
        f"{where} ({why}); {done}{hint}",
        *([f"{name} jumps {_times(again)} more, resets too"] * bool(again)),
        *lines,
    ]


def _events_of(setup: Setup, tally: ReplayTally) -> list[str]:
    """What else happened that a user should know of."""
    again, back = tally.restarts, tally.time_jumps
    told = {
        f"{clean(setup.follow)}: the filter began anew {_times(again)}, at each of its poses": again,
        f"time jumped back {_times(back)}; the filter began anew in each segment": back,
        f"{counted(tally.injected, 'particle')} drawn anew": tally.injected,
        f"{clean(setup.map_topic)}: the map changed {_times(tally.maps)}": tally.maps,
    }
    passed_over = _skipped(tally, setup.follow)
    follow = [f"{clean(setup.follow)}: {passed_over.removeprefix(', ')}"] if setup.follow and passed_over else []
    return [text for text, count in told.items() if count] + follow


def _times(count: int) -> str:
    return "once" if count == 1 else f"{count} times"


def tell(outcome: Outcome) -> None:
    """Print the summary on stderr, its doubts last and as warnings."""
    tell_summary(summarise(outcome))


def tell_summary(summary: Summary) -> None:
    """Print a summary on stderr, its doubts last and as warnings."""
    for line in summary.facts:
        console.remark(line)
    for line in summary.doubts:
        console.warn(line)
    for line in summary.details:
        console.remark(line)


def show(lines: Sequence[str], report: str = "") -> None:
    """Print lines, and a report below them, on stderr."""
    for line in lines:
        console.remark(line)
    if report:
        console.block(report)


def finish(options: RunOptions, outcome: Outcome, *, in_full: bool) -> None:
    """Compare a run with its references, draw it, and say how to keep it: what follows the summary."""
    from mclcli.cli.run.references import lines_of, report_of

    findings = outcome.findings
    compared = lines_of(findings)
    if in_full:
        show(compared, report_of(findings))
    if options.picture:
        title = f"Track of {', '.join(outcome.recording.log.names)}"
        subtitle = compared[0] if compared else extent(outcome.tally, outcome.outputs.track)
        lost = outcome.tally.lost
        draw(options.picture, options.input_files, outcome.grid, outcome.outputs, findings, lost, title, subtitle)
    elif in_full and not outcome.outputs.keeps and not options.as_json:
        console.remark("nothing was kept; --track F.csv, --picture F.png or -o F.mcap would keep it")


def draw(
    target: str,
    inputs: Sequence[Path],
    grid: OccupancyGrid | None,
    outputs: Outputs,
    findings: Findings,
    lost: Sequence[Stretch],
    title: str,
    subtitle: str,
) -> None:
    """Picture of map, track, reference, belief and final particles; below it errors and differences over time."""
    from mclcli.cli import pictures
    from mclcli.cli.eval import pictures as eval_pictures
    from mclcli.render.evaluation import floor_around
    from mclcli.render.track import draw_track

    track, last = outputs.track, outputs.last_step
    stamps = track.stamps_ns
    span = int(stamps.min()), int(stamps.max())
    belief = None if findings.comparison is None else findings.comparison.belief
    picture = draw_track(
        grid if grid is not None else floor_around(track.poses),
        track.poses,
        stamps_s=(stamps - stamps[0]) * 1e-9,
        truth=None if findings.truth is None else eval_pictures.during(findings.truth, *span),
        belief=None if belief is None else belief.poses,
        cloud=None if last is None else last.poses,
        cloud_weights=None if last is None else last.weights,
        lost=_within(stamps, lost),
        title=title,
        subtitle=subtitle,
    )
    pictures.save(_with_findings(picture, findings, span[0]), target, inputs)


def _within(stamps_ns: IntArray, stretches: Sequence[Stretch]) -> BoolArray:
    """Which stamps (N,) are in one of the stretches."""
    inside = np.zeros(stamps_ns.size, np.bool_)
    for stretch in stretches:
        inside |= (stamps_ns >= stretch.first_ns) & (stamps_ns <= stretch.last_ns)
    return inside


def _with_findings(picture: Image, findings: Findings, first_ns: int) -> Image:
    """Picture of a run with errors and differences over time below it, where there are any."""
    from mclcli.cli.eval.pictures import errors_to_draw, levels_of, shades_of
    from mclcli.evaluate.events import APART, CONVERGED, LOST
    from mclcli.render.evaluation import Errors, with_errors

    if findings.evaluation is not None:
        picture = with_errors(
            picture,
            [errors_to_draw(findings.evaluation, first_ns)],
            "error",
            "lost",
            levels_of(CONVERGED, LOST),
        )
    if findings.comparison is not None:
        d = findings.comparison.differences
        seconds = np.asarray((d.stamps_ns - first_ns) * 1e-9, dtype=np.float64)
        shades = shades_of(findings.comparison.apart, first_ns, float(seconds[-1]))
        differences = Errors("", np.zeros((0, 3)), seconds, d.translation, d.yaw, None, shades)
        picture = with_errors(picture, [differences], "from what the robot believed", "apart", levels_of(APART))
    return picture


def _skipped(tally: ReplayTally, topic: str) -> str:
    reasons = [(why, count) for (name, why), count in sorted(tally.skipped.items()) if name == topic]
    return "".join(f", {count} skipped: {clean(why)}" for why, count in reasons)


def _scored(instrument: Instrument, tally: ReplayTally) -> Iterator[str]:
    """What temperature ``auto`` found, and how many sightings named nothing in the landmark map."""
    from mclcli.sensors.instruments import Lidar

    name = instrument.name
    scored, unknown = tally.scored[name], tally.unknown[name]
    if isinstance(instrument, Lidar) and instrument.alpha == "auto" and scored:
        share, each = tally.independent[name] / scored, scored / tally.updates
        yield f"{name}: temperature {share:.2f} on average (auto): K_eff {share * each:.1f} of {each:.1f} an update"
    if unknown:
        yield f"{name}: {unknown} of {scored} sightings have an id that is not in the landmark map"


def _unscored(instrument: Instrument, tally: ReplayTally) -> Iterator[str]:
    """That a sensor told nothing, where it did not."""
    from mclcli.sensors.instruments import Lidar

    if not tally.updates or tally.scored[instrument.name]:
        return
    what = "no beam was scored" if isinstance(instrument, Lidar) else "no sighting was scored"
    why = "none of the readings that were picked (max_beams) is a return" * isinstance(instrument, Lidar)
    yield f"{instrument.name}: {what} at any update, so that it told nothing{why and ': '}{why}"


def _unread(recording: Recording) -> list[str]:
    """Messages of the log that could not be read."""
    lines = []
    for topic, reasons in sorted(recording.tally.skipped.items()):
        lines += [
            f"{clean(topic)}: {counted(count, 'message')} not read: {clean(why)}"
            for why, count in sorted(reasons.items())
        ]
    return lines
