"""Which pose of a reference belongs to which pose of a track, and what is left uncovered."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.errors import InputError
from mclcli.geometry import se2

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mclcli.arrays import BoolArray, FloatArray, IntArray
    from mclcli.evaluate import Method
    from mclcli.geometry.trajectory import Trajectory

    Pick = tuple[NDArray[np.intp], FloatArray]


@final
@dataclass(frozen=True, slots=True)
class Matching:
    """How stamps are brought together.

    ``interpolate``: the reference at each pose of the track, between two of its poses at most ``max_gap_ns`` apart.
    ``nearest``: each pose of the shorter of the two with the nearest in time of the longer, at most ``max_diff_ns``
    away; of two equally near the earlier one. evo pairs in the same way (``evo.core.sync``, default 0.01 s).
    """

    method: Method = "interpolate"
    max_gap_ns: int = 2_000_000_000
    max_diff_ns: int = 10_000_000


@final
@dataclass(frozen=True, slots=True, eq=False)
class Pairs:
    """M poses of a track, in order of time, each with the reference's.

    ``stamps_ns`` (M,) the track's; ``estimated`` and ``expected`` (M, 3); ``covariances`` (M, 3, 3) of the estimates,
    None if the track states none; ``updated`` (M,) whether a pose was measured; ``total`` poses of the track in all.
    ``pieces`` (M,) number the stretches without a hole: it counts up where poses in between have no partner and the
    hole is longer than ``max_gap_ns``.
    """

    stamps_ns: IntArray
    estimated: FloatArray
    expected: FloatArray
    covariances: FloatArray | None
    updated: BoolArray
    pieces: NDArray[np.intp]
    total: int

    @property
    def seconds(self) -> FloatArray:
        """Time since the first pair [s], (M,)."""
        return np.asarray((self.stamps_ns - self.stamps_ns[0]) * 1e-9, dtype=np.float64)


def associate(track: Trajectory, reference: Trajectory, matching: Matching = Matching()) -> Pairs:
    """Pair the poses of a track with a reference.

    Raises
    ------
    InputError
        If not one pose of the track has a partner.

    """
    picked, expected = (_interpolated if matching.method == "interpolate" else _nearest)(track, reference, matching)
    if not picked.size:
        raise InputError(f"the reference covers no stamp of the track: {_spans(track, reference)}")
    stamps = track.stamps_ns[picked]
    holes = (np.diff(picked) > 1) & (np.diff(stamps) > matching.max_gap_ns)
    return Pairs(
        stamps_ns=stamps,
        estimated=track.poses[picked],
        expected=expected,
        covariances=None if track.covariances is None else track.covariances[picked],
        updated=np.ones(picked.size, dtype=np.bool_) if track.updated is None else track.updated[picked],
        pieces=np.concatenate([[0], np.cumsum(holes)]),
        total=track.stamps_ns.size,
    )


def aligned(pairs: Pairs) -> tuple[Pairs, FloatArray]:
    """Pairs with the track moved rigidly so that its positions fit the reference's best, and that motion (3,).

    Least squares over SE(2), without scale: Umeyama 1991, eqs. 34 to 43, whose rotation in the plane is the angle of
    the sum of crosses over the sum of dots of the centred positions. One pair leaves the rotation undetermined: 0.
    """
    here, there = pairs.estimated[:, :2], pairs.expected[:, :2]
    a, b = here - here.mean(axis=0), there - there.mean(axis=0)
    crosses, dots = (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum(), (a * b).sum()
    turn = float(np.arctan2(crosses, dots))
    c, s = np.cos(turn), np.sin(turn)
    rotation = np.array([[c, -s], [s, c]])
    motion = np.array([*(there.mean(axis=0) - rotation @ here.mean(axis=0)), turn])
    covariances = pairs.covariances
    if covariances is not None:
        whole = np.eye(3)
        whole[:2, :2] = rotation
        covariances = whole @ covariances @ whole.T
    return replace(pairs, estimated=se2.compose(motion, pairs.estimated), covariances=covariances), motion


def _interpolated(track: Trajectory, reference: Trajectory, matching: Matching) -> Pick:
    expected, covered = reference.at(track.stamps_ns, matching.max_gap_ns)
    return np.flatnonzero(covered), expected[covered]


def _nearest(track: Trajectory, reference: Trajectory, matching: Matching) -> Pick:
    swap = track.stamps_ns.size > reference.stamps_ns.size
    short, long = (reference, track) if swap else (track, reference)
    partner, apart = _nearest_index(short.stamps_ns, long.stamps_ns)
    near = np.flatnonzero(apart <= matching.max_diff_ns)
    mine, theirs = (partner[near], near) if swap else (near, partner[near])
    return mine, reference.poses[theirs]


def _nearest_index(stamps_ns: IntArray, among_ns: IntArray) -> tuple[NDArray[np.intp], IntArray]:
    """For each stamp the nearest of others (sorted), the earlier one of two, and how far it is away [ns]."""
    after = np.minimum(np.searchsorted(among_ns, stamps_ns), among_ns.size - 1)
    before = np.maximum(after - 1, 0)
    late, early = np.abs(among_ns[after] - stamps_ns), np.abs(among_ns[before] - stamps_ns)
    return np.where(early <= late, before, after), np.minimum(early, late)


def _spans(track: Trajectory, reference: Trajectory) -> str:
    """When the two are, for a message."""
    spans = [f"@{t.stamps_ns[0] * 1e-9:.3f} to @{t.stamps_ns[-1] * 1e-9:.3f}" for t in (track, reference)]
    return f"the track is from {spans[0]}, the reference from {spans[1]}; are both of the same log and clock?"
