"""The particle filter: pure functions over particles and weights; no files, no printing."""

from typing import Literal

Recovery = Literal["off", "uniform", "locate"]  # where particles are drawn anew, see ``recovery``
