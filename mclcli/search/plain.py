"""The search as one would write it down: what the compiled loops must agree with, to the bit.

Slow: tests and readers only.
"""

from __future__ import annotations

import heapq
import math
from typing import TYPE_CHECKING

import numpy as np

from mclcli.world.pyramid import COARSE, LEVELS, OFF_MAP, angles_in, bound_table

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
    """Bound of a node of a level above that of poses: the same sum over the best value in each beam's window."""
    level, group, row, column = node
    start, height, width, shift, margin = search.pyramid.shapes[level].tolist()
    table = bound_table(search.field, search.log_p)
    total = 0.0
    for r, c in (search.lattice.groups if level == COARSE else search.lattice.ends)[group].tolist():
        y, x = (((row << level) + r) >> shift) + margin, (((column << level) + c) >> shift) + margin
        inside = 0 <= y < height and 0 <= x < width
        total += table[search.pyramid.pool[start + y * width + x] if inside else OFF_MAP]
    return total


def roots_of(search: Search) -> list[Node]:
    """All coarse nodes with an allowed place."""
    rows, columns = np.nonzero(search.lattice.places.of_level(COARSE))
    groups = range(len(search.lattice.groups))
    return [(COARSE, t, r, c) for t in groups for r, c in zip(rows.tolist(), columns.tolist(), strict=True)]


def children_of(search: Search, node: Node) -> list[Node]:
    """Nodes of the next level below that together have the same leaves; those without an allowed cell are left out."""
    level, group, row, column = node
    below = (0, *LEVELS)[LEVELS.index(level)]
    side, ratio = 1 << (level - below), angles_in(level) // angles_in(below)
    counts = search.lattice.places.of_level(below)
    rows, columns = counts.shape
    return [
        (below, t, r, c)
        for t in range(group * ratio, min((group + 1) * ratio, search.lattice.angles.size))
        for r in range(side * row, min(side * (row + 1), rows))
        for c in range(side * column, min(side * (column + 1), columns))
        if counts[r, c] > 0
    ]


def maximum(search: Search) -> tuple[float, int]:
    """Greatest value of a leaf and its key, best node first. Source: Land and Doig 1960."""
    height, width = search.lattice.places.shape
    queue = [(-bound_of(search, root), root) for root in roots_of(search)]
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
