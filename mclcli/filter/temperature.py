"""Temperatures α in (0, 1] on new log-likelihoods: given, from the beams' correlation, or from the sample they leave.

Beams are not independent: neighbours hit the same wall and share the error of its map. A product over K of them is as
sure as K independent ones would be; α = K_eff / K makes up for that.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, final

import numpy as np

from mclcli.filter import fit, weights
from mclcli.native.backend import NUMPY, Backend

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from mclcli.arrays import FloatArray
    from mclcli.sensors import Measurement

AUTO: Final = "auto"
ESS: Final = "ess"
_AUTO_BOUNDS = (0.05, 1.0)
_AUTO_START = 0.5  # before anything was measured
_AUTO_MEMORY = 0.1  # share of the newest scan in the running average: about the last ten count
_MAX_LAG = 60
_LAGS = np.arange(_MAX_LAG + 1)[:, np.newaxis]
_ESS_LOWEST = 0.02
_BISECTIONS = 40


@final
@dataclass(frozen=True, slots=True, eq=False)
class Correlation:
    """Running mean and autocovariances (``_MAX_LAG`` + 1,) of per-beam log p along the scan, at the estimate.

    The mean is that of recent scans, not of each one: a scan that fits badly as a whole is correlation as well.
    """

    mean: float
    covariances: FloatArray

    @property
    def alpha(self) -> float:
        """K_eff / K = 1 / (1 + 2 Σ ρ_k), bounded; the sum ends before the first ρ that is not positive.

        Source: Geyer 1992, *Practical Markov Chain Monte Carlo*, section 3.3 (initial positive sequence).
        """
        if not self.covariances[0] > 0.0:
            return _AUTO_START
        rho = self.covariances[1:] / self.covariances[0]
        ends = np.flatnonzero(rho <= 0.0)
        total = float(rho[: ends[0] if ends.size else rho.size].sum())
        lowest, highest = _AUTO_BOUNDS
        return min(highest, max(lowest, 1.0 / (1.0 + 2.0 * total)))


def correlate(each: FloatArray, before: Correlation | None = None, backend: Backend = NUMPY) -> Correlation:
    """Take one more scan's per-beam log p (K,) into the running autocovariances."""
    own = float(each.sum()) / each.size
    mean = own if before is None else (1.0 - _AUTO_MEMORY) * before.mean + _AUTO_MEMORY * own
    covariances = _lagged_sums(each - mean, backend) / each.size
    if before is not None:
        covariances = (1.0 - _AUTO_MEMORY) * before.covariances + _AUTO_MEMORY * covariances
    return Correlation(mean, covariances)


def _lagged_sums(centred: FloatArray, backend: Backend) -> FloatArray:
    """Σ_i c_i c_{i+lag} (``_MAX_LAG`` + 1,) of values (K,), zero beyond the last. No BLAS: it sums by threads."""
    kernels = backend.kernels("moments")
    if kernels is not None:
        sums = np.empty(_MAX_LAG + 1)
        kernels.lagged_sums(centred, sums, np.empty(128), np.empty((65, 1)))
        return sums
    shifted = np.concatenate([centred, np.zeros(_MAX_LAG)])[_LAGS + np.arange(centred.size)]  # (lags, K)
    return np.asarray((shifted * centred).sum(axis=1))


def conditional_ess(log_weights: FloatArray, log_likelihood: FloatArray, alpha: float) -> float:
    """N (Σ W e^{αℓ})² / Σ W e^{2αℓ}, for normalised log W (N,): what one measurement leaves of N samples.

    It falls monotonically in α. Source: Zhou, Johansen, Aston 2016, section 3.3 (conditional ESS).
    """
    scaled = alpha * (log_likelihood - np.max(log_likelihood))
    numerator = 2.0 * weights.log_sum_exp(log_weights + scaled)
    return float(log_weights.size * np.exp(numerator - weights.log_sum_exp(log_weights + 2.0 * scaled)))


def largest_alpha(log_weights: FloatArray, log_likelihood: FloatArray, target: float) -> float:
    """Largest α in [0.02, 1] that leaves a conditional ESS of ``target``·N at least, by bisection."""
    if not weights.usable(log_likelihood):
        return 1.0
    enough = target * log_weights.size
    if conditional_ess(log_weights, log_likelihood, 1.0) >= enough:
        return 1.0
    low, high = _ESS_LOWEST, 1.0
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        if conditional_ess(log_weights, log_likelihood, middle) >= enough:
            low = middle
        else:
            high = middle
    return low


def resolve(
    measurements: Sequence[Measurement],
    log_likelihoods: FloatArray,
    log_weights: FloatArray,
    correlations: Mapping[str, Correlation],
    ess_target: float,
    fits: Sequence[float] | None = None,
    trusted: tuple[float, float] = (0.0, 0.0),
) -> tuple[float, ...]:
    """α of every measurement. Those with ``ess`` share one, found for the sum of their log-likelihoods (S, N).

    Those with ``auto`` count less where they fit badly: ``fits`` (S,) against ``trusted``, see ``fit.trust``.
    """
    joint = [i for i, measurement in enumerate(measurements) if measurement.alpha == ESS]
    ess_alpha = largest_alpha(log_weights, log_likelihoods[joint].sum(axis=0), ess_target) if joint else 1.0
    alphas = [_alpha(measurement, correlations, ess_alpha) for measurement in measurements]
    for i, how_well in enumerate(fits or ()):
        if measurements[i].alpha == AUTO:
            alphas[i] *= fit.trust(how_well, *trusted)
    return tuple(alphas)


def _alpha(measurement: Measurement, correlations: Mapping[str, Correlation], ess_alpha: float) -> float:
    if measurement.alpha == ESS:
        return ess_alpha
    if measurement.alpha == AUTO and measurement.each is None:
        return 1.0  # no neighbours whose correlation could be measured: K_eff = K
    if measurement.alpha == AUTO:
        known = correlations.get(measurement.sensor)
        return known.alpha if known else _AUTO_START
    return float(measurement.alpha)


def observe(
    measurements: Sequence[Measurement],
    pose: FloatArray,
    correlations: Mapping[str, Correlation],
    backend: Backend = NUMPY,
) -> dict[str, Correlation]:
    """Correlations after looking at the beams of every ``auto`` measurement from a pose (3,)."""
    updated = dict(correlations)
    for measurement in measurements:
        if measurement.alpha == AUTO and measurement.each is not None and measurement.count > 1:
            before = correlations.get(measurement.sensor)
            updated[measurement.sensor] = correlate(measurement.each(pose[np.newaxis])[0], before, backend)
    return updated
