"""``mcl dt``: distance fields."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, final, get_args

import click

from mclcli.cli import completion, options
from mclcli.cli.parse import named, parse_picture
from mclcli.world import FieldMethod

if TYPE_CHECKING:
    from pathlib import Path

    from mclcli.world.distance_field import DistanceField
    from mclcli.world.occupancy import OccupancyGrid


@final
@dataclass(frozen=True, slots=True)
class FieldOptions:
    """What ``mcl dt`` is asked for."""

    map_file: Path
    method: FieldMethod
    max_dist: float
    output: str | None
    png: str | None
    as_json: bool
    no_cache: bool
    map_limits: options.MapLimits


@click.command("dt", short_help="Compute (or find in the cache) the distance field of a map.")
@options.map_file
@click.option(
    "--method",
    type=click.Choice(get_args(FieldMethod)),
    default="exact",
    show_default=True,
    help="Euclidean distances, or shortest 8-neighbour paths.",
)
@click.option(
    "--max-dist", type=float, default=2.0, show_default=True, metavar="M", help="Distances are clamped here [m]."
)
@click.option(
    "-o",
    "--output",
    metavar="F.npy",
    callback=named(".npy"),
    help="Write the field: float64 metres, row 0 at the bottom; - is stdout.",
)
@click.option("--png", metavar="F.png", shell_complete=completion.files, callback=parse_picture, help="Draw the field.")
@options.as_json
@click.option("--no-cache", is_flag=True, help="Neither read nor write the cache.")
@options.map_limits
@options.common
@options.into(FieldOptions)
def command(dt: FieldOptions) -> None:
    """Compute the distance from every cell of MAP to the nearest occupied one; the cache keeps it for others."""
    from mclcli.cli import console, results
    from mclcli.io.maps import field_cache
    from mclcli.world import distance_field

    results.keep_stdout_free((dt.output,), as_json=dt.as_json)
    map_file, method, max_dist = dt.map_file, dt.method, dt.max_dist
    grid = dt.map_limits.load(map_file)
    began = time.perf_counter()
    if dt.no_cache:
        field, hit, where = distance_field.compute(grid, method, max_dist), False, ""
    else:
        field, hit = field_cache.cached_field(grid, method, max_dist)
        where = str(field_cache.field_path(grid, method, max_dist))
    seconds = time.perf_counter() - began
    occupied = int(grid.occupied.sum())
    if not occupied:
        console.warn(
            f"{map_file}: no cell is occupied, so the field is {max_dist:g} m everywhere; check the thresholds"
        )
    _write(field, grid, dt)
    summary = {
        "map": map_file.name,
        "width": grid.width,
        "height": grid.height,
        "resolution": grid.resolution,
        "occupied": occupied,
        "method": method,
        "max_dist": max_dist,
        "milliseconds": round(seconds * 1e3, 1),
        "cache": "off" if dt.no_cache else "hit" if hit else "miss",
        "file": where,
    }
    if dt.as_json:
        results.print_json(summary)
    else:  # with the field itself on stdout it is a remark
        click.echo(_sentence(summary), err=dt.output == "-")


def _sentence(summary: dict[str, object]) -> str:
    text = (
        "{map}: {width} x {height} cells of {resolution:g} m, {occupied} occupied; {method} field to {max_dist:g} m in "
        "{milliseconds:g} ms, cache {cache} {file}"
    )
    return text.format(**summary).rstrip()


def _write(field: DistanceField, grid: OccupancyGrid, dt: FieldOptions) -> None:
    import io

    from mclcli.cli import pictures
    from mclcli.io.traces.output import open_output

    if dt.output is not None:
        import numpy as np

        buffer = io.BytesIO()
        np.save(buffer, field.metres(), allow_pickle=False)
        with open_output(dt.output, binary=True, inputs=[dt.map_file]) as target:
            target.write(buffer.getvalue())
    if dt.png is not None:
        from mclcli.render.field import draw_field

        title = f"Distance to the nearest obstacle — {dt.map_file.name}"
        picture = draw_field(grid, field.metres(), max_dist=field.max_dist, title=title, subtitle="")
        pictures.save(picture, dt.png, inputs=[dt.map_file])
