"""``mcl score --explain``: one pose, beam by beam and landmark by landmark."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mclcli.cli import pictures
from mclcli.cli.score.sensors import instruments
from mclcli.errors import UsageError
from mclcli.geometry import se2
from mclcli.io.traces.output import open_output
from mclcli.io.traces.sinks import csv_text
from mclcli.sensors import beams, bearing
from mclcli.sensors.explain import COMPONENTS, Explanation, explain_bearings
from mclcli.sensors.instruments import Camera, Lidar
from mclcli.sensors.models import lidar_entry

if TYPE_CHECKING:
    from collections.abc import Iterator

    from PIL.Image import Image

    from mclcli.arrays import FloatArray
    from mclcli.cli.one_scan import MountedScan
    from mclcli.cli.score.options import ScoreOptions
    from mclcli.sensors.instruments import Reading
    from mclcli.settings.profiles import Settings
    from mclcli.world.occupancy import OccupancyGrid

_HEADER = ("sensor", "name", "angle", "measured", "expected", "error", *COMPONENTS, "log_p")


def run(options: ScoreOptions, settings: Settings, grid: OccupancyGrid, scan: MountedScan, poses: FloatArray) -> None:
    """Write the table, and draw the picture, that the options ask for.

    Raises
    ------
    UsageError
        If there is not exactly one pose.

    """
    if len(poses) != 1:
        raise UsageError(f"--explain and --picture take one pose, not {len(poses)}; give one with --pose X,Y,YAW")
    rows = [
        (instrument.name, row)
        for instrument, reading, mount in instruments(options, settings, grid, scan, 1)
        for row in _explain(instrument, reading, mount, poses[0], settings.model)
    ]
    inputs = options.input_files
    if options.explain:
        with open_output(options.output or "-", binary=False, inputs=inputs) as output:
            output.write(",".join(_HEADER) + "\n")
            output.write("".join(_lines(rows)))
    if options.picture:
        lidar_rows = [row for sensor, row in rows if sensor == "lidar"]
        picture = _draw(grid, scan, settings, poses[0], lidar_rows)
        pictures.save(picture, options.picture, inputs)


def _explain(
    instrument: Lidar | Camera, reading: Reading, mount: FloatArray, pose: FloatArray, model: str
) -> list[Explanation]:
    if isinstance(instrument, Lidar):
        selected = beams.select(reading, mount, instrument.selection)  # type: ignore[arg-type]
        return lidar_entry(model).explain(instrument.model, selected, pose)
    seen = bearing.observe(reading, mount, instrument.landmarks)  # type: ignore[arg-type]
    return explain_bearings(instrument.model, seen, pose)


def _lines(rows: list[tuple[str, Explanation]]) -> Iterator[str]:
    for sensor, row in rows:
        numbers = (
            row.angle,
            row.measured,
            row.expected,
            row.error,
            *(row.shares.get(c) for c in COMPONENTS),
            row.log_p,
        )
        yield ",".join([sensor, csv_text(row.name), *map(_number, numbers)]) + "\n"


def _number(value: float | None) -> str:
    return "" if value is None or np.isnan(value) else repr(float(value))


def _draw(
    grid: OccupancyGrid,
    scan: MountedScan,
    settings: Settings,
    pose: FloatArray,
    rows: list[Explanation],
) -> Image:
    """The scan on the map from this pose, endpoints coloured by log p."""
    from mclcli.geometry import se3
    from mclcli.render.scan import draw_scan

    selected = beams.select(scan.scan, scan.base_from_sensor, settings.beams)
    seen = np.isfinite(selected.ranges) & (selected.ranges < selected.r_max)
    ends = np.full((len(rows), 3), np.nan)  # a beam that saw nothing ends nowhere
    ends[seen] = se2.compose(pose, np.column_stack([selected.endpoints[seen], np.zeros(np.count_nonzero(seen))]))
    x, y, yaw = pose
    total = sum(row.log_p for row in rows)
    return draw_scan(
        grid,
        se2.compose(pose, se3.to_planar(scan.base_from_sensor)),
        ends[:, :2],
        np.array([row.log_p for row in rows]),
        title=f"Scan at x {x:.2f} m, y {y:.2f} m, yaw {np.degrees(yaw):.1f}°",
        subtitle=f"{len(rows)} beams, {np.count_nonzero(~seen)} of them without a return; log p {total:.2f} in all",
    )
