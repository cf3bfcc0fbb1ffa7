"""How good a track is, against a reference."""

from typing import Literal

Method = Literal["interpolate", "nearest"]  # how poses of two tracks are brought together; see ``association``
