"""A few of very many messages, evenly spread, and known without knowing how many will come."""

from __future__ import annotations

from typing import Generic, TypeVar, final

Item = TypeVar("Item")


@final
class EvenSample(Generic[Item]):
    """Runs of ``length`` items that came one after the other, evenly spread over all that came; at most ``most`` runs.

    Ask ``wants`` once for every item that comes, and ``keep`` it where that says so.
    """

    __slots__ = ("_length", "_most", "_stride", "runs", "seen")

    def __init__(self, length: int, most: int) -> None:
        self.runs: list[list[Item]] = []
        self._length, self._most = length, most
        self.seen, self._stride = 0, 1

    def wants(self) -> bool:
        """Count one item, and say whether it is one to keep."""
        run, place = divmod(self.seen, self._length)
        self.seen += 1
        if run % self._stride:
            return False
        if place == 0:
            if len(self.runs) == self._most:
                del self.runs[1::2]
                self._stride *= 2
                if run % self._stride:
                    return False
            self.runs.append([])
        return True

    def keep(self, item: Item) -> None:
        """Keep the item that was just asked for."""
        self.runs[-1].append(item)

    @property
    def items(self) -> list[Item]:
        """All that is kept, in order of arrival."""
        return [item for run in self.runs for item in run]
