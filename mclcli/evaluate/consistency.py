"""Whether a filter's covariances are honest: NEES and its average, with χ² bands.

Source: Bar-Shalom, Li and Kirubarajan 2001, *Estimation with Applications to Tracking and Navigation*, section 5.4.2;
Li and Zhao 2001 for the average divided by the dimension (ANEES), which is 1 for a consistent filter.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.geometry import se2

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from mclcli.arrays import BoolArray, FloatArray
    from mclcli.evaluate.association import Pairs

DIMENSION = 3
_SINGULAR = 1e-9
_LEAST = (1e-4, 1e-5)  # standard deviations [m], [rad] below which nothing is known: of a single particle, or rounded
EXACT = (0.0, 0.0)


@final
@dataclass(frozen=True, slots=True)
class Consistency:
    """Of the measured poses of a track that state a covariance.

    ``anees``: mean NEES / 3, 1 for honest covariances, more for overconfident ones. ``band``: where it lies in 95 of
    100 cases if the filter is consistent and the ``count`` poses were independent, which those of one track are not:
    errors last from pose to pose. ``median_nees`` is 2.37 for honest covariances, whatever a few absurd ones are.
    ``inside``: share of single poses within the 95 % band of χ² with 3 degrees of freedom. ``ellipse``: share whose
    error of x, y and yaw is inside the 95 % ellipsoid, ``ellipse_xy`` that of x and y inside the 95 % ellipse, both
    0.95 for honest covariances, less for overconfident ones. ``singular`` covariances cannot be inverted,
    ``near_singular`` ones state less than 0.1 mm or 0.0006° in some direction; both are left out of everything.
    ``truth_sd`` [m], [rad] of the reference were added.
    """

    anees: float
    band: tuple[float, float]
    inside: float
    count: int
    singular: int
    median_nees: float
    ellipse: float
    ellipse_xy: float
    near_singular: int
    truth_sd: tuple[float, float]


def nees(pairs: Pairs, truth_sd: tuple[float, float] = EXACT) -> tuple[NDArray[np.intp], FloatArray]:
    """Which measured pairs have a usable covariance (K,), and eᵀP⁻¹e of each (K,), e = (dx, dy, wrap(dyaw)) in map.

    P is the covariance stated, and that of the reference, whose standard deviations are ``truth_sd`` [m], [rad].
    """
    chosen, error, covariances = _judged(pairs, truth_sd)
    return chosen, _squared(error, covariances)


def consistency(pairs: Pairs, truth_sd: tuple[float, float] = EXACT) -> Consistency | None:
    """ANEES of a track with its band, and coverage; None if it states no covariance that can be used."""
    chosen, error, covariances = _judged(pairs, truth_sd)
    if not chosen.size or pairs.covariances is None:
        return None
    values, planar = _squared(error, covariances), _squared(error[:, :2], covariances[:, :2, :2])
    regular = _regular(pairs.covariances[pairs.updated])
    return Consistency(
        anees=float(values.mean()) / DIMENSION,
        band=anees_band(values.size),
        inside=_share_between(values, *chi2_band(DIMENSION)),
        count=values.size,
        singular=int((~regular).sum()),
        median_nees=float(np.median(values)),
        ellipse=_share_between(values, 0.0, _chi2_upper(DIMENSION, 0.05)),
        ellipse_xy=_share_between(planar, 0.0, _chi2_upper(2, 0.05)),
        near_singular=int(regular.sum()) - values.size,
        truth_sd=truth_sd,
    )


def _judged(pairs: Pairs, truth_sd: tuple[float, float]) -> tuple[NDArray[np.intp], FloatArray, FloatArray]:
    """Measured pairs with a usable covariance (K,), their errors (K, 3), and covariances of these (K, 3, 3)."""
    if pairs.covariances is None:
        return np.zeros(0, dtype=np.intp), np.zeros((0, 3)), np.zeros((0, 3, 3))
    usable = _regular(pairs.covariances) & ~_near_singular(pairs.covariances)
    chosen = np.flatnonzero(pairs.updated & usable)
    error = pairs.estimated[chosen] - pairs.expected[chosen]
    error[:, 2] = se2.wrap(error[:, 2])
    reference = np.diag(np.square([truth_sd[0], truth_sd[0], truth_sd[1]]))
    return chosen, error, pairs.covariances[chosen] + reference


def _squared(error: FloatArray, covariances: FloatArray) -> FloatArray:
    """Squared Mahalanobis distance eᵀP⁻¹e (K,) of errors (K, D)."""
    solved = np.linalg.solve(covariances, error[:, :, np.newaxis])[:, :, 0]
    return np.asarray((error * solved).sum(axis=1), dtype=np.float64)


def anees_band(runs: int, confidence: float = 0.95) -> tuple[float, float]:
    """Where the ANEES of ``runs`` independent errors lies if they are consistent: quantiles of χ²(3·runs)/(3·runs)."""
    low, high = chi2_band(DIMENSION * runs, confidence)
    return low / (DIMENSION * runs), high / (DIMENSION * runs)


def chi2_band(degrees: int, confidence: float = 0.95) -> tuple[float, float]:
    """Quantiles of χ² that leave the same share out below and above."""
    tail = 0.5 * (1.0 - confidence)
    return _chi2_upper(degrees, 1.0 - tail), _chi2_upper(degrees, tail)


def _chi2_upper(degrees: int, tail: float) -> float:
    """Value of χ² above which a share ``tail`` lies."""
    from scipy.special import chdtri  # scipy.stats would cost half a second

    return float(chdtri(degrees, tail))


def anees_over_runs(runs: Sequence[FloatArray]) -> FloatArray:
    """ANEES at each of T moments over R runs of the same moments: (T,), to be held against ``anees_band(R)``.

    ``runs`` are R arrays (T,) of NEES, from independent noise: the test that Bar-Shalom et al. give.
    """
    return np.asarray(np.mean(np.stack(runs), axis=0) / DIMENSION, dtype=np.float64)


@final
@dataclass(frozen=True, slots=True)
class MomentsConsistency:
    """ANEES over ``runs`` tracks at each of ``moments`` at which all of them made an update.

    ``inside``: share of the moments with an ANEES within ``band``, about 95 % if the runs' noise is independent, as it
    is in simulated drives, but not in runs of other seeds over one log.
    """

    runs: int
    moments: int
    band: tuple[float, float]
    inside: float


def consistency_over_runs(runs: Sequence[Pairs], truth_sd: tuple[float, float] = EXACT) -> MomentsConsistency | None:
    """ANEES over tracks at each moment they have in common; None of fewer than two tracks, or without such moments."""
    if len(runs) < 2:
        return None
    found = [(pairs.stamps_ns[chosen], values) for pairs in runs for chosen, values in [nees(pairs, truth_sd)]]
    common = found[0][0]
    for stamps, _ in found[1:]:
        common = np.intersect1d(common, stamps, assume_unique=True)
    if not common.size:
        return None
    averages = anees_over_runs([values[np.searchsorted(stamps, common)] for stamps, values in found])
    band = anees_band(len(runs))
    return MomentsConsistency(len(runs), common.size, band, _share_between(averages, *band))


def _share_between(values: FloatArray, low: float, high: float) -> float:
    return float(np.mean((values >= low) & (values <= high)))


def _regular(covariances: FloatArray) -> BoolArray:
    """Which covariances (M, 3, 3) can be inverted: those whose correlation matrix is clearly positive definite."""
    variances = np.maximum(np.diagonal(covariances, axis1=1, axis2=2), 0.0)
    positive = np.all(variances > 0.0, axis=1)
    scale = np.sqrt(np.where(positive[:, None], variances, 1.0))
    correlations = covariances / (scale[:, :, None] * scale[:, None, :])
    return np.asarray(positive & (np.linalg.eigvalsh(correlations)[:, 0] > _SINGULAR))


def _near_singular(covariances: FloatArray) -> BoolArray:
    """Which covariances (M, 3, 3) state an error too small to be one, along some direction of x and y or of yaw."""
    a, b, c = covariances[:, 0, 0], covariances[:, 0, 1], covariances[:, 1, 1]
    least = 0.5 * (a + c) - np.hypot(0.5 * (a - c), b)
    return np.asarray((least < _LEAST[0] ** 2) | (covariances[:, 2, 2] < _LEAST[1] ** 2))
