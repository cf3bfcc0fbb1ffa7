"""What ``mcl locate`` gives back: rows or JSON, a picture, a sentence."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.cli import console, pictures
from mclcli.cli.one_scan import is_log
from mclcli.errors import InputError
from mclcli.io.traces.sinks import stamp_text

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from mclcli.cli.locate.options import LocateOptions
    from mclcli.replay.finder import GlobalSearch
    from mclcli.search.locating import Location, Mode
    from mclcli.sensors.observation import Observation
    from mclcli.world.occupancy import OccupancyGrid

_LONG_NS = 30 * 10**9  # a window that is no longer than this may be longer
COLUMNS = (
    "stamp", "rank", "x", "y", "yaw", "cov_xx", "cov_xy", "cov_xyaw", "cov_yy", "cov_yyaw", "cov_yawyaw",
    "log_likelihood", "log_beam", "share", "share_low", "share_high", "not_on_map",
)  # fmt: skip


@final
class Results:
    """Searches one after the other, as text; the last one is remembered for the picture."""

    def __init__(
        self, options: LocateOptions, search: GlobalSearch, grid: OccupancyGrid, inputs: Sequence[Path]
    ) -> None:
        self._options = options
        self._search = search
        self._grid = grid
        self._inputs = inputs
        self._last: tuple[Location, Sequence[Observation]] | None = None
        self.count = 0
        self.ambiguous = 0

    @property
    def header(self) -> str:
        """First line of the CSV; JSON has none."""
        return "" if self._options.as_json else ",".join(COLUMNS) + "\n"

    def add(self, moment: Sequence[Observation]) -> str:
        """Search, and say what was found.

        Raises
        ------
        InputError
            If the scan has no beam that says anything.

        """
        location = self._search.find(moment, self._options.number)
        if location is None or not location.beams:
            raise InputError(
                f"{self._options.source.scan}: the scan has no reading between its minimum and maximum range; "
                "it says nothing about where it was taken"
            )
        self._last = (location, moment)
        self.count += 1
        self.ambiguous += location.modes[0].share < self._options.min_share
        stamp_ns = moment[-1].reading.stamp_ns
        if self._options.as_json:
            return json.dumps(_as_json(location, stamp_ns, self._options.min_share)) + "\n"
        return "".join(_lines(location, stamp_ns))

    def conclude(self) -> None:
        """Draw what was asked for, and sum up on stderr."""
        assert self._last is not None  # noqa: S101 - the caller counted
        location, moment = self._last
        best = location.modes[0]
        if self._options.picture:
            self._draw(self._options.picture, location, moment)
        if self.count > 1:
            console.remark(f"{self.count} scans, {self.count - self.ambiguous} of them unambiguous")
            return
        x, y, yaw = best.pose
        console.remark(
            f"{_verdict(location, self._options.min_share)}{x:.3f},{y:.3f},{np.degrees(yaw):.2f}deg with probability "
            f"{_floor(best.share)}; log-likelihood {best.log_likelihood:.2f}, the greatest of {location.poses} poses "
            f"{location.maximum:.2f}; not on this map {_floor(location.elsewhere)}"
        )
        if self.ambiguous:
            console.remark(_advice(location, self._options))

    def _draw(self, target: str, location: Location, moment: Sequence[Observation]) -> None:
        from mclcli.geometry import se2
        from mclcli.render.modes import draw_modes

        view = self._search.view(moment)
        assert view is not None  # noqa: S101 - it has been searched with
        poses = np.array([mode.pose for mode in location.modes])
        ends = np.column_stack([view.beams.endpoints, np.zeros(len(view.beams.endpoints))])
        picture = draw_modes(
            self._grid,
            poses,
            np.array([mode.share for mode in location.modes]),
            se2.compose(poses[0], ends)[:, :2],
            title=f"Where the scan was taken on {self._options.map_file.name}",
            subtitle=f"best place {_floor(location.modes[0].share)}, not on this map {_floor(location.elsewhere)}; "
            f"{location.beams} beams, {location.poses:.3g} poses, temperature {location.alpha:.2f}",
        )
        pictures.save(picture, target, self._inputs)


def _verdict(location: Location, min_share: float) -> str:
    """What is to be thought of the best place, before it is named."""
    best = location.modes[0].share
    if location.elsewhere > max(best, 0.5):
        return f"not on this map (probability {_floor(location.elsewhere)}); if it is, then rather at "
    return "ambiguous: " if best < min_share else ""


def _advice(location: Location, options: LocateOptions) -> str:
    """What may help."""
    if location.elsewhere > max(location.modes[0].share, 0.5):
        return "give the map of where the robot was, or a lower --set off_map_prior=P if this one is sure to be it"
    path = Path(options.source.scan)
    longer = "a longer --window, " if (options.window_ns or 0) < _LONG_NS and path.exists() and is_log(path) else ""
    return f"{longer}--prior or --region may tell the places apart"


def _floor(share: float) -> str:
    """Probability, never rounded up to certainty."""
    return f"{np.floor(share * 1e4) / 1e4:g}"


def _numbers(mode: Mode) -> list[float]:
    upper = mode.covariance[np.triu_indices(3)].tolist()
    return [*mode.pose.tolist(), *upper, mode.log_likelihood, mode.log_beam, mode.share, mode.low, mode.high]


def _not_listed(location: Location) -> float:
    """Probability of all places on the map but those listed."""
    return max(0.0, 1.0 - location.elsewhere - sum(mode.share for mode in location.modes))


def _lines(location: Location, stamp_ns: int) -> Iterator[str]:
    for rank, mode in enumerate(location.modes):
        texts = ["" if np.isnan(value) else repr(float(value)) for value in [*_numbers(mode), location.elsewhere]]
        yield ",".join([stamp_text(stamp_ns), str(rank + 1), *texts]) + "\n"


def _as_json(location: Location, stamp_ns: int, min_share: float) -> dict[str, object]:
    """Everything that is known of one search."""
    modes = []
    for rank, mode in enumerate(location.modes):
        numbers = [None if np.isnan(value) else float(value) for value in _numbers(mode)]
        terms = {name: float(value) for name, value in mode.terms.items()}
        modes.append({"rank": rank + 1, **dict(zip(COLUMNS[2:-1], numbers, strict=True)), "evidence": terms})
    return {
        "stamp": stamp_text(stamp_ns),
        "ambiguous": bool(location.modes[0].share < min_share),
        "modes": modes,
        "not_on_map": float(location.elsewhere),
        "not_listed": float(_not_listed(location)),
        "maximum": float(location.maximum),
        "lattice": {"cell": location.cell, "angle": location.angle, "poses": location.poses},
        "temperature": location.alpha,
        "beams": location.beams,
        "enumerated": {"nats": location.nats, "poses": location.leaves},
    }
