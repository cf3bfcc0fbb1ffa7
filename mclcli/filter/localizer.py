"""One step of Monte Carlo Localization: propagate → score → temper → normalise → estimate → recover → resample.

Source: Thrun, Burgard, Fox 2005, table 8.2, with weights carried in log domain between resamplings.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple, final

import numpy as np

from mclcli import rng
from mclcli.filter import estimate, fit, recovery, sandwich, temperature, weights
from mclcli.filter.kld import KldParameters, kld_size
from mclcli.filter.modes import Modes
from mclcli.filter.recovery import RecoveryParameters
from mclcli.filter.resampling import RESAMPLERS
from mclcli.filter.rivals import Rivals
from mclcli.native.backend import NUMPY, Backend
from mclcli.records import StepRecord

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from mclcli.arrays import FloatArray, IntArray
    from mclcli.filter.parameters import FilterParameters
    from mclcli.filter.recovery import Averages, Propose
    from mclcli.filter.sandwich import Sandwich
    from mclcli.filter.temperature import Correlation
    from mclcli.motion import MotionModel
    from mclcli.sensors import Measurement

    Draw = Callable[[int, np.random.Generator], FloatArray]

_WAY = (0.1, 0.1)  # [m], [rad]
_NONE = np.empty((0, 3))
_PROPOSED = 5  # times as many poses as there are particles are looked at for a robot that seems lost


@final
@dataclass(frozen=True, slots=True, eq=False)
class FilterState:
    """Particles (N, 3) and their normalised log-weights (N,) between two steps.

    ``correlations`` are what temperature ``auto`` measured, by sensor; ``way`` is how far the robot has moved [m] and
    turned [rad] since the particles were resampled; ``averages`` tell how well readings have fitted;
    ``rivals`` are where it may be instead; ``modes`` are the places that a start has found, until one is chosen;
    ``sandwich`` is the covariance of the estimate's error.
    """

    step: int
    poses: FloatArray
    log_weights: FloatArray
    correlations: Mapping[str, Correlation] = field(default_factory=dict)
    way: tuple[float, float] = (0.0, 0.0)
    averages: Averages | None = None
    rivals: Rivals = field(default_factory=Rivals)
    modes: Modes | None = None
    sandwich: Sandwich | None = None


def initial_state(poses: FloatArray, step: int = 0, places: IntArray | None = None) -> FilterState:
    """Equally weighted particles (N, 3); ``places`` (N,) says which of several places each is at, from 0."""
    modes = None if places is None or not places.any() else Modes(places)
    return FilterState(step, poses, weights.uniform_log_weights(poses.shape[0]), modes=modes)


class _At(NamedTuple):
    """Which update, when, and in which segment of the log."""

    step: int
    stamp_ns: int
    segment: int


class _Weighed(NamedTuple):
    """Log-likelihoods (S, N) with their temperatures, and what they make of the weights: log, softmax, log Σ e^log."""

    alphas: tuple[float, ...]
    log_likelihoods: FloatArray
    log_weights: FloatArray
    weights: FloatArray
    log_total: float
    degenerate: bool


@final
@dataclass(frozen=True, slots=True)
class Localizer:
    """A motion model, the filter's parameters and a seed: everything a step needs besides the data.

    ``backend`` runs the loops over particles; it does not change what comes out.
    """

    motion: MotionModel
    parameters: FilterParameters
    seed: int
    size: KldParameters = field(default_factory=KldParameters)
    recovery: RecoveryParameters = field(default_factory=RecoveryParameters)
    backend: Backend = NUMPY

    def step(
        self,
        state: FilterState,
        increment: FloatArray,
        measurements: Sequence[Measurement],
        stamp_ns: int,
        segment: int = 0,
        propose: Propose | None = None,
    ) -> tuple[FilterState, StepRecord]:
        """Filter one update.

        ``increment`` (3,) is the odometry since the last update, in the base frame; the measurements score poses of
        the base at ``stamp_ns``. Weights that cannot be normalised leave the carried ones and flag the step.
        ``propose`` draws poses anew for a robot that seems lost; without it none are.
        """
        poses = self._propagate(state, increment)
        log_likelihoods = weights.score(measurements, poses)
        log_evidence, evidences = weights.evidences(state.log_weights, log_likelihoods)
        alphas = self._temper(state, measurements, log_likelihoods, evidences)
        weighed = self._weigh(state.log_weights, alphas, log_likelihoods)
        record = self._record(_At(state.step, stamp_ns, segment), poses, measurements, weighed, log_evidence)
        averages, way = self._observe(state.averages, record), add_way(state.way, increment)
        rivals, anew = Rivals(), _NONE
        if propose and averages and self.recovery.gated:
            usual = math.exp(averages.log_slow)
            rivals = self._compete(state.rivals, increment, record, measurements, usual, propose)
            if record.lost:
                anew = self._draw(record, averages, lambda n, draws: _some(rivals.proven, n, draws))
        elif propose and averages:
            anew = self._draw(record, averages, lambda n, draws: propose(record, n, draws).poses)
        modes = state.modes and state.modes.weighed(record.weights, increment)
        record = self._decide(record, way, round(len(anew) / self.size.max_particles * poses.shape[0]))
        record = dataclasses.replace(record, modes=modes.count) if modes else record
        after = self._resample(record, anew, modes) if record.resampled else _carry(record, weighed.log_total, modes)
        if self.parameters.estimate == "after":
            reported = self._belief(after.poses, weights.normalise(after.log_weights), "after")
            record = dataclasses.replace(record, **reported)
        error = None
        if self.parameters.covariance == "sandwich":
            stated, error = sandwich.state(
                state.sandwich, state.log_weights, record, increment, measurements, self.backend
            )
            record = dataclasses.replace(record, estimate=stated)
        # What a robot that is being looked for sees from where it was thought to be says nothing of its beams.
        sought = record.injected > 0
        known = state.correlations
        next_state = FilterState(
            after.step,
            after.poses,
            after.log_weights,
            correlations=known
            if sought
            else temperature.observe(measurements, record.estimate.pose, known, self.backend),
            way=(0.0, 0.0) if record.resampled else way,
            averages=None if record.injected and self.recovery.forgets else averages,
            rivals=rivals,
            modes=after.modes,
            sandwich=error,
        )
        return next_state, record

    def _propagate(self, state: FilterState, increment: FloatArray) -> FloatArray:
        draws = rng.stream(self.seed, rng.Purpose.MOTION, state.step)
        return self.motion.sample(state.poses, increment, draws.standard_normal(state.poses.shape))

    def _temper(
        self,
        state: FilterState,
        measurements: Sequence[Measurement],
        log_likelihoods: FloatArray,
        evidences: Sequence[float],
    ) -> tuple[float, ...]:
        """α of every sensor, from what is known before this update."""
        p = self.parameters
        fits = fit.of_each(measurements, evidences)
        trusted = (p.fit_ignored, p.fit_trusted)
        return temperature.resolve(
            measurements, log_likelihoods, state.log_weights, state.correlations, p.ess_target, fits, trusted
        )

    def _weigh(self, carried: FloatArray, alphas: tuple[float, ...], log_likelihoods: FloatArray) -> _Weighed:
        """log w_t = log w_{t−1} + Σ α · log p, its softmax, and whether the measurement had to be ignored."""
        log_weights = carried + weights.temper(alphas, log_likelihoods)
        degenerate = not weights.usable(log_weights)
        if degenerate:
            log_weights = (
                carried if self.parameters.degenerate == "carry" else weights.uniform_log_weights(carried.size)
            )
        return _Weighed(alphas, log_likelihoods, log_weights, *weights.softmax(log_weights), degenerate)

    def _record(
        self,
        at: _At,
        poses: FloatArray,
        measurements: Sequence[Measurement],
        weighed: _Weighed,
        log_evidence: float,
    ) -> StepRecord:
        """Everything that the weights say; whether to resample is still to be decided."""
        counts = tuple([m.count for m in measurements])
        reliability = fit.of_update(measurements, log_evidence, poses, weighed.weights)
        return StepRecord(
            step=at.step,
            stamp_ns=at.stamp_ns,
            poses=poses,
            sensors=tuple([m.sensor for m in measurements]),
            alphas=weighed.alphas,
            log_likelihoods=weighed.log_likelihoods,
            log_weights=weighed.log_weights,
            weights=weighed.weights,
            ess=weights.effective_sample_size(weighed.weights),
            log_evidence=log_evidence,
            resampled=False,
            degenerate=weighed.degenerate,
            beams_used=sum(counts),
            segment=at.segment,
            **self._belief(poses, weighed.weights, "before"),
            reliability=reliability,
            counts=counts,
            lost=reliability < fit.PROBABLY_LOST,
        )

    def _belief(self, poses: FloatArray, normalised: FloatArray, when: str) -> dict[str, Any]:
        """What these particles say, in full only when it is to be reported; the record's fields by name."""
        p = self.parameters
        if p.estimate != when:
            return {"estimate": estimate.weighted_mean(poses, normalised, self.backend), "converged": False}
        belief, hypotheses = estimate.report(
            poses,
            normalised,
            mean_of=p.estimate_mean,
            covariance_of=p.estimate_covariance,
            most=p.hypotheses,
            backend=self.backend,
        )
        converged = estimate.has_converged(poses, belief, self.backend)
        return {"estimate": belief, "hypotheses": hypotheses, "converged": converged}

    def _observe(self, averages: Averages | None, record: StepRecord) -> Averages | None:
        if not self.recovery.enabled:
            return None
        return recovery.observe(averages, recovery.log_fit(record, self.recovery.recovery_rule), self.recovery)

    def _compete(
        self,
        rivals: Rivals,
        increment: FloatArray,
        record: StepRecord,
        measurements: Sequence[Measurement],
        usual: float,
        propose: Propose,
    ) -> Rivals:
        """Rivals after this update: those that fit it, and new ones where the robot seems lost."""
        if not record.lost and not rivals.poses.size:
            return rivals
        draws, largest = rng.stream(self.seed, rng.Purpose.RIVALS, record.step), self.size.max_particles
        moved = self.motion.sample(rivals.poses, increment, draws.standard_normal(rivals.poses.shape))
        rivals = rivals.moved_to(moved, lost=record.lost)
        if record.lost:
            proposed = propose(record, _PROPOSED * largest, draws)
            rivals = rivals.joined_by(proposed.poses, proposed.probabilities)
        return rivals.judged(measurements, usual, largest)

    def _draw(self, record: StepRecord, averages: Averages, draw: Draw) -> FloatArray:
        """Particles drawn anew, as many as there would be of the largest set."""
        n, largest = record.poses.shape[0], self.size.max_particles
        if not averages.share > 0.0:
            return _NONE
        lot = rng.stream(self.seed, rng.Purpose.LOT, record.step).random()
        injected = int(averages.share * n + lot)  # share·n on average, as near to it as whole numbers are
        if not injected:
            return _NONE
        draws = rng.stream(self.seed, rng.Purpose.RECOVERY, record.step)
        return draw(max(1, round(injected / n * largest)), draws)

    def _decide(self, record: StepRecord, way: tuple[float, float], injected: int) -> StepRecord:
        """Whether to resample: always for particles that were drawn anew, else by all policies together."""
        p, n = self.parameters, record.poses.shape[0]
        due = (
            is_turn_of(record.step, p.resample_interval)
            and (not p.resample_moved or is_way(way))
            and is_depleted(record.ess, n, p.resample_ess)
        )
        return dataclasses.replace(record, resampled=True, injected=injected) if due or injected else record

    def _resample(self, record: StepRecord, anew: FloatArray, modes: Modes | None) -> FilterState:
        """Equally weighted particles: those drawn ``anew`` (K, 3), the others copies of their ancestors.

        Those of several ``modes`` have the weights of these, unless others were drawn anew.
        """
        resampler = RESAMPLERS[self.parameters.resampler]
        n = self._wanted_size(record, anew)
        anew = anew[: round(len(anew) / self.size.max_particles * n)]
        draws = rng.stream(self.seed, rng.Purpose.RESAMPLE, record.step)
        if modes and not anew.size:
            ancestors, log_weights, modes = modes.resample(record.weights, n, resampler, draws, self.backend)
            return FilterState(record.step + 1, record.poses.take(ancestors, axis=0), log_weights, modes=modes)
        ancestors = resampler(record.weights, n - anew.shape[0], draws, self.backend)
        poses = record.poses.take(ancestors, axis=0)
        if anew.size:
            poses = np.concatenate([poses, anew])
        return FilterState(record.step + 1, poses, weights.uniform_log_weights(n))

    def _wanted_size(self, record: StepRecord, anew: FloatArray) -> int:
        """Particles to draw: KLD sampling looks at a draw of the largest number, which is then thrown away."""
        largest = self.size.max_particles
        if self.size.fixed:
            return largest
        draws = rng.stream(self.seed, rng.Purpose.KLD, record.step)
        resampler = RESAMPLERS[self.parameters.resampler]
        pilot = resampler(record.weights, largest - anew.shape[0], draws, self.backend)
        return kld_size(np.concatenate([record.poses.take(pilot, axis=0), anew]), self.size, draws, self.backend)


def _some(poses: FloatArray, n: int, draws: np.random.Generator) -> FloatArray:
    """Of poses (K, 3) n draws, or none where K is 0."""
    return poses[draws.integers(len(poses), size=n)] if len(poses) else _NONE


def _carry(record: StepRecord, log_total: float, modes: Modes | None) -> FilterState:
    """The same particles, their log-weights normalised by log Σ e^log_weights."""
    return FilterState(record.step + 1, record.poses, record.log_weights - log_total, modes=modes)


def add_way(way: tuple[float, float], increment: FloatArray) -> tuple[float, float]:
    """Metres moved and radians turned, with another increment (3,)."""
    return way[0] + math.hypot(increment[0], increment[1]), way[1] + abs(float(increment[2]))


def is_way(way: tuple[float, float]) -> bool:
    """Whether so much was moved [m] or turned [rad] that particles are no longer copies of each other."""
    return way[0] >= _WAY[0] or way[1] >= _WAY[1]


def is_depleted(ess: float, n: int, fraction: float) -> bool:
    """Whether the effective sample size fell below a fraction of the particles; always with a fraction of 1."""
    return ess < fraction * n or fraction == 1.0


def is_turn_of(step: int, interval: int) -> bool:
    """Whether a step, counted from 0, is the last of its ``interval`` steps."""
    return (step + 1) % interval == 0
