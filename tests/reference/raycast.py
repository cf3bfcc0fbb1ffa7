"""Ray casting without a walk: every blocked cell against the ray, as a box against a line."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    Cells = Sequence[Sequence[bool]]
    Chord = tuple[float, float]


def chord(x: float, y: float, dx: float, dy: float, column: int, row: int) -> Chord | None:
    """First and last r ≥ 0 at which x + r·dx, y + r·dy lies in the closed cell, None if it never does."""
    first, last = 0.0, math.inf
    for position, step, low in ((x, dx, column), (y, dy, row)):
        if step == 0.0:
            if not low <= position <= low + 1:
                return None
            continue
        a, b = (low - position) / step, (low + 1 - position) / step
        first, last = max(first, min(a, b)), min(last, max(a, b))
    return (first, last) if first <= last else None


def chords(blocked: Cells, x: float, y: float, dx: float, dy: float) -> list[Chord]:
    """Chords of all blocked cells that the ray meets, touching included, by their first r."""
    found = [
        chord(x, y, dx, dy, column, row) for row, line in enumerate(blocked) for column, full in enumerate(line) if full
    ]
    return sorted(pair for pair in found if pair is not None)


def pieces(blocked: Cells, x: float, y: float, dx: float, dy: float, gap: float = 1e-9) -> list[Chord]:
    """Chords with those that follow on each other joined."""
    joined: list[Chord] = []
    for first, last in chords(blocked, x, y, dx, dy):
        if joined and first <= joined[-1][1] + gap:
            joined[-1] = (joined[-1][0], max(joined[-1][1], last))
        else:
            joined.append((first, last))
    return joined


def is_clear(blocked: Cells, x: float, y: float, dx: float, dy: float, margin: float = 1e-9) -> bool:
    """Whether the ray keeps away from every corner of blocked cells, so that rounding cannot decide what it meets."""
    length = math.hypot(dx, dy)
    corners = {
        (column + i, row + j)
        for row, line in enumerate(blocked)
        for column, full in enumerate(line)
        if full
        for i in (0, 1)
        for j in (0, 1)
    }
    return all(abs((u - x) * dy - (v - y) * dx) > margin * length for u, v in corners)


def first_hit(blocked: Cells, x: float, y: float, dx: float, dy: float, limit: float) -> float:
    """Least r at which the ray is in a blocked cell, in cells; ``limit`` if that is not before it."""
    return min([limit, *(first for first, _ in chords(blocked, x, y, dx, dy))])
