"""``mcl score``: poses against one scan."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from mclcli.cli.options import into
from mclcli.cli.score.options import ScoreOptions, score_options
from mclcli.errors import InputError, UsageError

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray
    from mclcli.filter.parameters import FilterParameters
    from mclcli.sensors import Measurement

_MANY = 200_000  # poses that take a while
_WHAT = {"lidar": "beams", "vision": "bearings"}


@click.command("score", short_help="Score poses of a robot against one scan.")
@score_options
@into(ScoreOptions)
def command(options: ScoreOptions) -> None:
    """Print log-likelihood and weight of every pose for one SCAN: a LaserScan as YAML or JSON, - for stdin, or a log.

    \b
        mcl extract LOG --at 12.3 | mcl score - --map m.yaml --around 1,2,90deg -n 1000 | sort -t, -k5 -g | tail
    """  # noqa: D301 - click's mark for a verbatim paragraph
    from mclcli.cli import console, results
    from mclcli.cli.chosen import choose_settings, warn_of_turned_map
    from mclcli.cli.one_scan import find_scan
    from mclcli.cli.score import explain, output
    from mclcli.cli.score import poses as score_poses
    from mclcli.cli.score.sensors import instruments
    from mclcli.filter import weights

    results.keep_stdout_free((options.output,), as_json=options.as_json)
    if options.as_json and (options.explain or options.picture):
        raise UsageError("--json prints poses, --explain and --picture show the beams of one; give one of them")
    chosen = choose_settings(options.parameters, {} if options.as_run else {"max_beams": 0})
    settings = chosen.settings
    grid = options.map_limits.load(options.map_file)
    warn_of_turned_map(grid, settings)
    scan = find_scan(options.source, options.sensors.mounts, chosen)
    candidates = score_poses.collect(options.poses, grid, for_heatmap=bool(options.heatmap))
    if options.explain or options.picture:
        explain.run(options, settings, grid, scan, candidates.poses)
        return
    used = instruments(options, settings, grid, scan, len(candidates.poses))
    measurements = [instrument.measure(reading, mount) for instrument, reading, mount in used]
    with console.waiting(f"scoring {len(candidates.poses)} poses", long=len(candidates.poses) > _MANY):
        log_likelihoods = weights.score(measurements, candidates.poses)
    alphas = _alphas(measurements, log_likelihoods, candidates.poses, settings.filter, as_run=options.as_run)
    log_weights = weights.temper(alphas, log_likelihoods)
    console.remark(_how(options, measurements, alphas))
    if not weights.usable(log_weights):
        raise InputError("no pose has a weight: every likelihood is zero or not a number; check the poses")
    result = output.Scores(
        candidates, measurements, alphas, log_likelihoods, log_weights, weights.normalise(log_weights)
    )
    inputs = options.input_files
    if options.output or not (options.heatmap or options.as_json):
        output.write(result, options.output or "-", inputs, scan, grid)
    if options.as_json:
        results.print_json(output.facts(result, scan, options.map_file.name))
    if options.heatmap:
        output.draw(result, options.heatmap, inputs, grid, options.map_file.name)


def _how(options: ScoreOptions, measurements: list[Measurement], alphas: tuple[float, ...]) -> str:
    """How the poses were scored, beside how a run would do it."""
    used = zip(measurements, alphas, strict=True)
    parts = [f"{m.sensor}: {m.count} {_WHAT.get(m.sensor, 'readings')} at α = {alpha:.3g}" for m, alpha in used]
    return f"scored {', '.join(parts)}; as `mcl run` scores{'' if options.as_run else ': --as-run'}"


def _alphas(
    measurements: list[Measurement],
    log_likelihoods: FloatArray,
    poses: FloatArray,
    parameters: FilterParameters,
    *,
    as_run: bool,
) -> tuple[float, ...]:
    """Temperatures; ``auto`` looks at the beams from the likeliest pose, ``ess`` at equally weighted poses.

    ``as_run`` heeds how well the scan fits, too.
    """
    from mclcli.cli import console
    from mclcli.filter import fit, temperature
    from mclcli.filter.weights import evidences, uniform_log_weights

    best = poses[int(log_likelihoods.sum(axis=0).argmax())]
    correlations = temperature.observe(measurements, best, {})
    carried = uniform_log_weights(poses.shape[0])
    fits = fit.of_each(measurements, evidences(carried, log_likelihoods)[1]) if as_run else None
    trusted = (parameters.fit_ignored, parameters.fit_trusted)
    alphas = temperature.resolve(
        measurements, log_likelihoods, carried, correlations, parameters.ess_target, fits, trusted
    )
    for measurement, alpha in zip(measurements, alphas, strict=True):
        if isinstance(measurement.alpha, str):
            effective = f", {alpha * measurement.count:.1f} of {measurement.count} independent" * (
                measurement.alpha == "auto"
            )
            console.remark(f"temperature of {measurement.sensor}: {alpha:.3f} ({measurement.alpha}{effective})")
    return alphas
