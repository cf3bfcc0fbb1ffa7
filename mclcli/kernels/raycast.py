"""Expected ranges: rays against the cells of a grid.

All lengths are in cells. A ray is start + r·direction; the kernels write the least r at which it meets a blocked cell,
or ``limit``. ``poses`` (N, 4) hold column, row, cosine and sine of the yaw; ``rays`` (B, 4) the start and the direction
in the base frame, at most 1 long; ``out`` is (N, B), NaN where a pose is not finite.
"""

from __future__ import annotations

import math

import numba as nb

from mclcli.kernels import OPTIONS
from mclcli.kernels._bounds import _within

_FAR = 255  # the largest side a table of squares can hold
_LONGEST = 2.0  # a component of a direction, far enough from what rounding makes of 1
_BEYOND = 4e9  # cells: no line is longer


def _signature(cells: nb.types.Type, dimensions: int, *options: nb.types.Type) -> object:
    rows = nb.types.Array(nb.float64, 2, "C", readonly=True)
    table = nb.types.Array(cells, dimensions, "C", readonly=True)
    return nb.void(table, rows, rows, nb.float64, *options, nb.float64[:, ::1])


@nb.njit([nb.void(nb.types.Array(nb.boolean, 2, "C", readonly=True), nb.uint8[:, :, ::1])], **OPTIONS)
def fill_squares(blocked, squares):  # type: ignore[no-untyped-def]
    """Fill ``squares`` (4, H + 2, W + 2) with the side of the largest open square that has each cell in its corner.

    Table q looks right (q & 1) or left, and up (q & 2) or down. Cells of ``blocked`` (H, W) and of the border around
    the map have 0. A square is one larger than the least of three neighbours': dynamic programming over the grid.
    """
    height, width = blocked.shape
    squares[:] = 0
    for q in range(4):
        right, up = 1 if q & 1 else -1, 1 if q & 2 else -1
        for m in range(1, height + 1):
            row = height + 1 - m if up > 0 else m
            for n in range(1, width + 1):
                column = width + 1 - n if right > 0 else n
                if not blocked[row - 1, column - 1]:
                    beside, above = squares[q, row, column + right], squares[q, row + up, column]
                    least = min(beside, above, squares[q, row + up, column + right])
                    squares[q, row, column] = min(least + 1, _FAR)


@nb.njit([nb.float64(nb.float64, nb.float64, nb.float64, nb.float64, nb.int64, nb.int64)], **OPTIONS)
def _first_on_map(x, y, dx, dy, width, height):  # type: ignore[no-untyped-def]
    """First r in the map's rectangle, which begins at (1, 1): +inf if the ray misses it, NaN from nowhere (slabs)."""
    if not (math.isfinite(x) and math.isfinite(y)):
        return math.nan
    first, last = 0.0, math.inf
    for position, step, size in ((x, dx, width), (y, dy, height)):
        if step != 0.0:
            a, b = (1.0 - position) / step, (size + 1.0 - position) / step
            first, last = max(first, min(a, b)), min(last, max(a, b))
        elif not 1.0 <= position < size + 1.0:
            return math.inf
    return first if first < last else math.inf


@nb.njit(inline="always")
def _clean(component, least):  # type: ignore[no-untyped-def]
    return component if abs(component) > least else 0.0


@nb.njit([_signature(nb.uint8, 3)], **OPTIONS)
def exact(squares, poses, rays, limit, out):  # type: ignore[no-untyped-def]
    """From border to border of open squares: cell by cell beside obstacles, by leaps where there are none.

    Every r comes from the index of a border, not from a running sum, so leaps do not change it. Source: Amanatides and
    Woo 1987; leaps as in Cohen and Sheffer 1994.
    """
    height, width = squares.shape[1] - 2, squares.shape[2] - 2
    for n in range(poses.shape[0]):
        base_x, base_y, c, s = poses[n, 0] + 1.0, poses[n, 1] + 1.0, poses[n, 2], poses[n, 3]
        for b in range(rays.shape[0]):
            x, y = base_x + (c * rays[b, 0] - s * rays[b, 1]), base_y + (s * rays[b, 0] + c * rays[b, 1])
            dx, dy = _clean(c * rays[b, 2] - s * rays[b, 3], 1e-100), _clean(s * rays[b, 2] + c * rays[b, 3], 1e-100)
            if not (abs(dx) <= _LONGEST and abs(dy) <= _LONGEST):
                out[n, b] = math.nan
                continue
            skipped = 0.0
            if not (1.0 <= x < width + 1.0 and 1.0 <= y < height + 1.0):
                skipped = _first_on_map(x, y, dx, dy, width, height)
                if not skipped < limit:
                    out[n, b] = limit if skipped >= limit else math.nan
                    continue
                x, y = _within(x + skipped * dx, 1.0, width + 1.0), _within(y + skipped * dy, 1.0, height + 1.0)
            right, up = dx >= 0.0, dy >= 0.0
            inverse_x, inverse_y = 1.0 / dx if dx != 0.0 else math.inf, 1.0 / dy if dy != 0.0 else math.inf
            table = squares[(1 if right else 0) + (2 if up else 0)]
            column, row = min(nb.int64(x), width), min(nb.int64(y), height)
            r, side = 0.0, nb.int64(table[row, column])
            while side > 0:
                border_x = column + side if right else column + 1 - side
                border_y = row + side if up else row + 1 - side
                r_x, r_y = (border_x - x) * inverse_x, (border_y - y) * inverse_y
                r = min(r_x, r_y)
                if not skipped + r < limit:
                    break
                beyond_x, beyond_y = border_x if right else border_x - 1, border_y if up else border_y - 1
                if r_x < r_y:  # rounding must not carry it out of the square's other side
                    at = nb.int64(y + r * dy)
                    row = min(max(at, row), border_y - 1) if up else max(min(at, row), border_y)
                    column = beyond_x
                elif r_y < r_x:
                    at = nb.int64(x + r * dx)
                    column = min(max(at, column), border_x - 1) if right else max(min(at, column), border_x)
                    row = beyond_y
                else:  # through a corner: it stops between two blocked cells
                    inside_x, inside_y = border_x - 1 if right else border_x, border_y - 1 if up else border_y
                    on_map = 1 <= beyond_x <= width and 1 <= beyond_y <= height
                    if on_map and table[inside_y, beyond_x] == 0 and table[beyond_y, inside_x] == 0:
                        break
                    column, row = beyond_x, beyond_y
                if not (0 <= column <= width + 1 and 0 <= row <= height + 1):
                    break
                side = nb.int64(table[row, column])
            left_map = side == 0 and not (1 <= column <= width and 1 <= row <= height)
            out[n, b] = limit if left_map else min(skipped + r, limit)


@nb.njit([_signature(nb.boolean, 2, nb.boolean)], **OPTIONS)
def bresenham(blocked, poses, rays, limit, nav2, out):  # type: ignore[no-untyped-def]
    """Along Bresenham's line to the cell at ``limit``, distances between centres of cells.

    ``nav2``: as nav2_amcl does; a tie steps aside, one cell more is visited, the border of the map stops. Else as
    Beluga does: a tie stays, beyond the border is nothing.
    """
    height, width = blocked.shape
    reach = min(limit, 1e9)
    for n in range(poses.shape[0]):
        base_x, base_y, c, s = poses[n, 0], poses[n, 1], poses[n, 2], poses[n, 3]
        for b in range(rays.shape[0]):
            x, y = base_x + (c * rays[b, 0] - s * rays[b, 1]), base_y + (s * rays[b, 0] + c * rays[b, 1])
            dx, dy = c * rays[b, 2] - s * rays[b, 3], s * rays[b, 2] + c * rays[b, 3]
            square = rays[b, 2] * rays[b, 2] + rays[b, 3] * rays[b, 3]
            length = 1.0 if abs(square - 1.0) < 1e-9 else math.sqrt(square)
            off_map = 0.0 if nav2 else limit
            if not (0.0 <= x < width and 0.0 <= y < height):
                out[n, b] = off_map if math.isfinite(x) and math.isfinite(y) else math.nan
                continue
            column, row = nb.int64(x), nb.int64(y)
            along_x = nb.int64(math.floor(_within(x + reach * dx, -_BEYOND, _BEYOND))) - column
            along_y = nb.int64(math.floor(_within(y + reach * dy, -_BEYOND, _BEYOND))) - row
            right, up = 1 if along_x > 0 else -1, 1 if along_y > 0 else -1
            along_x, along_y = abs(along_x), abs(along_y)
            steep = along_y > along_x
            steps, rise = max(along_x, along_y), min(along_x, along_y)
            found, error, i, j = limit, 0, 0, 0
            for i in range(steps + (2 if nav2 else 1)):
                if i > 0:
                    error += rise
                    if 2 * error > steps or (nav2 and 2 * error == steps):
                        j += 1
                        error -= steps
                u = column + right * (j if steep else i)
                v = row + up * (i if steep else j)
                on_map = 0 <= u < width and 0 <= v < height
                if not on_map and not nav2:
                    break
                if not on_map or blocked[v, u]:
                    found = math.sqrt(nb.float64(i * i + j * j)) / length if length > 0.0 else 0.0
                    break
            out[n, b] = found if nav2 else min(found, limit)


@nb.njit([nb.void(nb.float64[::1], nb.float64, nb.float64, nb.float64, nb.float64)], **OPTIONS)
def in_metres(ranges, limit, resolution, max_range, most):  # type: ignore[no-untyped-def]
    """Replace ``ranges`` (N·B,) [cells] by metres, at most ``most``, and ``limit`` by ``max_range`` itself."""
    for i in range(ranges.size):
        r = max_range if ranges[i] == limit else ranges[i] * resolution
        ranges[i] = min(r, most)
