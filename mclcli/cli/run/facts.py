"""What ``mcl run --json`` prints; names of keys are part of it, see docs/formats.md."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from mclcli.cli.results import pose, seconds
from mclcli.cli.run import ends, report
from mclcli.version import __version__

if TYPE_CHECKING:
    from mclcli.cli.run.options import RunOptions
    from mclcli.cli.run.outcome import Outcome
    from mclcli.evaluate.versus import Comparison
    from mclcli.filter.start import Placed
    from mclcli.records import Estimate
    from mclcli.replay.tally import ReplayTally, Stretch
    from mclcli.sensors.instruments import Instrument


def facts_of(outcome: Outcome, options: RunOptions) -> dict[str, Any]:
    """Everything that the summary says, as plain values."""
    from mclcli.evaluate.evaluation import as_plain

    tally, run, findings = outcome.tally, outcome.outputs.ends, outcome.findings
    summary = report.summarise(outcome)
    return {
        "version": __version__,
        "logs": [Path(name).name for name in options.logs],
        "map": None if options.map_file is None else options.map_file.name,
        "profile": outcome.settings.profile,
        "model": outcome.settings.model,
        "seed": outcome.setup.localizer.seed,
        "updates": tally.updates,
        "duration": outcome.outputs.track.seconds,
        "way": tally.distance,
        "segments": tally.segments,
        "log_start": seconds(outcome.recording.first_ns),
        "starts": [_start(stamp_ns, placed) for stamp_ns, placed in tally.found],
        "first": _place(run.first_ns, run.first),
        "last": _place(run.last_ns, run.last),
        "ends_lost": run.ends_lost,
        "converged": run.converged,
        "reliability": {"mean": run.reliability, "least": run.least, "last": run.last_reliability},
        "lost_updates": sum(stretch.updates for stretch in tally.lost),
        "lost": [_stretch(stretch) for stretch in tally.lost],
        "degenerate": tally.degenerate,
        "sensors": {i.name: _sensor(topic, i, tally) for topic, i in outcome.setup.instruments.items()},
        "doubts": summary.doubts,
        "truth": None if findings.evaluation is None else as_plain(findings.evaluation),
        "versus": None if findings.comparison is None else _versus(findings.source, findings.comparison),
        "damaged": bool(outcome.recording.tally.lossy),
        "took": outcome.seconds,
    }


def _place(stamp_ns: int, estimate: Estimate | None) -> dict[str, Any] | None:
    if estimate is None:
        return None
    position, yaw = ends.deviations(estimate)
    return {"stamp": seconds(stamp_ns), **pose(estimate.pose), "position_sd": position, "yaw_sd": yaw}


def _start(stamp_ns: int, placed: Placed) -> dict[str, Any]:
    found = zip(placed.places, placed.probabilities, strict=True)
    places = [{**pose(place), "probability": float(share)} for place, share in found]
    return {"stamp": seconds(stamp_ns), "places": places, "not_on_map": float(placed.elsewhere)}


def _stretch(stretch: Stretch) -> dict[str, Any]:
    return {
        "start": seconds(stretch.first_ns),
        "end": seconds(stretch.last_ns),
        "from": list(stretch.first),
        "to": list(stretch.last),
        "reliability": stretch.reliability,
        "updates": stretch.updates,
    }


def _sensor(topic: str, instrument: Instrument, tally: ReplayTally) -> dict[str, Any]:
    scored = tally.scored[instrument.name]
    return {
        "topic": topic,
        "used": tally.used[topic],
        "skipped": {why: count for (name, why), count in sorted(tally.skipped.items()) if name == topic},
        "scored": scored,
        "unknown": tally.unknown[instrument.name],
        "alpha": tally.independent.get(instrument.name, 0.0) / scored if scored else None,
    }


def _versus(source: str, comparison: Comparison) -> dict[str, Any]:
    differences = comparison.differences
    return {
        "source": source,
        "compared": int(differences.stamps_ns.size),
        "translation_rmse": differences.translation_rmse,
        "translation_max": float(differences.translation.max()),
        "yaw_rmse": differences.yaw_rmse,
        "apart": [
            {
                "start": seconds(loss.start_ns),
                "end": None if loss.end_ns is None else seconds(loss.end_ns),
                "largest": loss.largest,
            }
            for loss in comparison.apart
        ],
    }
