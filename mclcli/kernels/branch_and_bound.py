"""Branch and bound over a lattice of poses (angle, row, column): every leaf that can reach a threshold.

A node of level h holds ``2^h`` × ``2^h`` places and a group of angles. Its bound adds, beam by beam and in the order in
which a leaf adds, the best value that the beam's endpoint can meet from any pose of the node: float addition is
monotonic, so the bound is never below a leaf of the node, to the last bit. Source: Hess et al. 2016, *Real-Time Loop
Closure in 2D LIDAR SLAM*, section V, with angles branched on as well.

``shapes`` (L + 1, 5) int64, a row a level: start in ``pool``, height, width, shift, margin; ``frames`` (L + 1, 4)
int64: first row in ``ends``, groups of angles, rows and columns of blocks; ``counts`` (allowed places in each block,
all levels one after the other from ``firsts``). ``ends`` (…, B, 2) int32 hold the least row and column offset of every
beam's endpoint.
"""

from __future__ import annotations

import math

import numba as nb

from mclcli.kernels import OPTIONS

_OFF = 255  # the bin of everything off the map
_FURTHER = 4.0  # nats: sums go on for so much below the threshold, or the mass left out would seem that of nodes at it
_AT_MOST = 12.0  # nats, untempered, by which a node of many leaves is followed further than a leaf
_LOOK = 8  # beams between two looks at whether the sum can still reach the threshold


def _readonly(kind: nb.types.Type, dimensions: int) -> nb.types.Type:
    return nb.types.Array(kind, dimensions, "C", readonly=True)


_BYTES, _WHOLE, _REAL = _readonly(nb.uint8, 1), _readonly(nb.int64, 2), _readonly(nb.float64, 1)
_ENDS, _COUNTS, _REALS = _readonly(nb.int32, 3), _readonly(nb.int32, 1), _readonly(nb.float64, 2)


@nb.njit(**OPTIONS)
def _bound(pool, shape, ends, row, column, table, best, threshold):  # type: ignore[no-untyped-def]
    """Sum over beams of the best in each window; cut short, still a bound, once it cannot reach the threshold."""
    start, height, width, shift, margin = shape[0], shape[1], shape[2], shape[3], shape[4]
    total, count = 0.0, ends.shape[0]
    for first in range(0, count, _LOOK):
        last = min(first + _LOOK, count)
        for b in range(first, last):
            r = ((row + ends[b, 0]) >> shift) + margin
            c = ((column + ends[b, 1]) >> shift) + margin
            inside = (r >= 0) & (r < height) & (c >= 0) & (c < width)
            total += table[pool[start + r * width + c] if inside else _OFF]
        if total + (count - last) * best < threshold:
            return total + (count - last) * best
    return total


@nb.njit(**OPTIONS)
def _bound_four(pool, shape, ends, row, column, side, table, best, threshold, out):  # type: ignore[no-untyped-def]
    """Write the bounds of four nodes ``side`` cells apart, as ``_bound``: four sums hide each other's waiting."""
    start, height, width, shift, margin = shape[0], shape[1], shape[2], shape[3], shape[4]
    across = side >> shift
    up = across * width
    a, b, c, d, count = 0.0, 0.0, 0.0, 0.0, ends.shape[0]
    off = table[_OFF]
    for first in range(0, count, _LOOK):
        last = min(first + _LOOK, count)
        for i in range(first, last):
            y = ((row + ends[i, 0]) >> shift) + margin
            x = ((column + ends[i, 1]) >> shift) + margin
            at = start + y * width + x
            if (y >= 0) & (y + across < height) & (x >= 0) & (x + across < width):
                a += table[pool[at]]
                b += table[pool[at + across]]
                c += table[pool[at + up]]
                d += table[pool[at + up + across]]
            else:
                low, high = (y >= 0) & (y < height), (y + across >= 0) & (y + across < height)
                left, right = (x >= 0) & (x < width), (x + across >= 0) & (x + across < width)
                a += table[pool[at]] if low & left else off
                b += table[pool[at + across]] if low & right else off
                c += table[pool[at + up]] if high & left else off
                d += table[pool[at + up + across]] if high & right else off
        rest = (count - last) * best
        if max(max(a, b), max(c, d)) + rest < threshold:
            a, b, c, d = a + rest, b + rest, c + rest, d + rest
            break
    out[0], out[1], out[2], out[3] = a, b, c, d


@nb.njit(**OPTIONS)
def _four_leaves(codes, ends, row, column, log_p, best, threshold, out):  # type: ignore[no-untyped-def]
    """Write the values of four neighbouring places: sums over beams of what the cell has that each ends in.

    All are −inf once none can reach the threshold.
    """
    height, width = codes.shape
    a, b, c, d, count = 0.0, 0.0, 0.0, 0.0, ends.shape[0]
    off = log_p[log_p.size - 1]
    for first in range(0, count, _LOOK):
        last = min(first + _LOOK, count)
        for i in range(first, last):
            y, x = row + ends[i, 0], column + ends[i, 1]
            low, high = (y >= 0) & (y < height), (y + 1 >= 0) & (y + 1 < height)
            left, right = (x >= 0) & (x < width), (x + 1 >= 0) & (x + 1 < width)
            a += log_p[codes[y, x]] if low & left else off
            b += log_p[codes[y, x + 1]] if low & right else off
            c += log_p[codes[y + 1, x]] if high & left else off
            d += log_p[codes[y + 1, x + 1]] if high & right else off
        if max(max(a, b), max(c, d)) + (count - last) * best < threshold:
            a = b = c = d = -math.inf
            break
    out[0], out[1], out[2], out[3] = a, b, c, d


@nb.njit(**OPTIONS)
def _sightings(marks, law, row, column, yaw):  # type: ignore[no-untyped-def]
    """Log-likelihood of bearings; ``marks`` (M, 5) hold the landmark, the bearing and the camera on the base."""
    c, s = math.cos(yaw), math.sin(yaw)
    total = 0.0
    for m in range(marks.shape[0]):
        x = column + 0.5 + (c * marks[m, 3] - s * marks[m, 4])
        y = row + 0.5 + (s * marks[m, 3] + c * marks[m, 4])
        error = marks[m, 2] - (math.atan2(marks[m, 1] - y, marks[m, 0] - x) - yaw)
        error -= 2.0 * math.pi * math.floor(error / (2.0 * math.pi) + 0.5)
        total += math.log(max(law[0] * math.exp(law[1] * error * error) + law[2], law[3]))
    return total


@nb.njit([nb.void(_BYTES, _WHOLE, _WHOLE, _ENDS, _COUNTS, nb.int64, nb.int64, _REAL, nb.float64[::1])], **OPTIONS)
def bound_roots(pool, shapes, frames, ends, counts, first, level, table, out):  # type: ignore[no-untyped-def]
    """Write the bound of every node of a level, in the order (group, row, column); −inf where no place is allowed."""
    groups, rows, columns = frames[level, 1], frames[level, 2], frames[level, 3]
    best = table[0]
    for group in range(groups):
        beams = ends[frames[level, 0] + group]
        for row in range(rows):
            for column in range(columns):
                n = (group * rows + row) * columns + column
                out[n] = -math.inf
                if counts[first + row * columns + column] > 0:
                    out[n] = _bound(pool, shapes[level], beams, row << level, column << level, table, best, -math.inf)


@nb.njit(**OPTIONS)
def _bound_children(  # type: ignore[no-untyped-def]
    pool, shapes, frames, ends, counts, firsts, table, node, threshold, nodes, numbers, kid
):
    """Write the children of a node of level 2 or higher, and their bounds, from place ``kid`` on; how many they are."""
    h, t, row, column = node
    below, kids, four = h - 1, 0, numbers[kid + 8 :]
    ratio = 2 if h > 3 else 1
    for kid_t in range(t * ratio, min(t * ratio + ratio, frames[below, 1])):
        beams = ends[frames[below, 0] + kid_t]
        _bound_four(
            pool, shapes[below], beams, row << h, column << h, 1 << below, table, table[0], threshold, four
        )  # fmt: skip
        for quarter in range(4):
            kid_row, kid_column = 2 * row + quarter // 2, 2 * column + quarter % 2
            inside = kid_row < frames[below, 2] and kid_column < frames[below, 3]
            if inside and counts[firsts[below] + kid_row * frames[below, 3] + kid_column] > 0:
                nodes[kid + kids, 1], nodes[kid + kids, 2], nodes[kid + kids, 3] = kid_t, kid_row, kid_column
                numbers[kid + kids] = four[quarter]
                kids += 1
    return kids


@nb.njit(**OPTIONS)
def _push(nodes, numbers, size, kid, kids, below):  # type: ignore[no-untyped-def]
    """Put the children on the stack, the best last, to be taken first; of equals the first is taken first."""
    for done in range(kids):
        least = done
        for other in range(done + 1, kids):
            if numbers[kid + other] <= numbers[kid + least]:
                least = other
        numbers[size + done], nodes[size + done, 0] = numbers[kid + least], below
        for part in range(1, 4):
            nodes[size + done, part] = nodes[kid + least, part]
            nodes[kid + least, part] = nodes[kid + done, part]
        numbers[kid + least] = numbers[kid + done]


@nb.njit(**OPTIONS)
def _take(key, value, slack, alpha, reference, keys, values, whole, real):  # type: ignore[no-untyped-def]
    """Look at a leaf: is it the best, is it to be written? False if there is no room for it."""
    if value > real[0] or (value == real[0] and key < whole[0]):
        real[0], whole[0] = value, key
    if alpha > 0.0 and value >= real[0] - slack:
        if whole[1] == keys.size:
            return False
        keys[whole[1]], values[whole[1]] = key, value
        whole[1] += 1
    elif alpha > 0.0:
        real[1] += math.exp(alpha * (value - reference))
    return True


def _signature(code: nb.types.Type) -> object:
    real, whole = nb.float64, nb.int64
    world = (_readonly(code, 2), _BYTES, _WHOLE, _WHOLE, _ENDS, _COUNTS, _readonly(whole, 1))
    scan = (_REAL, real, _REAL, _REALS, _REAL, _REAL)
    task = (_WHOLE, _REAL, whole, real, real)
    return nb.void(*world, *scan, *task, whole[::1], real[::1], whole[::1], real[::1], whole[:, ::1], real[::1])


@nb.njit([_signature(nb.uint16), _signature(nb.uint32)], **OPTIONS)
def descend(  # type: ignore[no-untyped-def]
    codes, pool, shapes, frames, ends, counts, firsts, log_p, top_leaf, table, marks, law, angles,
    roots, bounds, level, slack, alpha, keys, values, whole, real, nodes, numbers,
):  # fmt: skip
    """Search below ``roots`` (N, 3), group, row and column of nodes of ``level`` in order, with their ``bounds``.

    ``whole`` (2,) holds the key of the best leaf so far, and how many leaves were written; ``real`` (2,) the best value
    so far, and the mass left out: Σ n·exp(alpha·(bound − value as given)) over nodes of n leaves. Without ``alpha`` the
    best leaf is sought, and of equals that of the least key, (angle·H + row)·W + column. With it all leaves within
    ``slack`` of the best are written to ``keys`` and ``values``; −1 of them says that there was no room. ``top_leaf``
    is the greatest of ``log_p``. ``nodes`` (16·(L + 2), 4) and ``numbers`` as many are scratch: a stack, and the
    children of one node.
    """
    height, width = codes.shape
    reference, extra = real[0], law[4]  # no leaf gains more than ``extra`` from the sightings
    margin = _FURTHER / alpha if alpha > 0.0 else 0.0
    kid, reach = 16 * (level + 1), 0.0
    for position in range(roots.shape[0]):
        numbers[0], nodes[0, 0] = bounds[position], level
        nodes[0, 1], nodes[0, 2], nodes[0, 3] = roots[position, 0], roots[position, 1], roots[position, 2]
        size = 1
        while size > 0:
            size -= 1
            h, t, row, column = nodes[size, 0], nodes[size, 1], nodes[size, 2], nodes[size, 3]
            bound, span = numbers[size] + extra, 1 << max(h - 3, 0)
            low = (t * span * height + (row << h)) * width + (column << h)
            if alpha > 0.0:  # the more leaves, the lower may one of them be and their mass still count
                many = min(span, frames[0, 1] - t * span) * counts[firsts[h] + row * frames[h, 3] + column]
                reach = slack + min(math.log(many) / alpha, _AT_MOST)
                if bound < real[0] - reach:
                    real[1] += many * math.exp(alpha * (bound - reference))
                    continue
            elif bound < real[0] or (bound == real[0] and low > whole[0]):
                continue
            threshold = real[0] - reach - margin - extra - 1e-9 * (1.0 + abs(real[0]))
            if h > 1:
                kids = _bound_children(
                    pool, shapes, frames, ends, counts, firsts, table, (h, t, row, column), threshold, nodes, numbers,
                    kid
                )  # fmt: skip
                _push(nodes, numbers, size, kid, kids, h - 1)
                size += kids
                continue
            four = numbers[kid + 8 :]
            _four_leaves(codes, ends[t], 2 * row, 2 * column, log_p, top_leaf, threshold, four)
            for quarter in range(4):
                y, x = 2 * row + quarter // 2, 2 * column + quarter % 2
                if y >= height or x >= width or counts[y * width + x] == 0:
                    continue
                if four[quarter] == -math.inf:
                    real[1] += math.exp(alpha * (real[0] - reach - margin - reference)) if alpha > 0.0 else 0.0
                    continue
                value = four[quarter] + _sightings(marks, law, y, x, angles[t])
                if not _take((t * height + y) * width + x, value, slack, alpha, reference, keys, values, whole, real):
                    whole[1] = -1
                    return
