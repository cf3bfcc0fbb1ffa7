"""The page about the library: signature and docstring of every public name, as Markdown."""

from __future__ import annotations

import dataclasses
import inspect
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import mclcli
from mclcli.filter.start import Opening
from mclcli.io.recording.recording import Recording
from mclcli.io.recording.roles import Roles
from mclcli.records import Estimate, StampedPose, StepRecord, TrackPoint
from mclcli.replay.intake import Setup
from mclcli.replay.smoothing import Smoothed
from mclcli.settings.profiles import Settings
from mclcli.world.occupancy import OccupancyGrid

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    Public = Callable[..., Any]  # a class or a function

ROOT = Path(__file__).resolve().parents[1]
GROUPS = {
    "Logs, maps, parameters": ("open_recording", "load_map", "settings", "load_settings"),
    "Running the filter": ("prepare", "replay", "ReplayTally", "Smoothing"),
    "Where the particles start": ("AroundPose", "AroundSeveral", "AlongPoses", "Anywhere"),
    "Tracks and their errors": (
        "Trajectory",
        "track_of",
        "read_trajectory",
        "evaluate_track",
        "Evaluation",
        "Protocol",
        "Matching",
        "Rule",
        "compare_tracks",
        "Comparison",
    ),
}
# Not made by hand, and so not among the library's names, but what its functions give or take.
OTHERS = (
    TrackPoint,
    StepRecord,
    Estimate,
    StampedPose,
    Recording,
    Roles,
    OccupancyGrid,
    Settings,
    Setup,
    Opening,
    Smoothed,
)
_INTRODUCTION = """# Library

Every public name, with its signature and docstring; made from the source by docs/build.py. There are examples in
[README](../README.md#as-a-library) and [evaluation.md](evaluation.md#from-python). `import mclcli` costs nothing: a
name is imported when it is first used. `mclcli.__version__` is the version.

Angles are radians, lengths metres, stamps integers of nanoseconds. `FloatArray`, `IntArray` and `BoolArray` are NumPy
arrays of float64, int64 and bool. Errors are in `mclcli.errors`: `UsageError` for what the caller can correct,
`InputError` for files that cannot be used.
"""
_WIDTH = 100
_LIMITS = {2**63 - 1: "2**63 - 1", -(2**63): "-(2**63)"}


def page() -> str:
    """The whole page; ValueError if a public name belongs to no group."""
    grouped = {name for names in GROUPS.values() for name in names}
    if grouped | {"__version__"} != set(mclcli.__all__):
        raise ValueError(f"docs/api_page.py: GROUPS and mclcli.__all__ differ: {grouped ^ set(mclcli.__all__)}")
    parts = [_INTRODUCTION]
    for title, names in GROUPS.items():
        parts.append(f"## {title}\n")
        parts += [_entry(name, getattr(mclcli, name)) for name in names]
    parts.append("## What these functions give and take\n")
    parts += [_entry(kind.__name__, kind) for kind in OTHERS]
    return "\n".join(parts)


def _entry(name: str, thing: Public) -> str:
    """A heading, the signature, the docstring, and for a class its public members."""
    source = Path(inspect.getfile(thing)).relative_to(Path(inspect.getfile(mclcli)).parents[1]).as_posix()
    head = f"{'class ' if isinstance(thing, type) else ''}{name}{_signature(thing)}"
    parts = [f"### {name}\n", f"```python\n{head}\n```\n", f"{_markdown(thing)}\n", f"In [{source}](../{source}).\n"]
    if isinstance(thing, type):
        members = [f"- {_member(key, member)}" for key, member in _public_members(thing)]
        parts += [*members, ""] if members else []
    return "\n".join(parts)


def _public_members(kind: type[Any]) -> Iterator[tuple[str, object]]:
    for key, member in vars(kind).items():
        is_function = isinstance(member, property | classmethod | staticmethod) or inspect.isfunction(member)
        if not key.startswith("_") and is_function:
            yield key, member


def _member(key: str, member: Any) -> str:  # noqa: ANN401 - a property or any kind of method
    function: Any = member.fget if isinstance(member, property) else getattr(member, "__func__", member)
    text = " ".join(_inline(inspect.getdoc(function) or "").partition("\n\n")[0].split())
    if isinstance(member, property):
        return f"`{key}: {inspect.signature(function).return_annotation}`: {text}"
    bound = isinstance(member, staticmethod)
    return f"`{key}{_signature(function, width=10**6, skip=0 if bound else 1)}`: {text}"


def _signature(thing: Public, width: int = _WIDTH, skip: int = 0) -> str:
    """Parameters and result as they are written in the source, one a line where they are too many for one."""
    signature = inspect.signature(thing)
    words: list[str] = []
    star = False
    for parameter in list(signature.parameters.values())[skip:]:
        if parameter.name.startswith("_"):
            continue
        if parameter.kind is parameter.VAR_POSITIONAL:
            star = True
        elif parameter.kind is parameter.KEYWORD_ONLY and not star:
            words, star = [*words, "*"], True
        words.append(_parameter(thing, parameter))
    result = "" if inspect.isclass(thing) else f" -> {signature.return_annotation}"
    line = f"({', '.join(words)}){result}"
    name = getattr(thing, "__name__", "")
    return line if len(name) + len(line) <= width else "(\n" + "".join(f"    {w},\n" for w in words) + f"){result}"


def _parameter(thing: Public, parameter: inspect.Parameter) -> str:
    stars = "*" * (parameter.kind is parameter.VAR_POSITIONAL)
    word = f"{stars}{parameter.name}: {parameter.annotation}"
    if parameter.default is parameter.empty:
        return word
    default = parameter.default
    if dataclasses.is_dataclass(thing) and inspect.isclass(thing):
        factory = thing.__dataclass_fields__[parameter.name].default_factory
        default = default if factory is dataclasses.MISSING else factory()
    return f"{word} = {_value(default)}"


def _value(value: object) -> str:
    """A default as it would be written; of objects only what differs from their own defaults."""
    match value:
        case tuple():
            return f"({', '.join(map(_value, value))}{',' * (len(value) == 1)})"
        case str():
            return f'"{value}"'
        case int() if value not in {True, False}:
            return _LIMITS.get(value, f"{value:_}")
        case float() if not value.is_integer():
            return f"{value:.6g}"
    if inspect.isfunction(value) or inspect.isclass(value):
        return str(value.__name__)
    return _object(value) if dataclasses.is_dataclass(value) else repr(value)


def _object(value: Any) -> str:  # noqa: ANN401 - a dataclass
    own = ((field, getattr(value, field.name)) for field in dataclasses.fields(value))
    changed = (f"{field.name}={_value(now)}" for field, now in own if now != field.default)
    return f"{type(value).__name__}({', '.join(changed)})"


def _inline(text: str) -> str:
    """Markdown of the marks within a docstring's sentences."""
    return re.sub(r"``(.+?)``", r"`\1`", text)


def _markdown(thing: Public) -> str:
    """A docstring with its sections (Parameters, Raises…) as lists."""
    lines = (inspect.getdoc(thing) or "").splitlines()
    rules = [i for i, line in enumerate(lines) if line and not line.strip("-") and i]
    ends = [*(i - 1 for i in rules[1:]), len(lines)]
    text = "\n".join(lines[: rules[0] - 1] if rules else lines).strip()
    parts = [_inline(text)]
    for rule, end in zip(rules, ends, strict=False):
        parts.append(f"**{lines[rule - 1]}**\n\n{_items(lines[rule + 1 : end])}")
    return "\n\n".join(parts)


def _items(lines: list[str]) -> str:
    """Entries of a section: names at the margin, what they are indented below."""
    items: list[str] = []
    for line in filter(None, map(str.rstrip, lines)):
        if line.startswith(" "):
            items[-1] += f" {_inline(line.strip())}"
        else:
            items.append(f"- {', '.join(f'`{name}`' for name in line.split(', '))}:")
    return "\n".join(items)
