"""Names that the robot's node does not have: all of a file's at once, with lines and what was probably meant."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mclcli.errors import UsageError, nearest_name
from mclcli.settings.robots import names
from mclcli.settings.robots.ros1 import FROM_NAV2, TO_NAV2
from mclcli.text import clean

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from mclcli.io.tables.params_yaml import Given

_MOST = 60  # named in one message
_HINTS = {
    "initial_pose": "a list is no pose there: initial_pose.x, .y and .yaw are",
    "initial_pose.a": "the yaw is initial_pose.yaw",
}


def hint_of_nav2(name: str) -> str:
    """What was probably meant by a name that neither nav2_amcl nor Beluga has, empty if nothing is like it."""
    if name in _HINTS:
        return _HINTS[name]
    if name in TO_NAV2:
        meant = TO_NAV2[name]
        return f"ROS 1's name of {meant}" if meant else "ROS 1's"
    return _like(name, [*names.NAMES, *names.OF_ANY_NODE])


def hint_of_ros1(name: str) -> str:
    """What was probably meant by a name that ROS 1's amcl does not have."""
    if name in FROM_NAV2:
        return f"nav2_amcl's name of {FROM_NAV2[name]}"
    return _like(name, list(TO_NAV2))


def hint_of(known: list[str]) -> Callable[[str], str]:
    """A function that tells which of the known names is most like one."""
    return lambda name: _like(name, known)


def is_near(name: str) -> bool:
    """Whether a name is so like one of amcl's that it was probably meant for amcl, whoever else is given it."""
    import difflib

    is_list_or_ros1 = name in _HINTS or name in TO_NAV2
    return is_list_or_ros1 or bool(difflib.get_close_matches(name, list(names.NAMES), n=1, cutoff=0.85))


def told(unknown: Mapping[str, Given], hint: Callable[[str], str]) -> str:
    """Every name with its line and the hint."""
    listed = []
    for name, given in list(unknown.items())[:_MOST]:
        meant = hint(name)
        listed.append(f"'{clean(name, 60)}', line {given.line}{f' ({meant})' if meant else ''}")
    if len(unknown) > _MOST:
        listed.append(f"and {len(unknown) - _MOST} more")
    return ", ".join(listed)


def settle(
    file: str, whose: str, unknown: Mapping[str, Given], hint: Callable[[str], str], *, lenient: bool
) -> tuple[str, ...]:
    """Warnings about unknown names, which are passed over.

    Raises
    ------
    UsageError
        Unless ``lenient``, if there are any; it names them all.

    """
    if not unknown:
        return ()
    if lenient:
        return (f"{file}: passed over, as on the robot; {whose}: {told(unknown, hint)}",)
    these = "it" if len(unknown) == 1 else "them"
    raise UsageError(
        f"{file}: {whose}: {told(unknown, hint)}; correct {these}, or pass over {these} as the robot does: --lenient"
    )


def _like(name: str, known: list[str]) -> str:
    return nearest_name(name, known).removeprefix("; ")
