"""Colours: paper, ink and the three colour ramps.

The ramps are perceptually uniform and given by sixteen equally spaced published values each:
viridis and magma from matplotlib (van der Walt and Smith 2015, CC0), deep from cmocean (Thyng et al. 2016, MIT).
Each is cut where it would vanish on paper or pass for a wall.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mclcli.arrays import FloatArray

Color = tuple[int, int, int]
RampName = Literal["time", "heat", "depth"]

PAGE: Color = (250, 248, 243)
FREE: Color = (255, 254, 251)
UNKNOWN: Color = (227, 224, 216)
BEYOND: Color = (234, 231, 224)
WALL: Color = (43, 52, 64)
INK: Color = (38, 42, 48)
QUIET: Color = (122, 121, 116)
FRAME: Color = (92, 96, 100)
GRATICULE: Color = (150, 146, 136)
HALO: Color = (255, 255, 255)
CRIMSON: Color = (201, 42, 71)
AMBER: Color = (226, 125, 18)
TEAL: Color = (0, 128, 128)

_VIRIDIS = (
    "440154 481A6C 472F7D 414487 39568C 31688E 2A788E 23888E 1F988B 22A884 35B779 54C568 7AD151 A5DB36 D2E21B FDE725"
)
_MAGMA = (
    "000004 0B0924 20114B 3B0F70 57157E 721F81 8C2981 A8327D C43C75 DE4968 F1605D FA7F5E FE9F6D FEBF84 FDDEA0 FCFDBF"
)
_DEEP = (
    "FDFECC DBF1B9 B7E5AB 92D8A4 71CAA3 5DBAA4 52A8A3 4B97A0 45869C 407598 3E6495 3F528F 41407B 3C335F 332744 281A2C"
)

# Anchors, and the stretch of the ramp that is used, from its low to its high end.
_RAMPS: dict[RampName, tuple[str, float, float]] = {
    "time": (_VIRIDIS, 0.0, 0.84),
    "heat": (_MAGMA, 0.98, 0.22),
    "depth": (_DEEP, 0.02, 0.70),
}


def ramp(name: RampName, steps: int = 256) -> NDArray[np.uint8]:
    """Colours (steps, 3) uint8 of a ramp from its low end to its high end.

    ``time`` runs from purple to green, ``heat`` from cream (worst) to violet (best), ``depth`` from sand to deep blue.
    """
    anchors, low, high = _RAMPS[name]
    table = np.array([[int(code[i : i + 2], 16) for i in (0, 2, 4)] for code in anchors.split()], dtype=np.float64)
    at = np.linspace(low, high, steps) * (len(table) - 1)
    channels = [np.interp(at, np.arange(len(table)), table[:, c]) for c in range(3)]
    return np.rint(np.stack(channels, axis=-1)).astype(np.uint8)


def pick(colors: NDArray[np.uint8], values: FloatArray, low: float, high: float) -> NDArray[np.uint8]:
    """Colour (..., 3) of each value on a ramp (K, 3) that spans low to high; values beyond are clamped."""
    span = high - low if high > low else 1.0
    at = np.clip((values - low) / span, 0.0, 1.0) * (len(colors) - 1)
    return np.take(colors, np.rint(at).astype(np.intp), axis=0)


def mix(a: Color, b: Color, share: float) -> Color:
    """Blend two colours: ``share`` of b in a."""
    red, green, blue = (round(x + share * (y - x)) for x, y in zip(a, b, strict=True))
    return red, green, blue


def cell_colors() -> NDArray[np.uint8]:
    """Colours (256, 3) of an occupancy value read as uint8: 0 free to 100 occupied, 255 unknown, 254 off the map."""
    share = np.clip(np.arange(256) / 100.0, 0.0, 1.0)[:, np.newaxis]
    # Half-occupied cells of a scale map are grey, not half a wall: the eye must find the walls first.
    share = np.where(share < 1.0, 0.75 * share, 1.0)
    table: NDArray[np.uint8] = np.rint((1.0 - share) * np.array(FREE) + share * np.array(WALL)).astype(np.uint8)
    table[255], table[254] = UNKNOWN, BEYOND
    return table
