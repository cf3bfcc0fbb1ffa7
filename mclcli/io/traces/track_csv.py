"""The track as CSV: a row per scan within odometry."""

from __future__ import annotations

from typing import TYPE_CHECKING, final

from mclcli.io.traces.formats import Format, Writer
from mclcli.io.traces.sinks import COVARIANCE_COLUMNS, covariance_text, require_finite, stamp_text

if TYPE_CHECKING:
    from mclcli.io.traces.formats import About
    from mclcli.io.traces.output import Output
    from mclcli.io.traces.sinks import TextSink
    from mclcli.records import TrackPoint


@final
class TrackCsv:
    """Writes ``stamp,x,y,yaw,cov_xx,…,updated,segment``: 9 decimals, covariances with 9 significant digits.

    ``updated`` is 1 where the scan took part, 0 where the last estimate was carried on by odometry.
    """

    __slots__ = ("_stream",)

    def __init__(self, stream: TextSink) -> None:
        self._stream = stream
        stream.write(f"stamp,x,y,yaw,{COVARIANCE_COLUMNS},updated,segment\n")

    def write(self, point: TrackPoint) -> None:
        """Append one row; a ValueError if the estimate is not finite."""
        require_finite("pose", point.estimate.pose)
        x, y, yaw = point.estimate.pose.tolist()
        covariance = covariance_text(point.estimate.covariance)
        where = f"{stamp_text(point.stamp_ns)},{x:.9f},{y:.9f},{yaw:.9f}"
        self._stream.write(f"{where},{covariance},{point.updated:d},{point.segment}\n")

    def close(self) -> None:
        """Nothing is left to write."""


def _track(output: Output, about: About) -> Writer:
    del about
    track = TrackCsv(output)
    return Writer(track.write, track.close)


TRACK = Format(_track)
