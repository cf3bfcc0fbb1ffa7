"""One step of Monte Carlo Localization: propagate → score → temper → normalise → estimate → resample.

Source: Thrun, Burgard, Fox 2005, table 8.2, with weights carried in log domain between resamplings.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli import rng
from mclcli.filter import estimate, policies, scoring, temperature, weights
from mclcli.filter.kld import KldParameters, kld_size
from mclcli.filter.recovery import RecoveryParameters
from mclcli.filter.resampling import RESAMPLERS
from mclcli.parameters import parameter, validate
from mclcli.records import StepRecord

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from mclcli.filter.temperature import Correlation
    from mclcli.motion import MotionModel
    from mclcli.records import Estimate
    from mclcli.sensors import Measurement


@final
@dataclass(frozen=True, slots=True)
class FilterParameters:
    """Rhythm of the filter, and what it states."""

    resampler: str = parameter("systematic", "how ancestors are drawn", choices=tuple(RESAMPLERS))
    resample_ess: float = parameter(
        0.5,
        "resample when the effective sample size falls below this share of the particles; 1: whatever it is",
        low=0.0,
        high=1.0,
    )
    resample_interval: int = parameter(1, "resample at every so many updates at most", low=1, in_nav2=True)
    resample_moved: bool = parameter(
        False, "resample only if the robot has moved since the last time (10 cm or 0.1 rad of way in all)"
    )
    ess_target: float = parameter(
        0.05, "share of the sample that temperature `ess` leaves at least; below resample_ess", above=0.0, high=1.0
    )
    estimate: str = parameter(
        "before",
        "the estimate is of the weighted set before resampling, or of the set after",
        choices=("before", "after"),
    )
    estimate_mean: str = parameter(
        "set", "the pose stated is the mean of the whole set, or of its heaviest cluster", choices=("set", "heaviest")
    )
    estimate_covariance: str = parameter(
        "set",
        "the covariance stated is that of the whole set, or of its heaviest cluster",
        choices=("set", "heaviest"),
    )
    degenerate: str = parameter(
        "carry",
        "where no weight is left, the carried ones stay, or all become equal",
        choices=("carry", "uniform"),
    )
    gate: str = parameter(
        "euclidean",
        "update_min_d is a distance, or bounds x and y of the odometry frame each",
        choices=("euclidean", "per_axis"),
    )
    update_min_d: float = parameter(0.25, "motion that calls for an update", unit="m", low=0.0, in_nav2=True)
    update_min_a: float = parameter(0.2, "turn that calls for an update", unit="rad", low=0.0, in_nav2=True)
    vision_min_d: float = parameter(0.02, "the same in runs without a lidar", unit="m", low=0.0)
    vision_min_a: float = parameter(0.02, "the same in runs without a lidar", unit="rad", low=0.0)

    def __post_init__(self) -> None:
        validate(self)


@final
@dataclass(frozen=True, slots=True, eq=False)
class FilterState:
    """Particles (N, 3) and their normalised log-weights (N,) between two steps.

    ``correlations`` are what temperature ``auto`` measured, by sensor; ``way`` is how far the robot has moved [m] and
    turned [rad] since the particles were resampled.
    """

    step: int
    poses: NDArray[np.float64]
    log_weights: NDArray[np.float64]
    correlations: Mapping[str, Correlation] = field(default_factory=dict)
    way: tuple[float, float] = (0.0, 0.0)


def initial_state(poses: NDArray[np.float64], step: int = 0) -> FilterState:
    """Equally weighted particles."""
    return FilterState(step, poses, uniform_log_weights(poses.shape[0]))


def uniform_log_weights(n: int) -> NDArray[np.float64]:
    """log(1/n), n times."""
    return np.full(n, -np.log(n))


@final
@dataclass(frozen=True, slots=True)
class Localizer:
    """A motion model, the filter's parameters and a seed: everything a step needs besides the data."""

    motion: MotionModel
    parameters: FilterParameters
    seed: int
    size: KldParameters = field(default_factory=KldParameters)
    recovery: RecoveryParameters = field(default_factory=RecoveryParameters)

    def step(
        self,
        state: FilterState,
        increment: NDArray[np.float64],
        measurements: Sequence[Measurement],
        stamp_ns: int,
        segment: int = 0,
    ) -> tuple[FilterState, StepRecord]:
        """Filter one update.

        ``increment`` (3,) is the odometry since the last update, in the base frame; the measurements score poses of
        the base at ``stamp_ns``. Weights that cannot be normalised leave the carried ones and flag the step.
        """
        poses = self._propagate(state, increment)
        log_likelihoods = scoring.score(measurements, poses)
        alphas = temperature.resolve(
            measurements, log_likelihoods, state.log_weights, state.correlations, self.parameters.ess_target
        )
        log_weights, degenerate = self._reweight(state.log_weights, scoring.temper(alphas, log_likelihoods))
        way = policies.add_way(state.way, increment)
        record = self._record(state, poses, measurements, log_likelihoods, log_weights, way)
        record = dataclasses.replace(record, stamp_ns=stamp_ns, segment=segment, alphas=alphas, degenerate=degenerate)
        after = self._resample(record) if record.resampled else _carry(record, way)
        if self.parameters.estimate == "after":
            belief = self._estimate(after.poses, weights.normalise(after.log_weights))
            record = dataclasses.replace(record, estimate=belief)
        correlations = temperature.observe(measurements, record.estimate.pose, state.correlations)
        return dataclasses.replace(after, correlations=correlations), record

    def _propagate(self, state: FilterState, increment: NDArray[np.float64]) -> NDArray[np.float64]:
        draws = rng.stream(self.seed, rng.Purpose.MOTION, state.step)
        return self.motion.sample(state.poses, increment, draws.standard_normal(state.poses.shape))

    def _record(
        self,
        state: FilterState,
        poses: NDArray[np.float64],
        measurements: Sequence[Measurement],
        log_likelihoods: NDArray[np.float64],
        log_weights: NDArray[np.float64],
        way: tuple[float, float],
    ) -> StepRecord:
        """Everything that the weights say; the step fills in stamp, segment, temperatures and flag."""
        normalised = weights.normalise(log_weights)
        ess = weights.effective_sample_size(normalised)
        belief = self._estimate(poses, normalised)
        log_evidence = weights.log_sum_exp(state.log_weights + log_likelihoods.sum(axis=0))
        return StepRecord(
            step=state.step,
            stamp_ns=0,
            poses=poses,
            sensors=tuple(m.sensor for m in measurements),
            alphas=(),
            log_likelihoods=log_likelihoods,
            log_weights=log_weights,
            weights=normalised,
            ess=ess,
            log_evidence=log_evidence,
            resampled=self._wants_resampling(state.step, ess, poses.shape[0], way),
            degenerate=False,
            beams_used=sum(m.count for m in measurements),
            estimate=belief,
            segment=0,
            converged=estimate.has_converged(poses, belief),
            reliability=_reliability(log_evidence, measurements),
        )

    def _estimate(self, poses: NDArray[np.float64], normalised: NDArray[np.float64]) -> Estimate:
        p = self.parameters
        return estimate.stated(poses, normalised, mean_of=p.estimate_mean, covariance_of=p.estimate_covariance)

    def _reweight(
        self, carried: NDArray[np.float64], tempered: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], bool]:
        """log w_t = log w_{t−1} + Σ α · log p, and whether the measurement had to be ignored."""
        log_weights = carried + tempered
        if weights.usable(log_weights):
            return log_weights, False
        return (carried if self.parameters.degenerate == "carry" else uniform_log_weights(carried.size)), True

    def _wants_resampling(self, step: int, ess: float, n: int, way: tuple[float, float]) -> bool:
        """All policies together: every so many updates, after motion, and where weights have become uneven."""
        p = self.parameters
        return (
            policies.is_turn_of(step, p.resample_interval)
            and (not p.resample_moved or policies.is_way(way))
            and policies.is_depleted(ess, n, p.resample_ess)
        )

    def _resample(self, record: StepRecord) -> FilterState:
        resampler = RESAMPLERS[self.parameters.resampler]
        n = self._wanted_size(record)
        ancestors = resampler(record.weights, n, rng.stream(self.seed, rng.Purpose.RESAMPLE, record.step))
        return FilterState(record.step + 1, record.poses[ancestors], uniform_log_weights(n))

    def _wanted_size(self, record: StepRecord) -> int:
        """Particles to draw: KLD sampling looks at a draw of the largest number, which is then thrown away."""
        largest = self.size.max_particles
        if self.size.fixed:
            return largest
        draws = rng.stream(self.seed, rng.Purpose.KLD, record.step)
        pilot = RESAMPLERS[self.parameters.resampler](record.weights, largest, draws)
        return kld_size(record.poses[pilot], self.size, draws)


def _carry(record: StepRecord, way: tuple[float, float]) -> FilterState:
    normalised = record.log_weights - weights.log_sum_exp(record.log_weights)
    return FilterState(record.step + 1, record.poses, normalised, way=way)


def _reliability(log_evidence: float, measurements: Sequence[Measurement]) -> float:
    """Geometric mean over beams and sightings of the likelihood relative to a perfect fit."""
    count = sum(m.count for m in measurements)
    if count == 0 or not np.isfinite(log_evidence):
        return 0.0
    peak = sum(m.log_peak for m in measurements)
    return float(np.exp(min(0.0, (log_evidence - peak) / count)))
