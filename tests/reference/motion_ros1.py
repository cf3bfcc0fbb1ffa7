"""Standard deviations of the noise in the four motion models of ROS 1's amcl, written out from amcl_odom.cpp (noetic).

``diff`` and ``omni`` hand the sum to a function that takes a standard deviation; ``-corrected`` takes its root first.
``omni`` has α1 and α4 where ``omni-corrected`` has α4 and α1. Angles in rad, lengths in m.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from tests.reference.filter import wrap

if TYPE_CHECKING:
    from collections.abc import Sequence

    Triple = tuple[float, float, float]


def diff(increment: Sequence[float], alphas: Sequence[float]) -> Triple:
    """Of first turn, move and second turn; a turn counts as what it lacks to half a turn, if that is less."""
    dx, dy, dyaw = increment
    a1, a2, a3, a4, _ = alphas
    trans = math.sqrt(dx * dx + dy * dy)
    rot1 = 0.0 if trans < 0.01 else math.atan2(dy, dx)
    rot2 = wrap(dyaw - rot1)
    n1, n2 = (min(abs(wrap(turn)), abs(wrap(turn - math.pi))) for turn in (rot1, rot2))
    return (
        a1 * n1 * n1 + a2 * trans * trans,
        a3 * trans * trans + a4 * n1 * n1 + a4 * n2 * n2,
        a1 * n2 * n2 + a2 * trans * trans,
    )


def omni(increment: Sequence[float], alphas: Sequence[float]) -> Triple:
    """Along the move, in yaw, across the move."""
    dx, dy, turn = increment
    a1, a2, a3, a4, a5 = alphas
    trans = math.sqrt(dx * dx + dy * dy)
    return (
        a3 * trans * trans + a1 * turn * turn,
        a4 * turn * turn + a2 * trans * trans,
        a1 * turn * turn + a5 * trans * trans,
    )


def diff_corrected(increment: Sequence[float], alphas: Sequence[float]) -> Triple:
    """As ``diff``, by its root."""
    first, move, second = diff(increment, alphas)
    return math.sqrt(first), math.sqrt(move), math.sqrt(second)


def omni_corrected(increment: Sequence[float], alphas: Sequence[float]) -> Triple:
    """As ``omni`` with α1 and α4 exchanged, by its root."""
    a1, a2, a3, a4, a5 = alphas
    along, turn, across = omni(increment, (a4, a2, a3, a1, a5))
    return math.sqrt(along), math.sqrt(turn), math.sqrt(across)
