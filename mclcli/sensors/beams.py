"""From a laser scan to the beams that are scored: which readings count, and where they point from the base."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Literal, final, get_args

import numpy as np

from mclcli.errors import InputError, UsageError
from mclcli.parameters import parameter, validate
from mclcli.quantity import FARTHEST, MOST_TURNED

if TYPE_CHECKING:
    from collections.abc import Callable

    from mclcli.arrays import BoolArray, FloatArray, IntArray
    from mclcli.records import LaserScan

    Sweep = Callable[[IntArray], FloatArray]  # beams' numbers (K,) to poses (K, 3) of the base


MaxRange = Literal["skip", "score", "no_return", "keep_equal", "as_read"]
ShortRange = Literal["skip", "max"]
BeamSubsampling = Literal["even_valid", "even", "stride", "stride_ceil"]
BeamAngles = Literal["exact", "nav2"]
BeamOrigin = Literal["sensor", "base"]
RangeOfRand = Literal["smaller", "parameter"]


@final
@dataclass(frozen=True, slots=True)
class BeamSelection:
    """Which readings of a scan are scored."""

    max_beams: int = parameter(60, "beams scored per scan, evenly chosen; 0 takes all", low=0, in_nav2=True)
    laser_min_range: float = parameter(
        -1.0,
        "readings up to this are invalid; the larger of it and the scan's own; ≤ 0: the scan's",
        unit="m",
        in_nav2=True,
    )
    laser_max_range: float = parameter(
        -1.0,
        "readings from this on are no return; the smaller of it and the scan's own; ≤ 0: the scan's",
        unit="m",
        in_nav2=True,
    )
    max_range: MaxRange = parameter(
        "skip",
        "readings ≥ the maximum range: left out; clamped to [0, maximum] and scored, like those ≤ the minimum; scored "
        "as the maximum; left out only above it; or taken as they are",
        choices=get_args(MaxRange),
    )
    short_range: ShortRange = parameter(
        "skip", "readings ≤ the minimum range: left out, or taken for the maximum", choices=get_args(ShortRange)
    )
    beam_subsampling: BeamSubsampling = parameter(
        "even_valid",
        "max_beams chosen evenly after or before invalid ones are dropped, or every (n−1)/(K−1)th or ⌈n/K⌉th beam",
        choices=get_args(BeamSubsampling),
    )
    beam_angles: BeamAngles = parameter(
        "exact",
        "beam angles through the mount, or as nav2_amcl forms them in single precision",
        choices=get_args(BeamAngles),
    )
    beam_origin: BeamOrigin = parameter(
        "sensor",
        "beams start at the lidar, or at the base, as straight lines to where they end",
        choices=get_args(BeamOrigin),
    )
    range_offset: float = parameter(
        0.0,
        "added to a range for where its beam ends, by models that look at ends alone: how far walls' faces are before "
        "the centres of their cells; `mcl smooth` tells it",
        unit="m",
        low=-1.0,
        high=1.0,
    )
    range_of_rand: RangeOfRand = parameter(
        "smaller",
        "z_rand is spread over the smaller maximum range, or over laser_max_range whatever the scan says",
        choices=get_args(RangeOfRand),
    )

    def __post_init__(self) -> None:
        validate(self)
        if self.range_of_rand == "parameter" and not self.laser_max_range > 0.0:
            raise UsageError(
                f"parameter laser_max_range = {self.laser_max_range:g}: must be above 0 with range_of_rand=parameter; "
                "set it, or --set range_of_rand=smaller"
            )


@final
@dataclass(frozen=True, slots=True, eq=False)
class Beams:
    """B beams seen from the base at the scan's stamp.

    ``origins`` (B, 2) [m] and ``directions`` (B, 2) in the base frame: beam i of range r ends at
    ``origins + r·directions`` on the ground plane (a tilted lidar's directions are shorter than 1).
    ``ranges`` (B,) [m]; ``r_max`` [m] the range from which on nothing was seen. ``indices`` (B,) are the beams' numbers
    in the scan; ``slots`` how many beams there would be if none were invalid. ``offset`` [m] lies between what was
    measured and where a beam ends on the map.
    """

    origins: FloatArray
    directions: FloatArray
    ranges: FloatArray
    r_max: float
    indices: IntArray = field(default_factory=lambda: np.zeros(0, np.int64))
    slots: int = 0
    offset: float = 0.0

    @property
    def endpoints(self) -> FloatArray:
        """Endpoints (B, 2) [m] in the base frame."""
        ranges = self.ranges + self.offset if self.offset else self.ranges
        return self.origins + ranges[:, np.newaxis] * self.directions

    def with_return(self) -> Beams:
        """The beams that end somewhere."""
        ending = np.isfinite(self.ranges)
        return self if ending.all() else self.subset(ending)

    def subset(self, kept: BoolArray) -> Beams:
        """The beams that ``kept`` (B,) marks."""
        indices = self.indices[kept] if self.indices.size else self.indices
        return replace(
            self,
            origins=self.origins[kept],
            directions=self.directions[kept],
            ranges=self.ranges[kept],
            indices=indices,
        )


def problem_of(scan: LaserScan) -> str:
    """Why nothing is known of where a scan's beams point, empty if it is known."""
    if not (math.isfinite(scan.angle_min) and math.isfinite(scan.angle_increment)):
        return "scan with angles not finite"
    last = scan.angle_min + (scan.ranges.size - 1) * scan.angle_increment
    furthest = max(abs(scan.angle_min), abs(last))
    return "" if furthest <= MOST_TURNED else f"scan with angles up to {furthest:g} rad"


def maximum_range(scan: LaserScan, selection: BeamSelection) -> float:
    """r_max [m]: the smaller of the scan's range_max and ``laser_max_range``, where set; at most ``FARTHEST``.

    Raises
    ------
    InputError
        If neither is a positive finite number.

    """
    limits = [r for r in (scan.range_max, selection.laser_max_range) if math.isfinite(r) and r > 0.0]
    if not limits:
        raise InputError(
            f"scan of frame '{scan.frame_id}': range_max is {scan.range_max:g} and laser_max_range is not set; "
            "give --set laser_max_range=METRES"
        )
    return min(*limits, FARTHEST)


def select(
    scan: LaserScan, base_from_sensor: FloatArray, selection: BeamSelection, sweep: Sweep | None = None
) -> Beams:
    """Beams of a scan to score, through the sensor's mount (4, 4) with its full 3-D rotation.

    ``sweep`` says where the base was at each beam, seen from the base that the beams are wanted for. Origins and
    directions are finite and bounded, ranges as well, or +inf where nothing was seen and ``max_range=as_read``.

    Raises
    ------
    InputError
        If nothing is known of how far the lidar sees, where its beams point or where it sits.

    """
    problem = problem_of(scan)
    if not problem and not np.isfinite(base_from_sensor).all():
        problem = "scan from a lidar whose place on the base is not finite"
    if problem:
        raise InputError(f"frame '{scan.frame_id}': {problem}; it cannot be scored")
    r_max = maximum_range(scan, selection)
    ranges = _prepared(scan, selection, r_max)
    valid = ~np.isnan(ranges)
    chosen, slots = _subsample(valid, selection)
    chosen = chosen[valid[chosen]]
    lidar = scan.angle_min, scan.angle_increment, scan.ranges.size
    directions = _directions(*lidar, base_from_sensor.tobytes(), selection.beam_angles)[chosen]
    origins = np.empty(directions.shape)
    origins[:] = base_from_sensor[:2, 3]
    if sweep is not None:
        origins, directions = _swept(origins, directions, sweep(chosen))
    spread = selection.laser_max_range if selection.range_of_rand == "parameter" else r_max
    beams = Beams(origins, directions, ranges[chosen], spread, chosen, slots, selection.range_offset)
    return _from_base(beams) if selection.beam_origin == "base" else beams


def _swept(origins: FloatArray, directions: FloatArray, bases: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Origins and directions (K, 2) of beams, each from a base of its own (K, 3)."""
    c, s = np.cos(bases[:, 2]), np.sin(bases[:, 2])

    def turned(v: FloatArray) -> FloatArray:
        return np.stack([c * v[:, 0] - s * v[:, 1], s * v[:, 0] + c * v[:, 1]], axis=-1)

    return bases[:, :2] + turned(origins), turned(directions)


def _from_base(beams: Beams) -> Beams:
    """Virtual beams from the base to where the real ones end, as Beluga's beam model takes them."""
    nothing = np.isinf(beams.ranges)
    ends = replace(beams, ranges=np.where(nothing, FARTHEST, beams.ranges), offset=0.0).endpoints
    ranges = np.hypot(ends[:, 0], ends[:, 1])
    directions = ends / np.maximum(ranges, np.finfo(np.float64).tiny)[:, np.newaxis]
    return replace(beams, origins=np.zeros_like(ends), directions=directions, ranges=np.where(nothing, np.inf, ranges))


def _prepared(scan: LaserScan, selection: BeamSelection, r_max: float) -> FloatArray:
    """Ranges (B,) as they are scored, NaN where a reading is left out."""
    ranges: FloatArray = scan.ranges
    if selection.short_range == "max":
        ranges = np.asarray(np.where(ranges <= _minimum_range(scan, selection), r_max, ranges), np.float64)
    if selection.max_range == "score":
        return np.clip(ranges, 0.0, r_max)
    if selection.max_range == "as_read":
        there = np.abs(ranges) <= FARTHEST
        return ranges if there.all() else np.where(there, ranges, np.where(ranges > 0.0, np.inf, np.nan))
    minimum = _minimum_range(scan, selection)
    if selection.max_range == "no_return":
        return np.where(ranges > minimum, np.minimum(ranges, r_max), np.nan)
    if selection.max_range == "keep_equal":
        valid = (ranges >= minimum) & (ranges <= r_max)
    else:
        valid = (ranges > minimum) & (ranges < r_max)
    return np.where(valid, ranges, np.nan)  # comparisons with NaN are false


def _minimum_range(scan: LaserScan, selection: BeamSelection) -> float:
    return max(scan.range_min, selection.laser_min_range)


def _subsample(valid: BoolArray, selection: BeamSelection) -> tuple[IntArray, int]:
    """Indices of the beams looked at, and how many there can be."""
    n, k = valid.size, selection.max_beams
    if selection.beam_subsampling == "even_valid":
        found = np.flatnonzero(valid)
        chosen = found[_evenly(found.size, k)]
        return chosen, chosen.size
    if selection.beam_subsampling == "even":
        chosen = _evenly(n, k)
        return chosen, chosen.size
    if k == 0:
        return np.arange(n), n
    step = -(-n // k) if selection.beam_subsampling == "stride_ceil" else (n - 1) // max(k - 1, 1)
    return np.arange(0, n, max(step, 1)), k


@functools.lru_cache(maxsize=8)
def _directions(angle_min: float, increment: float, count: int, mount: bytes, rule: BeamAngles) -> FloatArray:
    """Directions (count, 2) of all beams of a lidar on its ``mount`` (4, 4): the same in every scan."""
    base_from_sensor = np.frombuffer(mount).reshape(4, 4)
    if rule == "nav2":
        angles = _nav2_angles(angle_min, increment, count, base_from_sensor)
        return np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    angles = angle_min + np.arange(count, dtype=np.float64) * increment
    cos, sin = np.cos(angles), np.sin(angles)
    (a, b), (c, d) = base_from_sensor[:2, :2].tolist()  # term by term: what BLAS adds up depends on the number of beams
    return np.stack([a * cos + b * sin, c * cos + d * sin], axis=-1)


def _nav2_angles(angle_min: float, increment: float, count: int, base_from_sensor: FloatArray) -> FloatArray:
    """Angles in the base frame as nav2_amcl derives them: two beams are turned, their difference is the increment.

    The sum of start and increment is formed in single precision, so that the last beams are off by up to 5e-5 rad.
    """
    second = float(np.float32(angle_min) + np.float32(increment))
    yaws = []
    for angle in (angle_min, second):
        ray = base_from_sensor[:3, :3] @ np.array([math.cos(angle), math.sin(angle), 0.0])
        yaws.append(math.atan2(ray[1], ray[0]))
    turned = math.fmod(yaws[1] - yaws[0] + 5.0 * math.pi, 2.0 * math.pi) - math.pi
    return yaws[0] + np.arange(count, dtype=np.float64) * turned


@functools.lru_cache(maxsize=1024)
def _evenly(n: int, k: int) -> IntArray:
    """k of n indices, the first and the last among them: ⌈i(n−1)/(k−1)⌉; all where k is 0 or at least n."""
    if k in {0, n} or k > n:
        chosen = np.arange(n)
    elif k == 1:
        chosen = np.zeros(1, np.int64)
    else:
        chosen = -(-np.arange(k) * (n - 1) // (k - 1))
    chosen.flags.writeable = False
    return chosen
