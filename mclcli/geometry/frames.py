"""The tree of coordinate frames, from the transforms of a log."""

from __future__ import annotations

import math
from bisect import bisect_left
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.geometry import se3

if TYPE_CHECKING:
    from collections.abc import Iterable

    from mclcli.arrays import FloatArray
    from mclcli.records import Transform

FIXED_M, FIXED_RAD = 1e-4, math.radians(0.01)
"""An edge that moves and turns by no more than this is fixed: physics engines publish mounts that tremble."""
_SAME = np.full((4, 4), FIXED_RAD)  # a matrix differs by no more than this from one that is turned by so much
_SAME[:3, 3] = FIXED_M


@final
class _Edge:
    """One parent-to-child edge; it moves once a value has arrived that is not that of the first."""

    __slots__ = ("first", "matrices", "moves", "parent", "stamps")

    def __init__(self, parent: str, first: FloatArray) -> None:
        self.parent = parent
        self.first = first
        self.moves = False
        self.stamps: list[int] = []
        self.matrices: list[FloatArray] = []

    def add(self, stamp_ns: int, matrix: FloatArray, *, keep: bool) -> None:
        """Take in the transform (4, 4) at a stamp; without ``keep`` only whether it ever changes."""
        self.moves = self.moves or bool((np.abs(self.first - matrix) > _SAME).any())
        if keep and (not self.stamps or stamp_ns > self.stamps[-1]):
            self.stamps.append(stamp_ns)
            self.matrices.append(matrix)

    def replayed(self) -> _Edge:
        """The same edge without its history."""
        edge = _Edge(self.parent, self.first)
        edge.moves = self.moves
        return edge

    def at(self, stamp_ns: int) -> FloatArray | None:
        """Value at a stamp, interpolated, never extrapolated."""
        if not self.moves:
            return self.first
        after = bisect_left(self.stamps, stamp_ns)
        if after == len(self.stamps) or (after == 0 and self.stamps[0] != stamp_ns):
            return None
        if self.stamps[after] == stamp_ns:
            return self.matrices[after]
        before_ns = self.stamps[after - 1]
        fraction = (stamp_ns - before_ns) / (self.stamps[after] - before_ns)
        return se3.interpolate(self.matrices[after - 1], self.matrices[after], fraction)

    def forget_before(self, stamp_ns: int) -> None:
        """Drop what is needed at no stamp from this one on."""
        unneeded = bisect_left(self.stamps, stamp_ns) - 1
        if unneeded > 0:
            del self.stamps[:unneeded], self.matrices[:unneeded]


@final
class TransformTree:
    """Frames and the transforms between them, growing as messages arrive.

    Static transforms, and others whose value never changes, hold at all times wherever they stand in the log. A
    survey's tree keeps no history: it knows which edges move, and the values of those that do not.

    A frame has one parent, the latest. Where two nodes state it below different parents by turns, ``contested`` names
    them, and ``choose_parent`` says which one counts from then on.
    """

    def __init__(self, *, keep_history: bool = True) -> None:
        self._keep_history = keep_history
        self._edges: dict[str, _Edge] = {}
        self._left: dict[str, dict[str, _Edge]] = {}  # by child, edges to parents that it had before
        self._returned: set[str] = set()  # children that went back to a parent that they had left
        self._chosen: dict[str, str] = {}
        self._fixed: dict[tuple[str, str], FloatArray] = {}  # looked up where nothing moves

    def __repr__(self) -> str:
        return f"TransformTree({len(self._edges)} edges)"

    def replayed(self) -> TransformTree:
        """Tree for reading the log again: what never moves is known from the start, what moves is not known yet."""
        tree = TransformTree()
        self.hand_down(tree)
        return tree

    @classmethod
    def union(cls, trees: Iterable[TransformTree]) -> TransformTree:
        """A tree with the edges of several, without history; where two know a frame, the earlier one counts."""
        result = cls(keep_history=False)
        for tree in trees:
            tree.hand_down(result)
        return result

    def hand_down(self, other: TransformTree) -> None:
        """Let another tree have what it does not know."""
        for child in self._edges.keys() - other._edges.keys():
            other._edges[child] = self._edges[child].replayed()
            if child in self._chosen:
                other._chosen[child] = self._chosen[child]

    def add(self, transform: Transform) -> None:
        """Take one transform in; a frame's latest parent counts, and so does a static transform's latest value."""
        edge = self._edges.get(transform.child)
        if edge is None or edge.parent != transform.parent or transform.static:
            if self._chosen.get(transform.child, transform.parent) != transform.parent:
                return
            edge = self._replace(edge, transform)
        if not transform.static:
            moved = edge.moves
            edge.add(transform.stamp_ns, transform.parent_from_child, keep=self._keep_history)
            if edge.moves is not moved:
                self._fixed.clear()

    def _replace(self, edge: _Edge | None, transform: Transform) -> _Edge:
        """The edge that a transform begins, or goes back to."""
        self._fixed.clear()
        child, parent = transform.child, transform.parent
        known = None
        if edge is not None and edge.parent != parent:
            left = self._left.setdefault(child, {})
            left[edge.parent] = edge
            known = left.pop(parent, None)
            if known is not None:
                self._returned.add(child)
        if known is None or transform.static:
            known = _Edge(parent, transform.parent_from_child)
        self._edges[child] = known
        return known

    @property
    def contested(self) -> dict[str, list[str]]:
        """Parents, sorted, of each frame that is stated below several by turns."""
        return {child: sorted({self._edges[child].parent, *self._left[child]}) for child in sorted(self._returned)}

    def choose_parent(self, child: str, parent: str) -> None:
        """Let a frame have this parent alone, of those that were stated.

        Raises
        ------
        KeyError
            If it was never stated.

        """
        if self._edges[child].parent != parent:
            self._left[child][self._edges[child].parent] = self._edges[child]
            self._edges[child] = self._left[child].pop(parent)
        self._chosen[child] = parent
        self._fixed.clear()

    @property
    def frames(self) -> list[str]:
        """Names of all frames, sorted."""
        return sorted(set(self._edges) | {edge.parent for edge in self._edges.values()})

    def parent(self, frame: str) -> str | None:
        """Parent of a frame, None at a root."""
        edge = self._edges.get(frame)
        return edge.parent if edge else None

    def moves(self, frame: str) -> bool:
        """Whether the edge above a frame was seen to change."""
        edge = self._edges.get(frame)
        return edge is not None and edge.moves

    def ancestors(self, frame: str) -> list[str]:
        """The frame itself, its parent, and so on up to the root."""
        chain = {frame: None}  # a dict keeps the order, and knows at once what it holds
        last = frame
        while (parent := self.parent(last)) is not None and parent not in chain:
            chain[parent] = None
            last = parent
        return list(chain)

    def connected(self, a: str, b: str) -> bool:
        """Whether a path joins two frames."""
        return self.ancestors(a)[-1] == self.ancestors(b)[-1]

    def lookup(self, a: str, b: str, stamp_ns: int) -> FloatArray | None:
        """``a_from_b`` (4, 4) at a stamp; None if nothing connects them, or a moving edge is not known then."""
        found = self._fixed.get((a, b))
        if found is None:
            found = self._look_up(a, b, stamp_ns)
            if found is not None and not self.moves_between(a, b):
                found.flags.writeable = False
                self._fixed[a, b] = found
        return found

    def _look_up(self, a: str, b: str, stamp_ns: int) -> FloatArray | None:
        up_a, up_b = self.ancestors(a), self.ancestors(b)
        common = next((frame for frame in up_a if frame in up_b), None)
        if common is None:
            return None
        common_from_b = self._chain(up_b[: up_b.index(common)], stamp_ns)
        if common == a or common_from_b is None:
            return common_from_b
        common_from_a = self._chain(up_a[: up_a.index(common)], stamp_ns)
        return None if common_from_a is None else se3.inverse(common_from_a) @ common_from_b

    def nominal(self, a: str, b: str) -> FloatArray | None:
        """``a_from_b`` (4, 4) with the first value of every edge that moves; None if nothing connects the two."""
        chains = []
        for frames in (self.ancestors(a), self.ancestors(b)):
            result = np.eye(4)
            for frame in frames[:-1]:
                result = self._edges[frame].first @ result
            chains.append(result)
        return se3.inverse(chains[0]) @ chains[1] if self.connected(a, b) else None

    def moves_between(self, a: str, b: str) -> bool:
        """Whether an edge on the path between two frames was seen to change."""
        return any(self.moves(frame) for frame in set(self.ancestors(a)) ^ set(self.ancestors(b)))

    def latest_common(self, a: str, b: str) -> int | None:
        """Latest stamp at which every moving edge between two frames is known, None if there is none."""
        moving = [self._edges[f] for f in set(self.ancestors(a)) ^ set(self.ancestors(b)) if self.moves(f)]
        if not all(edge.stamps for edge in moving):
            return None
        return min((edge.stamps[-1] for edge in moving), default=None)

    def forget_before(self, stamp_ns: int) -> None:
        """Drop what no stamp from here on needs."""
        for edge in self._edges.values():
            edge.forget_before(stamp_ns)

    def _chain(self, frames: list[str], stamp_ns: int) -> FloatArray | None:
        """Transform from the first frame up through the parents of all of them."""
        result = None
        for frame in frames:
            matrix = self._edges[frame].at(stamp_ns)
            if matrix is None:
                return None
            result = matrix if result is None else matrix @ result
        return np.eye(4) if result is None else result
