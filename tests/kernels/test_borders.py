"""Kernels at, and beside, every border of the map against the plain formula, one pose at a time.

Every cell has a value of its own, so that a neighbour's is noticed.
"""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from mclcli.native import backend
from tests.kernels.cases import make_sweep

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from mclcli.arrays import FloatArray

SHAPES = [(6, 8), (1, 9), (9, 1), (1, 1)]
KINDS = [np.uint16, np.uint32]
FRAME = (0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0)  # cells of 1 m from the origin on: all places are exact
AWAY = (-2.0, -1.5, -1.0, -0.5, -0.25, -1e-9, -0.0, 0.0, 1e-9, 0.5, 1.0, 1.5, 2.0)
_RING = 64
FAR = (2.0**31, -(2.0**31), 2.0**31 - 1.0, -(2.0**31) - 1.0, 2.0**32, 1e300, math.inf, -math.inf, math.nan)


def places(side: int) -> list[float]:
    """Coordinates within two cells of both borders of an axis, and in its middle."""
    return sorted({border + away for border in (0.0, float(side)) for away in AWAY} | {side / 2})


def guarded(*arrays: NDArray[Any]) -> list[NDArray[Any]]:
    """Copies with a ring of poison around: NaN, or 1 in whole numbers, which is a code that means something else."""
    rings = [np.full(array.size + 2 * _RING, np.nan if array.dtype.kind == "f" else 1, array.dtype) for array in arrays]
    copies = [ring[_RING : ring.size - _RING].reshape(a.shape) for ring, a in zip(rings, arrays, strict=True)]
    for copy, array in zip(copies, arrays, strict=True):
        copy[...] = array
    return copies


def field(shape: tuple[int, int], kind: type[Any]) -> tuple[NDArray[Any], FloatArray]:
    """Codes (H·W,), no two the same, and a value of every code and of off the map."""
    codes = np.arange(shape[0] * shape[1])[::-1].astype(kind)
    return codes, np.append(-1.0 - np.arange(codes.size), -1000.0)


def code_at(codes: NDArray[Any], shape: tuple[int, int], x: float, y: float) -> int:
    """Code of the cell that holds a point [cells], the number of codes off the map."""
    if not (math.isfinite(x) and math.isfinite(y)):
        return codes.size
    column, row = math.floor(x), math.floor(y)
    inside = 0 <= column < shape[1] and 0 <= row < shape[0]
    return int(codes[row * shape[1] + column]) if inside else codes.size


def rays_to(shape: tuple[int, int], start: tuple[float, float]) -> FloatArray:
    """Offsets (B, 2) from a place to all that are near borders, in fours, then far away."""
    near = [(x - start[0], y - start[1]) for x in places(shape[1]) for y in places(shape[0])]
    return np.array([*near, *itertools.product(FAR, (0.0, 0.5)), *itertools.product((0.0, 0.5), FAR)])


def starts(shape: tuple[int, int]) -> list[tuple[float, float]]:
    height, width = shape
    return [
        (width / 2, height / 2),
        (0.5, 0.5),
        (width - 0.25, height - 0.25),
        (0.0, 0.0),
        (float(width), 0.0),
        (-1.0, 0.5),
    ]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("shape", SHAPES)
def test_cells_of_endpoints(shape: tuple[int, int], kind: type[Any]) -> None:
    kernels, (codes, values) = backend.load("likelihood_field"), field(shape, kind)
    codes, values = guarded(codes, values)
    for start in starts(shape):
        ends, pose = rays_to(shape, start), np.array([[*start, 0.0]])
        # As the kernels, where 0 · ∞ is no number; and x + 0.0 with x near a border is exact for halves only.
        points = [(start[0] + (x - 0.0 * y), start[1] + (0.0 * x + y)) for x, y in ends.tolist()]
        wanted = [code_at(codes, shape, *point) for point in points]
        found = np.zeros((len(ends), 1), kind)
        scratch = guarded(np.zeros((5, 256)), np.zeros((4, 256), np.int32))
        args, flat = (codes, *shape), np.ascontiguousarray(ends.T).ravel()
        kernels.look_up(*args, codes.size, *FRAME, pose, flat, found, *scratch)
        assert found[:, 0].tolist() == wanted
        for few in range(0, len(ends), 4):  # four beams clear of the border, or one that is not among them
            total, four = np.zeros(1), np.ascontiguousarray(ends[few : few + 4].T).ravel()
            kernels.sum_log_p(*args, values, *FRAME, pose, four, total, *scratch)
            assert total[0] == sum(values[w] for w in wanted[few : few + 4]), ends[few : few + 4]


def between(shape: tuple[int, int], levels: FloatArray, codes: NDArray[Any], x: float, y: float) -> float:
    """Distance interpolated between the centres of four cells, those at the border repeated; +inf off the map."""
    if not (0.0 <= x < shape[1] and 0.0 <= y < shape[0]):
        return math.inf
    left, below = math.floor(x - 0.5), math.floor(y - 0.5)
    u, v = x - 0.5 - left, y - 0.5 - below

    def level(row: int, column: int) -> float:
        row, column = min(max(row, 0), shape[0] - 1), min(max(column, 0), shape[1] - 1)
        return float(levels[codes[row * shape[1] + column]])

    lower = (1.0 - u) * level(below, left) + u * level(below, left + 1)
    upper = (1.0 - u) * level(below + 1, left) + u * level(below + 1, left + 1)
    return (1.0 - v) * lower + v * upper


@pytest.mark.parametrize("far", FAR)
@pytest.mark.parametrize("beam", range(4))
def test_one_beam_of_four_that_ends_nowhere(far: float, beam: int) -> None:
    """Four beams share a test of whether they are clear of the border; what is no number must not pass it."""
    codes, values = guarded(*field((40, 40), np.uint16))
    ends, total = np.zeros((2, 4)), np.zeros(1)
    ends[0, beam] = far
    scratch = guarded(np.zeros((5, 256)), np.zeros((4, 256), np.int32))
    args = (codes, 40, 40, values, *FRAME, np.array([[20.5, 20.5, 0.0]]), ends.ravel(), total)
    backend.load("likelihood_field").sum_log_p(*args, *scratch)
    assert total[0] == 3.0 * values[codes[20 * 40 + 20]] - 1000.0


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("shape", [*SHAPES, (12, 12)])
def test_distances_between_cells(shape: tuple[int, int], kind: type[Any]) -> None:
    codes, _ = field(shape, kind)
    levels = np.linspace(0.0, 1.0, codes.size)
    law = np.array([-2.0, 0.9, 0.05, 0.01, 1.0, 5.0, 1e-12])
    codes, levels = guarded(codes, levels)
    scratch = guarded(np.zeros((12, 256)), np.zeros((4, 256), np.int32))
    for start in starts(shape):
        pose = np.array([[*start, 0.0]])
        for x, y in rays_to(shape, start).tolist():
            total = np.zeros(1)
            args = (codes, *shape, levels, *FRAME, pose, np.array([x, y]), law, 16, False, total)
            backend.load("interpolated_field").sum_interpolated(*args, *scratch)
            d = between(shape, levels, codes, start[0] + (x - 0.0 * y), start[1] + (0.0 * x + y))
            p = 0.01 if d == math.inf else 0.9 * 2.0 ** (-2.0 * d * d) + 0.05
            assert total[0] == pytest.approx(math.log(p), abs=1e-12), (start, x, y)


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("corner", list(itertools.product((-2, -1, 0, 1), repeat=2)))
def test_costs_around_the_map(shape: tuple[int, int], corner: tuple[int, int]) -> None:
    (low, left), (height, width) = corner, shape
    size = (height + 4, width + 4)
    codes, cost = np.arange(height * width).reshape(shape), np.append(np.arange(height * width), 99).astype(np.uint8)
    plane = np.zeros(size, np.uint8)
    backend.load("leaves").spread(codes.astype(np.uint16), cost, low, left, plane)
    rows, columns = np.arange(size[0]) + low, np.arange(size[1]) + left
    inside = ((rows >= 0) & (rows < height))[:, np.newaxis] & (columns >= 0) & (columns < width)
    there = codes[np.clip(rows, 0, height - 1)][:, np.clip(columns, 0, width - 1)]
    assert plane.tolist() == np.where(inside, there, 99).tolist()
    pool = np.concatenate([np.full(3, 255), codes.ravel()]).astype(np.uint8)
    dealt, by_bin = np.zeros((8, size[0], 2), np.uint8), np.arange(256)[::-1].astype(np.uint8)
    (pool,) = guarded(pool)
    backend.load("sweep").deal(pool, np.array([3, height, width, 0, 0]), by_bin, low, left, dealt)
    for k, row, column in np.ndindex(dealt.shape):
        y, x = row + low, left + 8 * column + k
        wanted = by_bin[codes[y, x]] if 0 <= y < height and 0 <= x < width else by_bin[255]
        assert dealt[k, row, column] == wanted


def costs_of(cells: NDArray[Any], beams: NDArray[Any], at: int) -> list[int]:
    """Costs of 32 nodes from a place on."""
    return [sum(int(cells[s + at + lane]) for s in beams.tolist()) for lane in range(32)]


def open_rows(arguments: Sequence[Any]) -> Iterator[tuple[int, int, int]]:
    """Angle, row and first column of fine nodes under a coarse one that counts."""
    cells, width, beams, counts, _, _, fine_starts, fine_counts = arguments[:8]
    columns, stop = range(0, counts.shape[1], 32), arguments[9]
    for row, column, group in itertools.product(range(counts.shape[0]), columns, range(len(beams))):
        above = costs_of(cells, beams[group], 8 * row * width + column)
        for quarter in range(4):
            lanes = range(8 * quarter, min(8 * quarter + 8, counts.shape[1] - column))
            if any(above[k] <= stop and counts[row, column + k] for k in lanes):
                rows = range(4 * row, min(4 * row + 4, fine_counts.shape[0]))
                angles = range(4 * group, min(4 * group + 4, len(fine_starts)))
                yield from ((t, y, 4 * column + 32 * quarter) for y in rows for t in angles)


def plain_sweep(arguments: Sequence[Any]) -> tuple[list[tuple[int, ...]], float]:
    """Nodes with their costs, and the mass of the others, as the kernel's text has it."""
    cells, width, beams, counts, limit, stop, weights = arguments[4:11]
    nodes: list[tuple[int, ...]] = []
    mass = 0.0
    for t, y, first in open_rows(arguments):
        costs = costs_of(cells, beams[t], 8 * y * width + first)
        places = range(min(32, counts.shape[1] - first)) if min(costs) <= stop else range(0)
        for cost, x in [(costs[k], first + k) for k in places if counts[y, first + k]]:
            if cost <= limit:
                nodes.append((t, y, x, cost))
            elif cost < weights.size:
                mass += weights[cost]
    return nodes, mass


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("room", [2048, 2049, 9000])
def test_a_sweep_finds_what_costs_little(seed: int, room: int) -> None:
    arguments = make_sweep(np.random.default_rng(seed), room=room)
    out, costs, state, mass = arguments[11:15]
    found: list[tuple[int, ...]] = []
    for _ in range(1000):
        state[3] = 0
        backend.load("sweep").sweep(*arguments)
        found += [
            (*place, cost) for place, cost in zip(out[: state[3]].tolist(), costs[: state[3]].tolist(), strict=True)
        ]
        if state[0] >= 2:
            break
    nodes, weighed = plain_sweep(arguments)
    assert sorted(found) == sorted(nodes)
    assert mass[0] == pytest.approx(weighed)
    assert len(nodes) > 10


def expected_range(blocked: NDArray[np.bool_], x: float, y: float, dx: float, dy: float, limit: float) -> float:
    """Least r at which an axis-parallel ray is in a blocked cell, by asking every 1/8 cell."""
    height, width = blocked.shape
    for step in range(int(limit * 8) + 1):
        r = step / 8
        at_x, at_y = x + (r + 1e-6) * dx, y + (r + 1e-6) * dy
        if 0.0 <= at_x < width and 0.0 <= at_y < height and blocked[math.floor(at_y), math.floor(at_x)]:
            return r
    return limit


@pytest.mark.parametrize("method", ["exact", "approximate"])
@pytest.mark.parametrize("shape", SHAPES)
def test_rays_along_the_axes(shape: tuple[int, int], method: str) -> None:
    height, width = shape
    blocked = np.zeros(shape, bool)
    blocked[-1, -1] = blocked[0, 0] = True
    squares = np.zeros((4, height + 2, width + 2), np.uint8)
    backend.load("raycast").fill_squares(blocked, squares)
    (squares,) = guarded(squares)
    inside = [v for v in AWAY if v % 0.5 == 0.0 and v % 1.0 != 0.0]
    xs = sorted({b + a for b in (0.0, float(width)) for a in inside})
    ys = sorted({b + a for b in (0.0, float(height)) for a in inside})
    for x, y, (dx, dy) in itertools.product(xs, ys, [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)]):
        poses, rays, out = np.array([[x, y, 1.0, 0.0]]), np.array([[0.0, 0.0, dx, dy]]), np.zeros(1)
        if method == "exact":
            backend.load("raycast").exact(squares, poses, rays, 20.0, out.reshape(1, 1))
        else:
            lanes = np.zeros(15 * 128), np.zeros(129)
            columns = np.ascontiguousarray(rays.T)
            kernel = backend.load("raycast_in_step").approximate
            kernel(squares.reshape(-1), height, width, poses, columns, 20.0, out, *lanes)
        assert out[0] == pytest.approx(expected_range(blocked, x, y, dx, dy, 20.0), abs=1e-9), (x, y, dx, dy)


def test_ancestors_at_the_ends() -> None:
    cumulative = np.array([0.25, 0.5, 0.5, 1.0])
    pointers = np.array([-0.5, 0.0, 0.25, 0.5, 0.75, 1.0, 2.0])
    out = np.zeros(pointers.size, np.int64)
    cumulative, pointers, out = guarded(cumulative, pointers, out)
    backend.load("particles").ancestors(cumulative, pointers, out)
    first_greater = [min(int(np.searchsorted(cumulative, p, side="right")), 3) for p in pointers]
    assert out.tolist() == first_greater
