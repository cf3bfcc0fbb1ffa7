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
_SINGULAR = 1e-12


@final
@dataclass(frozen=True, slots=True)
class Consistency:
    """Of the measured poses of a track that state a covariance.

    ``anees``: mean NEES / 3, 1 for honest covariances, more for overconfident ones. ``band``: where it lies in 95 of
    100 cases if the filter is consistent and the ``count`` poses were independent, which those of one track are not:
    errors last from pose to pose. ``inside``: share of single poses within the 95 % band of χ² with 3 degrees of
    freedom. ``singular`` covariances, of a single particle, are left out of everything.
    """

    anees: float
    band: tuple[float, float]
    inside: float
    count: int
    singular: int


def nees(pairs: Pairs) -> tuple[NDArray[np.intp], FloatArray]:
    """Which measured pairs have a usable covariance (K,), and eᵀP⁻¹e of each (K,), e = (dx, dy, wrap(dyaw)) in map."""
    if pairs.covariances is None:
        return np.zeros(0, dtype=np.intp), np.zeros(0)
    chosen = np.flatnonzero(pairs.updated & _regular(pairs.covariances))
    error = pairs.estimated[chosen] - pairs.expected[chosen]
    error[:, 2] = se2.wrap(error[:, 2])
    solved = np.linalg.solve(pairs.covariances[chosen], error[:, :, np.newaxis])[:, :, 0]
    return chosen, np.asarray((error * solved).sum(axis=1), dtype=np.float64)


def consistency(pairs: Pairs) -> Consistency | None:
    """ANEES of a track with its band; None if it states no covariance that can be used."""
    chosen, values = nees(pairs)
    if not chosen.size:
        return None
    return Consistency(
        anees=float(values.mean()) / DIMENSION,
        band=anees_band(values.size),
        inside=_share_between(values, *chi2_band(DIMENSION)),
        count=values.size,
        singular=int(pairs.updated.sum()) - values.size,
    )


def anees_band(runs: int, confidence: float = 0.95) -> tuple[float, float]:
    """Where the ANEES of ``runs`` independent errors lies if they are consistent: quantiles of χ²(3·runs)/(3·runs)."""
    low, high = chi2_band(DIMENSION * runs, confidence)
    return low / (DIMENSION * runs), high / (DIMENSION * runs)


def chi2_band(degrees: int, confidence: float = 0.95) -> tuple[float, float]:
    """Quantiles of χ² that leave the same share out below and above."""
    from scipy.special import chdtri  # quantile of the upper tail; scipy.stats would cost half a second

    tail = 0.5 * (1.0 - confidence)
    return float(chdtri(degrees, 1.0 - tail)), float(chdtri(degrees, tail))


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


def consistency_over_runs(runs: Sequence[Pairs]) -> MomentsConsistency | None:
    """ANEES over tracks at each moment they have in common; None of fewer than two tracks, or without such moments."""
    if len(runs) < 2:
        return None
    found = [(pairs.stamps_ns[chosen], values) for pairs in runs for chosen, values in [nees(pairs)]]
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
