"""A track that is a count: how many points and transforms a run had, written at its end, and as bytes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mclcli.io.traces.formats import Format, Writer

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mclcli.io.traces.formats import About
    from mclcli.io.traces.output import Output
    from mclcli.records import TrackPoint, Transform


def make(output: Output, about: About) -> Writer:
    """Begin the count."""
    seen = {"points": 0, "transforms": 0}

    def write(point: TrackPoint) -> None:
        seen["points"] += point.stamp_ns > 0

    def transforms(stamp_ns: int, recorded: Sequence[Transform]) -> None:
        seen["transforms"] += len(recorded) if stamp_ns > 0 else 0

    def close() -> None:
        output.write(f"{about.map_frame} {seen['points']} {seen['transforms']}\n".encode())

    return Writer(write, close, transforms)


TOY = Format(make, binary=True)
