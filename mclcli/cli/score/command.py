"""``mcl score``: poses against one scan."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mclcli.cli import options
from mclcli.errors import InputError

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray
    from mclcli.sensors import Measurement


@click.command("score", short_help="Score poses of a robot against one scan.")
@click.argument("scan", metavar="SCAN")
@click.option("--map", "map_file", required=True, type=click.Path(path_type=Path), help="Map, a map_server YAML.")
@click.option("--at", metavar="TIME", help="Of a log: the scan nearest to this time.")
@click.option("--index", metavar="N", type=click.IntRange(min=0), help="Of a log: the scan of this number, from 0.")
@click.option("--scan-topic", metavar="TOPIC", help="Of a log: the topic of the scan.")
@click.option(
    "--pose",
    "given",
    multiple=True,
    metavar="X,Y,YAW",
    callback=options.parse_poses,
    help="A pose of the base in map; repeatable.",
)
@click.option(
    "--poses", "poses_file", metavar="FILE", help="CSV with columns x, y, yaw; other columns are passed on; - is stdin."
)
@click.option("--around", metavar="X,Y,YAW", callback=options.parse_pose, help="Draw poses around this one.")
@click.option(
    "--spread",
    metavar="SXY,SYAW",
    default="0.5,15deg",
    show_default=True,
    help="Standard deviations of the poses drawn.",
)
@click.option(
    "-n",
    "--number",
    metavar="N",
    type=click.IntRange(min=1),
    default=1000,
    show_default=True,
    help="How many poses to draw.",
)
@click.option(
    "--seed", metavar="N", type=click.IntRange(min=0), default=0, show_default=True, help="Seed of the poses drawn."
)
@click.option(
    "--grid",
    "lattice",
    metavar="STEP[,YAWSTEP]",
    help="Poses on a lattice over the free cells; YAWSTEP is 5deg if not given.",
)
@click.option("--landmarks", type=click.Path(path_type=Path), help="Landmarks, CSV or YAML: id, x, y[, z].")
@click.option("--bearings", type=click.Path(path_type=Path), help="Bearings seen, CSV: id, bearing.")
@click.option(
    "-o",
    "--output",
    metavar="FILE",
    help="CSV or .mcap, - is stdout; CSV on stdout if neither this nor --heatmap is given.",
)
@click.option("--heatmap", metavar="F.png", help="Draw the likelihood over x, y (best over yaw).")
@click.option("--explain", is_flag=True, help="For one pose: a row per beam and landmark instead of one per pose.")
@click.option("--picture", metavar="F.png", help="With --explain: draw the scan on the map, coloured by log p.")
@options.parameters
@options.model
@options.map_limits
@options.threads
@options.common
def command(**arguments: Any) -> None:
    """Log-likelihood and weight of every pose for one SCAN: a LaserScan as YAML or JSON, - for stdin, or a log.

    \b
        mcl extract LOG --at 12.3 | mcl score - --map m.yaml --around 1,2,90deg -n 1000 | sort -t, -k5 -g | tail
    """  # noqa: D301 - click's mark for a verbatim paragraph
    from mclcli.cli.one_scan import find_scan
    from mclcli.cli.score import explain, output
    from mclcli.cli.score import poses as score_poses
    from mclcli.cli.score.sensors import input_files, instruments
    from mclcli.filter import scoring, weights
    from mclcli.io.maps.map_yaml import load_map

    chosen = options.choose_settings(arguments, {"max_beams": 0})
    settings = chosen.settings
    grid = load_map(arguments["map_file"], max_cells=arguments["max_cells"], allow_outside=arguments["allow_outside"])
    scan = find_scan(arguments, chosen)
    candidates = score_poses.collect(arguments, grid)
    if arguments["explain"] or arguments["picture"]:
        explain.run(arguments, settings, grid, scan, candidates.poses)
        return
    used = instruments(arguments, settings, grid, scan, len(candidates.poses))
    measurements = [instrument.measure(reading, mount) for instrument, reading, mount in used]
    log_likelihoods = scoring.score(measurements, candidates.poses)
    alphas = _alphas(measurements, log_likelihoods, candidates.poses, settings.filter.ess_target)
    log_weights = scoring.temper(alphas, log_likelihoods)
    if not weights.usable(log_weights):
        raise InputError("no pose has a weight: every likelihood is zero or not a number; check the poses")
    result = output.Scores(
        candidates, measurements, alphas, log_likelihoods, log_weights, weights.normalise(log_weights)
    )
    inputs = input_files(arguments)
    if arguments["output"] or not arguments["heatmap"]:
        output.write(result, arguments["output"] or "-", inputs, scan, grid)
    if arguments["heatmap"]:
        output.draw(result, arguments["heatmap"], inputs, grid, Path(arguments["map_file"]).name)


def _alphas(
    measurements: list[Measurement],
    log_likelihoods: FloatArray,
    poses: FloatArray,
    ess_target: float,
) -> tuple[float, ...]:
    """Temperatures; ``auto`` looks at the beams from the likeliest pose, ``ess`` at equally weighted poses."""
    from mclcli.cli import console
    from mclcli.filter import temperature
    from mclcli.filter.state import uniform_log_weights

    best = poses[int(log_likelihoods.sum(axis=0).argmax())]
    correlations = temperature.observe(measurements, best, {})
    carried = uniform_log_weights(poses.shape[0])
    alphas = temperature.resolve(measurements, log_likelihoods, carried, correlations, ess_target)
    for measurement, alpha in zip(measurements, alphas, strict=True):
        if isinstance(measurement.alpha, str):
            effective = f", {alpha * measurement.count:.1f} of {measurement.count} independent" * (
                measurement.alpha == "auto"
            )
            console.remark(f"temperature of {measurement.sensor}: {alpha:.3f} ({measurement.alpha}{effective})")
    return alphas
