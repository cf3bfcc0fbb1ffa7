"""The search as one would write it down: what the compiled loops must agree with, to the bit.

Slow: tests and readers only.
"""

from __future__ import annotations

import heapq
import math
from typing import TYPE_CHECKING

from mclcli.world.pyramid import OFF_MAP

if TYPE_CHECKING:
    from mclcli.search.branching import Search

Node = tuple[int, int, int, int]  # level, group of angles, row and column of the block


def value_of(search: Search, angle: int, row: int, column: int) -> float:
    """Value of a leaf: beam by beam, the table's entry of the cell in which it ends. Sightings are not in it."""
    codes, total = search.field.codes, 0.0
    height, width = codes.shape
    for r, c in search.lattice.ends[angle].tolist():
        inside = 0 <= row + r < height and 0 <= column + c < width
        total += search.log_p[codes[row + r, column + c] if inside else -1]
    return total


def bound_of(search: Search, node: Node) -> float:
    """Bound of a node of level 1 or higher: the same sum over the best value in each beam's window."""
    level, group, row, column = node
    start, height, width, shift, margin = search.pyramid.shapes[level].tolist()
    ends = search.lattice.ends[search.lattice.frames[level, 0] + group]
    total = 0.0
    for r, c in ends.tolist():
        y, x = (((row << level) + r) >> shift) + margin, (((column << level) + c) >> shift) + margin
        inside = 0 <= y < height and 0 <= x < width
        total += search.table[search.pyramid.pool[start + y * width + x] if inside else OFF_MAP]
    return total


def children_of(search: Search, node: Node) -> list[Node]:
    """Nodes one level lower that together have the same leaves; those without an allowed cell are left out."""
    level, group, row, column = node
    frames, places, below = search.lattice.frames, search.lattice.places, level - 1
    ratio = 2 if level > 3 else 1
    _, groups, rows, columns = frames[below].tolist()
    found: list[Node] = []
    for t in range(group * ratio, min((group + 1) * ratio, groups)):
        for r in range(2 * row, min(2 * row + 2, rows)):
            blocks = range(2 * column, min(2 * column + 2, columns))
            first = places.firsts[below] + r * columns
            found += [(below, t, r, c) for c in blocks if places.counts[first + c] > 0]
    return found


def maximum(search: Search) -> tuple[float, int]:
    """Greatest value of a leaf and its key, best node first. Source: Land and Doig 1960."""
    height, width = search.lattice.places.shape
    top = len(search.lattice.frames) - 1
    queue = [(-bound_of(search, (top, *root)), (top, *root)) for root in map(tuple, search.roots.tolist())]
    heapq.heapify(queue)
    best, key = -math.inf, -1
    while queue and -queue[0][0] >= best:
        for child in children_of(search, heapq.heappop(queue)[1]):
            level, t, row, column = child
            if level:
                heapq.heappush(queue, (-bound_of(search, child), child))
                continue
            value, number = value_of(search, t, row, column), (t * height + row) * width + column
            if value > best or (value == best and number < key):
                best, key = value, number
    return best, key
