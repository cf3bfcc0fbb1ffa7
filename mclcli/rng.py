"""Random streams: one for every purpose and step, so that adding one never shifts another."""

from __future__ import annotations

from enum import IntEnum

import numpy as np


class Purpose(IntEnum):
    """What a stream is drawn for. The numbers are part of the output: never reuse or renumber them."""

    INITIALISE = 1
    MOTION = 2
    RESAMPLE = 3
    RECOVERY = 4
    KLD = 5
    SCATTER = 6
    LOT = 7
    BOOTSTRAP = 101


def stream(seed: int, purpose: Purpose, step: int = 0) -> np.random.Generator:
    """Generator for one purpose and one step of a run with this seed.

    Philox is counter-based: key (seed, purpose), counter starting at (0, 0, 0, step), hence streams of different
    steps are 2¹⁹² draws apart. Source: Salmon et al. 2011.
    """
    return np.random.Generator(np.random.Philox(key=[seed, int(purpose)], counter=[0, 0, 0, step]))
