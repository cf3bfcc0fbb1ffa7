"""Random streams: one for every purpose and step, so that adding one never shifts another."""

from __future__ import annotations

from enum import IntEnum
from typing import TYPE_CHECKING, Any, final

import numpy as np
from numpy.random.bit_generator import ISeedSequence

if TYPE_CHECKING:
    from numpy.typing import DTypeLike, NDArray


class Purpose(IntEnum):
    """What a stream is drawn for. The numbers are part of the output: never reuse or renumber them."""

    INITIALISE = 1
    MOTION = 2
    RESAMPLE = 3
    RECOVERY = 4
    KLD = 5
    SCATTER = 6
    LOT = 7
    RIVALS = 8
    BOOTSTRAP = 101


def stream(seed: int, purpose: Purpose, step: int = 0) -> np.random.Generator:
    """Generator for one purpose and one step of a run with this seed.

    Philox is counter-based: key (seed, purpose), counter starting at (0, 0, 0, step), hence streams of different
    steps are 2¹⁹² draws apart. Source: Salmon et al. 2011.
    """
    key: Any = _Key(seed, purpose)  # NumPy's stubs know no seed sequence but its own
    return np.random.Generator(np.random.Philox(key, counter=[0, 0, 0, step]))


@final
class _Key(ISeedSequence):
    """A key for Philox, passed as a seed: for one passed as a key NumPy asks the system for randomness first."""

    __slots__ = ("_words",)

    def __init__(self, *words: int) -> None:
        self._words = words

    def generate_state(self, n_words: int, dtype: DTypeLike = np.uint32) -> NDArray[Any]:
        """The key itself, two words of 64 bits."""
        key = np.array(self._words, dtype)
        if key.size != n_words:
            raise ValueError(f"a key of {key.size} words, asked for {n_words}")
        return key
