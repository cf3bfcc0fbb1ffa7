"""Augmented MCL: when readings fit worse than they used to, some particles are drawn anew.

Two running averages of how well readings fit, v, one slow and one fast:

    w_slow += α_slow (v − w_slow),    w_fast += α_fast (v − w_fast),    share injected = max(0, 1 − w_fast / w_slow)

Source: Thrun, Burgard, Fox 2005, table 8.3, with another v: there it is the mean weight, a product over all beams,
whose ratio says nothing (a belief that fits normally would draw most particles anew). Here it is that of each beam

    v = exp((1/K) · log Σ W_{t−1} e^ℓ)

with ℓ untempered and K the beams and sightings scored.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

from mclcli.errors import UsageError
from mclcli.parameters import parameter, validate


@final
@dataclass(frozen=True, slots=True)
class RecoveryParameters:
    """Whether and how particles are drawn anew when the robot seems lost."""

    recovery: str = parameter(
        "off",
        "where particles are drawn anew from when readings fit worse: nowhere, or anywhere on the map",
        choices=("off", "uniform"),
    )
    recovery_alpha_slow: float = parameter(
        0.001, "rate of the slow average of how well readings fit; 0: never recover", low=0.0, high=1.0, in_nav2=True
    )
    recovery_alpha_fast: float = parameter(
        0.1, "rate of the fast average; 0: never recover", low=0.0, high=1.0, in_nav2=True
    )
    recovery_rule: str = parameter(
        "per_beam",
        "how well readings fit: likelihood per beam, their whole likelihood, or the mean of normalised weights (1/N)",
        choices=("per_beam", "linear", "normalised"),
        source="linear: nav2_amcl; normalised: Beluga",
    )

    def __post_init__(self) -> None:
        validate(self)
        if self.recovery_alpha_fast < self.recovery_alpha_slow:
            raise UsageError(
                f"parameter recovery_alpha_fast = {self.recovery_alpha_fast:g}: must be at least recovery_alpha_slow = "
                f"{self.recovery_alpha_slow:g}; see `mcl params`"
            )

    @property
    def enabled(self) -> bool:
        """Whether particles are ever drawn anew."""
        return self.recovery != "off" and self.recovery_alpha_slow > 0.0
