"""How the messages of a channel are laid out where they are not written as our own definitions have it.

A log's definition of another age may have fields that we do not know: they are passed over. Every field that we know
has to be there, under its name and with its type (numbers may have another width). Then messages are read by the log's
definition, as data: no code is made from it.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, final

from mclcli.io.messages.definition_parsing import Fields, long_name, short_name
from mclcli.io.messages.definitions import fields_of, recorded_definition, store_for, stores_for

if TYPE_CHECKING:
    from collections.abc import Callable

    from rosbags.typesys.store import Typestore

    from mclcli.io.logs.base import Channel

_FAMILIES = ("float", "int", "uint")
_SPELLINGS = {
    "nsec": "nanosec",
    "nsecs": "nanosec",
    "nanosecs": "nanosec",
    "nanoseconds": "nanosec",
    "secs": "sec",
    "seconds": "sec",
}
_DEEPEST = 16


@final
@dataclass(frozen=True, slots=True)
class Layout:
    """Types of ``store`` as ``recorded`` has them; those that it does not describe are as in the store."""

    store: Typestore
    recorded: dict[str, Fields] = field(default_factory=dict)

    def fields(self, kind: str) -> Fields:
        """Fields of a type as they stand in the bytes; none if nobody describes it."""
        return self.recorded.get(short_name(kind)) or self._known(kind)

    def place(self, kind: str, name: str) -> str:
        """Attribute of our object that a recorded field fills, empty if there is none."""
        if long_name(kind) not in self.store.fielddefs:
            return ""
        names = (own for own, _ in self.store.fielddefs[long_name(kind)][1])
        return next((own for own in names if _spelled(own) == _spelled(name)), "")

    def maker(self, kind: str) -> Callable[..., Any] | None:
        """What makes our object of a type, None for a type of the log's own."""
        found: Callable[..., Any] | None = self.store.types.get(long_name(kind))
        return found

    def misses(self, kind: str, depth: int = 0) -> str:
        """What is missing in the recorded definition of a type, empty if it has all that we know of it."""
        name = short_name(kind)
        if depth > _DEEPEST:
            return f"{name} is within itself"
        if name not in self.recorded:
            return "" if depth else f"it does not describe {name}"
        have = {_spelled(label): of for of, label in self.recorded[name]}
        for of, label in self._known(kind):
            if _spelled(label) not in have:
                return f"{name} has no field {label}"
            if not _alike(of, have[_spelled(label)]):
                return f"{label} of {name} is {have[_spelled(label)]}, not {of}"
            base = of.partition("[")[0]
            if "/" in base and (missing := self.misses(base, depth + 1)):
                return missing
        return ""

    def _known(self, kind: str) -> Fields:
        return fields_of(self.store, long_name(kind)) if long_name(kind) in self.store.fielddefs else ()


def layout_for(channel: Channel) -> Layout | str:
    """Layout of a channel's messages: as the store's, or as the log has it where that has all we need; or why not."""
    store = store_for(channel)
    if not isinstance(store, str):
        return Layout(store)
    recorded = recorded_definition(channel)
    if recorded is None:
        return store
    layouts = [Layout(known, recorded) for known in stores_for(channel)]
    missing = [layout.misses(channel.type) for layout in layouts]
    fitting = next((layout for layout, what in zip(layouts, missing, strict=True) if not what), None)
    return fitting or "".join((store, *(f": {what[:200]}" for what in missing[:1])))


def _spelled(name: str) -> str:
    plain = name.lower().replace("_", "")
    return _SPELLINGS.get(plain, plain)


def _alike(known: str, recorded: str) -> bool:
    """Whether two types say the same: numbers of one family, or else the same type."""
    (known, _, many), (recorded, _, count) = known.partition("["), recorded.partition("[")
    if many != count:
        return False
    families = [kind.rstrip("0123456789") for kind in (known, recorded)]
    return known == recorded or (families[0] == families[1] and families[0] in _FAMILIES)
