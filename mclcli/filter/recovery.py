"""Augmented MCL: when readings fit worse than they used to, some particles are drawn anew.

Two running averages of how well readings fit, v, one slow and one fast:

    w_slow += α_slow (v − w_slow),    w_fast += α_fast (v − w_fast),    share injected = max(0, 1 − w_fast / w_slow)

Source: Thrun, Burgard, Fox 2005, table 8.3, with another v: there it is the mean weight, a product over all beams,
whose ratio says nothing (a belief that fits normally would draw most particles anew). Here it is the reliability that
is reported, both averages begin at 1, nothing is drawn while the robot is not reported as probably lost, and nothing
where it would be reported as lost again. And the averages go on after particles were drawn anew, where the book's begin
from the next v: at a place where nothing fits that v is as bad, and the filter forgets that it is lost
(docs/decisions/0016, 0031).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, Protocol, final, get_args

import numpy as np

from mclcli.errors import UsageError
from mclcli.filter import Recovery, particles
from mclcli.parameters import parameter, validate

if TYPE_CHECKING:
    from collections.abc import Callable

    from mclcli.arrays import FloatArray
    from mclcli.motion.odometry import OdometryPath
    from mclcli.records import StepRecord
    from mclcli.sensors.observation import Observation
    from mclcli.world.occupancy import OccupancyGrid

    Propose = Callable[[StepRecord, int, np.random.Generator], "Proposed"]

_LOG_ZERO = -math.inf


RecoveryRule = Literal["reliability", "linear", "normalised"]


@final
@dataclass(frozen=True, slots=True)
class RecoveryParameters:
    """Whether and how particles are drawn anew when the robot seems lost."""

    recovery: Recovery = parameter(
        "off",
        "where particles are drawn anew when readings fit worse than they used to: nowhere; anywhere on the map; where "
        "a search of the map finds the readings",
        choices=get_args(Recovery),
    )
    recovery_alpha_slow: float = parameter(
        0.001, "rate of the slow average of how well readings fit; 0: never recover", low=0.0, high=1.0, in_nav2=True
    )
    recovery_alpha_fast: float = parameter(
        0.1, "rate of the fast average; 0: never recover", low=0.0, high=1.0, in_nav2=True
    )
    recovery_rule: RecoveryRule = parameter(
        "reliability",
        "how well readings fit: reliability, their whole likelihood, or the mean of normalised weights (1/N)",
        choices=get_args(RecoveryRule),
        source="linear: nav2_amcl; normalised: Beluga",
    )

    def __post_init__(self) -> None:
        validate(self)
        if self.recovery_rule == "reliability" and self.recovery_alpha_fast < self.recovery_alpha_slow:
            raise UsageError(
                f"parameter recovery_alpha_fast = {self.recovery_alpha_fast:g}: must be at least recovery_alpha_slow = "
                f"{self.recovery_alpha_slow:g}; see `mcl params`"
            )

    @property
    def gated(self) -> bool:
        """Whether reliability decides: particles are drawn for a robot that seems lost, where it would not."""
        return self.recovery_rule == "reliability"

    @property
    def forgets(self) -> bool:
        """Whether the averages begin anew after particles were drawn: the originals' rule."""
        return not self.gated

    @property
    def enabled(self) -> bool:
        """Whether particles are ever drawn anew."""
        return self.recovery != "off" and self.recovery_alpha_slow > 0.0


@final
@dataclass(frozen=True, slots=True)
class Averages:
    """log w_slow and log w_fast: the logarithms keep averages of whole likelihoods from vanishing."""

    log_slow: float
    log_fast: float

    @property
    def share(self) -> float:
        """Share of the particles to draw anew, max(0, 1 − w_fast / w_slow), in [0, 1]."""
        return 0.0 if self.log_fast >= self.log_slow else -math.expm1(self.log_fast - self.log_slow)


def observe(averages: Averages | None, log_v: float | None, parameters: RecoveryParameters) -> Averages | None:
    """Averages after an update that fitted as well as log v says, from None before the first.

    Of reliability both start from 1, else from the first v: a robot may be lost from the beginning. An update without
    a usable measurement, log v None, changes nothing.
    """
    if log_v is None:
        return averages
    if averages is None and not parameters.gated:
        return Averages(log_v, log_v)
    averages = averages or Averages(0.0, 0.0)
    slow, fast = parameters.recovery_alpha_slow, parameters.recovery_alpha_fast
    return Averages(_mix(averages.log_slow, log_v, slow), _mix(averages.log_fast, log_v, fast))


def _mix(log_w: float, log_v: float, alpha: float) -> float:
    """log((1 − α) w + α v)."""
    parts = [math.log1p(-alpha) + log_w if alpha < 1.0 else _LOG_ZERO, math.log(alpha) + log_v if alpha else _LOG_ZERO]
    peak = max(parts)
    return peak if peak == _LOG_ZERO else peak + math.log(sum(math.exp(part - peak) for part in parts))


def log_fit(record: StepRecord, rule: RecoveryRule) -> float | None:
    """Log v of one update by a rule, None where there is nothing to judge."""
    if record.degenerate or record.beams_used == 0 or not math.isfinite(record.log_evidence):
        return None
    if rule == "normalised":
        return -math.log(record.weights.size)
    if rule == "reliability":
        return math.log(record.reliability) if record.reliability > 0.0 else _LOG_ZERO
    return record.log_evidence


@final
@dataclass(frozen=True, slots=True, eq=False)
class Situation:
    """What a proposal may look at when the robot seems lost.

    ``record`` is the update at hand with all particles; ``observations`` are the readings that were scored in it, and
    in the updates just before it in which the robot seemed lost, the newest last, with their mounts and their places by
    odometry; ``odom_from_base`` (3,) is where odometry is at the update's stamp, where proposed poses are to hold;
    ``path`` is the recent odometry.
    """

    record: StepRecord
    observations: tuple[Observation, ...]
    odom_from_base: FloatArray
    path: OdometryPath


@final
@dataclass(frozen=True, slots=True, eq=False)
class Proposed:
    """Poses (n, 3) where a lost robot may be, and how probable the place of each is (n,), 0 where nothing tells."""

    poses: FloatArray
    probabilities: FloatArray

    @classmethod
    def blindly(cls, poses: FloatArray) -> Proposed:
        """Poses (n, 3) of which nothing is known."""
        return cls(poses, np.zeros(len(poses)))


class Proposal(Protocol):
    """Says where a lost robot may be: n poses of the base in map at ``situation.record.stamp_ns``.

    Called within a step, after the weights are known and before resampling, and only if particles are to be drawn
    anew; their share is the caller's business. Must depend on nothing but its arguments, and take all randomness from
    ``rng``, which belongs to this step. It must not raise: without a better idea it draws from everywhere.
    """

    def __call__(self, situation: Situation, n: int, rng: np.random.Generator) -> Proposed:
        """Poses (n, 3) float64, yaw in (−π, π], with the probabilities of their places."""
        ...


@final
@dataclass(frozen=True, slots=True, eq=False)
class FromAnywhere:
    """The proposal without an idea: uniform over the free cells of the map."""

    grid: OccupancyGrid

    def __call__(self, situation: Situation, n: int, rng: np.random.Generator) -> Proposed:
        """Poses (n, 3), whatever the situation."""
        del situation
        return Proposed.blindly(particles.uniform(self.grid, n, rng))
