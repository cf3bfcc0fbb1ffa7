"""How many particles are enough: KLD sampling.

With k bins of the histogram occupied, n particles keep the Kullback-Leibler distance between the sampled belief and the
true one below ε with probability p, z its normal quantile, if

    n = (k−1)/(2ε) · (1 − 2/(9(k−1)) + sqrt(2/(9(k−1)))·z)³

Source: Fox 2003, eq. 7; Thrun, Burgard, Fox 2005, table 8.4.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, final, get_args

import numpy as np

from mclcli.errors import UsageError
from mclcli.geometry import se2
from mclcli.native import backend
from mclcli.parameters import parameter, validate

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from mclcli.arrays import BoolArray, FloatArray, IntArray

BIN_XY = 0.5  # [m]
BIN_YAW = np.radians(10.0)
YAW_BINS = 36  # of a whole turn


KldQuantile = Literal["probability", "z"]


@final
@dataclass(frozen=True, slots=True)
class KldParameters:
    """How exact the sampled belief must be, and between which sizes.

    nav2_amcl and Beluga use ``pf_z`` as the quantile itself (``kld_quantile`` = z: 0.99 is a probability of 84 %), and
    do not limit a belief within one bin (nav2) or two (Beluga) at all: ``kld_unlimited_bins``.
    """

    min_particles: int = parameter(
        2000, "smallest number of particles; the same as the largest: a fixed number", low=1, in_nav2=True
    )
    max_particles: int = parameter(2000, "largest number of particles, and how many to start with", low=1, in_nav2=True)
    pf_err: float = parameter(0.05, "largest Kullback-Leibler distance to the true belief", above=0.0, in_nav2=True)
    pf_z: float = parameter(0.99, "probability that pf_err holds, or its normal quantile", above=0.0, in_nav2=True)
    kld_quantile: KldQuantile = parameter("probability", "what pf_z is", choices=get_args(KldQuantile))
    kld_unlimited_bins: int = parameter(
        0, "with so many bins occupied or fewer, draw max_particles; 0: never (nav2_amcl: 1, Beluga: 2)", low=0, high=2
    )

    def __post_init__(self) -> None:
        validate(self)
        if self.min_particles > self.max_particles:
            raise UsageError(
                f"parameter min_particles = {self.min_particles}: must be at most max_particles = "
                f"{self.max_particles}; `particles=N` or `particles=MIN:MAX` sets both"
            )
        if self.kld_quantile == "probability" and self.pf_z >= 1.0:
            raise UsageError(
                f"parameter pf_z = {self.pf_z:g}: must be a probability below 1; "
                "where it is meant as a quantile, set kld_quantile=z"
            )

    @property
    def fixed(self) -> bool:
        """Whether the number never changes."""
        return self.min_particles == self.max_particles

    @property
    def z(self) -> float:
        """The normal quantile."""
        if self.kld_quantile == "z":
            return self.pf_z
        from statistics import NormalDist

        return NormalDist().inv_cdf(self.pf_z)


def required(k: ArrayLike, pf_err: float, z: float) -> FloatArray:
    """Particles that k occupied bins (any shape) call for, a whole number ≥ 0; 0 for one bin or none."""
    free = np.maximum(np.asarray(k, dtype=np.float64) - 1.0, 0.0)
    b = 2.0 / (9.0 * np.maximum(free, 1.0))
    x = 1.0 - b + np.sqrt(b) * z
    count: FloatArray = np.ceil(free / (2.0 * pf_err) * np.maximum(x, 0.0) ** 3)
    return count


def limit(k: ArrayLike, parameters: KldParameters) -> IntArray:
    """Particles for k occupied bins (any shape), between min_particles and max_particles."""
    smallest, largest, few = parameters.min_particles, parameters.max_particles, parameters.kld_unlimited_bins
    enough = np.clip(required(k, parameters.pf_err, parameters.z), smallest, largest)
    unlimited = (np.asarray(k) <= few) & (few > 0)
    return np.where(unlimited, largest, enough).astype(np.int64)


def kld_size(drawn: FloatArray, parameters: KldParameters, rng: np.random.Generator) -> int:
    """Particles that a belief needs: drawn poses (n, 3) are visited in random order until there are enough of them.

    Returns the first n* with n* ≥ ``limit`` of the bins seen so far, at most max_particles; all n if there never are
    enough. ``drawn`` are the poses of max_particles ancestors.
    """
    fresh = _first_of_its_bin(bins(drawn)[rng.permutation(drawn.shape[0])])
    seen = np.cumsum(fresh)
    limits = limit(np.arange(seen[-1] + 1), parameters)
    enough = np.arange(1, seen.size + 1) >= limits[seen]
    return int(np.argmax(enough)) + 1 if enough.any() else int(seen.size)


def bins(poses: FloatArray, *, wrap_yaw: bool = True) -> IntArray:
    """Bins (N, 3) of 0.5 m × 0.5 m × 10° that poses (N, 3) fall into.

    With ``wrap_yaw`` the bins of yaw are −18 … 17 all around; without it the number goes on over the half turn, as in
    nav2_amcl, so that one heading has many bins.
    """
    index = np.empty(poses.shape, dtype=np.int64)
    if backend.in_use():
        turn = YAW_BINS if wrap_yaw else 0
        backend.load("particles").bins(np.ascontiguousarray(poses), BIN_XY, float(BIN_YAW), turn, index)
        return index
    index[:, :2] = np.floor(poses[:, :2] / BIN_XY)
    yaw = np.floor((se2.wrap(poses[:, 2]) if wrap_yaw else poses[:, 2]) / BIN_YAW).astype(np.int64)
    index[:, 2] = np.where(yaw == YAW_BINS // 2, -YAW_BINS // 2, yaw) if wrap_yaw else yaw  # π is −π
    return index


def _first_of_its_bin(index: IntArray) -> BoolArray:
    """Whether each row (N, 3) is the first with its bin."""
    fresh = np.zeros(index.shape[0], dtype=np.bool_)
    fresh[number_compiled(index)[1] if backend.in_use() else np.unique(pack(index)[0], return_index=True)[1]] = True
    return fresh


def number_compiled(
    index: IntArray,
) -> tuple[IntArray, IntArray, IntArray]:
    """Number (N,) of each bin (N, 3) in the order they first appear, where each of the C does, and the hash table."""
    number, first, count = np.empty(index.shape[0], np.int64), np.empty(index.shape[0], np.int64), np.zeros(1, np.int64)
    table = np.full(1 << (2 * index.shape[0]).bit_length(), -1)
    backend.load("particles").number_bins(index, number, first, count, table)
    return number, first[: count[0]], table


def pack(index: IntArray) -> tuple[IntArray, IntArray]:
    """Bins (N, 3) as single numbers (N,), and the strides (3,) from a bin to its neighbours' numbers.

    A margin of one bin on each side keeps neighbours apart. Good for poses within 10⁸ m of each other.
    """
    low = index.min(axis=0) - 1
    _, ny, nyaw = index.max(axis=0) - low + 2
    strides = np.array([ny * nyaw, nyaw, 1])
    return np.sum((index - low) * strides, axis=1), strides
