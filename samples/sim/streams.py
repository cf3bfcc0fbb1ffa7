"""Random streams of the simulator: one for every purpose, so that changing one sensor leaves the others alone."""

from __future__ import annotations

from enum import IntEnum

import numpy as np


class Purpose(IntEnum):
    """What a stream is drawn for. The numbers are part of the shipped logs: never reuse or renumber them."""

    LAYOUT = 101
    LANDMARKS = 102
    CHANGES = 103
    PEOPLE = 104
    ODOMETRY = 105
    LIDAR = 106
    CAMERA = 107
    OPERATOR = 108
    MAP_BLUR = 109


def stream(seed: int, purpose: Purpose) -> np.random.Generator:
    """Philox generator (counter-based, Salmon et al. 2011) keyed by ``seed`` ≥ 0 and ``purpose``."""
    return np.random.Generator(np.random.Philox(key=[seed, int(purpose)]))
