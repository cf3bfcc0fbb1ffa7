"""A few of very many messages, evenly spread, and known without knowing how many will come."""

from __future__ import annotations

from typing import Generic, TypeVar, final

Item = TypeVar("Item")


@final
class EvenSample(Generic[Item]):
    """Runs of ``length`` items that came one after the other, evenly spread over all that came; at most ``most`` runs.

    Ask ``wants`` once for every item that comes, and ``keep`` it where that says so.
    """

    __slots__ = ("_length", "_most", "_next", "_stride", "runs", "seen")

    def __init__(self, length: int, most: int) -> None:
        self.runs: list[list[Item]] = []
        self.seen = 0
        self._length, self._most = length, most
        self._stride = 1  # of so many runs one is kept
        self._next = 0  # the first item of the run that is to be kept next, or of the one that is kept now

    def wants(self) -> bool:
        """Count one item, and say whether it is one to keep."""
        place = self.seen - self._next
        self.seen += 1
        if place < 0:
            return False
        if place == 0:
            if len(self.runs) == self._most:
                del self.runs[1::2]
                self._stride *= 2
                if self._next // self._length % self._stride:
                    self._next += self._length * self._stride // 2
                    return False
            self.runs.append([])
        if place == self._length - 1:
            self._next += self._length * self._stride
        return True

    def keep(self, item: Item) -> None:
        """Keep the item that was just asked for."""
        self.runs[-1].append(item)

    @property
    def items(self) -> list[Item]:
        """All that is kept, in order of arrival."""
        return [item for run in self.runs for item in run]
