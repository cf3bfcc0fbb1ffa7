"""The beam mixture's parameters, its four components in three forms, and how beams combine.

Arguments broadcast: readings ``r`` (B,), expected ranges ``r_star`` (N, B) [m]. A form returns its components already
weighted; their sum is p(r | r*) except where ``textbook`` says otherwise.

``textbook``: proper densities on [0, r_max] and a point mass at r_max, see ``mclcli.sensors.beam``. ``nav2`` and
``beluga``: as nav2_amcl (no normalisers) and Beluga (normalised hit and short, mass beside uniform) compute them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Literal, final, get_args

import numpy as np

from mclcli.errors import UsageError
from mclcli.parameters import YesNo, parameter, validate
from mclcli.world.raycast import CastMethod, RayUnknown

if TYPE_CHECKING:
    from collections.abc import Callable

    from mclcli.arrays import FloatArray

    Form = Callable[["BeamParameters", FloatArray, FloatArray, float, float], "Components"]
    Combination = Callable[[FloatArray], FloatArray]

NoReturn = Literal["mixture", "censored"]
BeamForm = Literal["textbook", "nav2", "beluga"]
BeamCombination = Literal["log", "one_plus_cubes", "cubes"]

FLOOR: Final = 1e-12
_SQRT2: Final = math.sqrt(2.0)
_SQRT_TAU: Final = math.sqrt(2.0 * math.pi)


@final
@dataclass(frozen=True, slots=True, eq=False)
class Components:
    """What each component adds to p(r | r*), (N, B) each [1/m, or a probability where a reading is r_max]."""

    hit: FloatArray
    short: FloatArray
    max: FloatArray
    rand: FloatArray

    def total(self) -> FloatArray:
        """p(r | r*), (N, B)."""
        return np.asarray(self.hit + self.short + self.max + self.rand)


def textbook(p: BeamParameters, r: FloatArray, r_star: FloatArray, r_max: float, half_cell: float) -> Components:
    """Densities whose integral over [0, r_max] is 1 − z_max, and the mass z_max at r_max.

    Readings from r_max on count as r_max, where all components add up; with ``no_return=censored`` only max and hit do:
    z_max and the share of hits from r_max on. Negative readings have no density.
    """
    from scipy.special import ndtr

    nothing, seen = r >= r_max, np.minimum(r, r_max)
    expected = np.minimum(r_star, r_max)
    too_near = expected < half_cell
    hit = (p.z_hit + np.where(too_near, p.z_short, 0.0)) * _hit_density(seen, expected, p.sigma_hit, r_max)
    before = (seen < expected) | (nothing & (expected == r_max))
    until = np.where(too_near, 1.0, expected)
    short = np.where(before & ~too_near, p.z_short, 0.0) * _short_density(seen, until, p.lambda_short, r_max)
    rand = np.broadcast_to(np.where(r >= 0.0, p.z_rand / r_max, 0.0), hit.shape)
    hit, short = np.where(r >= 0.0, hit, 0.0), np.where(r >= 0.0, short, 0.0)
    if p.no_return == "censored":
        with np.errstate(over="ignore"):  # a tiny σ
            unseen = p.z_hit * ndtr((r_star - r_max) / p.sigma_hit)
        hit = np.where(nothing, unseen, hit)
        short, rand = np.where(nothing, 0.0, short), np.where(nothing, 0.0, rand)
    return Components(hit, short, np.broadcast_to(np.where(nothing, p.z_max, 0.0), hit.shape), rand)


def textbook_terms(p: BeamParameters, r: FloatArray, r_max: float) -> tuple[FloatArray, float]:
    """What of ``textbook`` does not depend on r*, (5, B), and λ, for the kernel ``beam_mixture``, which see."""
    there, nothing, seen = r >= 0.0, r >= r_max, np.minimum(r, r_max)
    rate = p.lambda_short if p.lambda_short * r_max >= 1e-12 else 0.0  # 0 stands for the limit 1/r*
    decay = rate * np.exp(-rate * np.maximum(seen, 0.0)) if rate > 0.0 else np.ones(r.shape)
    always = np.where(there, p.z_rand / r_max, 0.0) + np.where(nothing, p.z_max, 0.0)
    bound = np.where(nothing, np.nextafter(r_max, 0.0), seen)  # only r* = r_max is beyond it
    return np.stack([seen, there.astype(np.float64), np.where(there, p.z_short * decay, 0.0), bound, always]), rate


def _hit_density(r: FloatArray, r_star: FloatArray, sigma: float, r_max: float) -> FloatArray:
    """N(r; r*, σ²) / (Φ((r_max − r*)/σ) − Φ(−r*/σ)), the difference as a sum: nothing cancels, however large σ is."""
    from scipy.special import erf

    with np.errstate(over="ignore"):
        share = 0.5 * (erf((r_max - r_star) / (_SQRT2 * sigma)) + erf(r_star / (_SQRT2 * sigma)))
        density = np.exp(-0.5 * ((r - r_star) / sigma) ** 2) / (sigma * _SQRT_TAU * share)
    return np.asarray(density)


def _short_density(r: FloatArray, r_star: FloatArray, rate: float, r_max: float) -> FloatArray:
    """λ e^{−λr} / (1 − e^{−λr*}), 1/r* in the limit λ → 0; r* must be above 0."""
    if rate * r_max < 1e-12:
        return 1.0 / r_star
    return np.asarray(rate * np.exp(-rate * np.maximum(r, 0.0)) / -np.expm1(-rate * r_star))


def nav2(p: BeamParameters, r: FloatArray, r_star: FloatArray, r_max: float, half_cell: float) -> Components:
    """As nav2_amcl: no normalisers; r = r_max adds z_max, r < r_max the uniform, r > r_max neither."""
    del half_cell
    z = r - r_star
    with np.errstate(over="ignore"):
        hit = p.z_hit * np.exp(-(z * z) / (2.0 * p.sigma_hit * p.sigma_hit))
    until_met = np.exp(-p.lambda_short * np.clip(r, 0.0, r_max))
    short = np.where(z < 0.0, p.z_short * p.lambda_short * until_met, 0.0)
    at_max, rand = np.where(r == r_max, p.z_max, 0.0), np.where(r < r_max, p.z_rand / r_max, 0.0)
    return Components(hit, short, np.broadcast_to(at_max, hit.shape), np.broadcast_to(rand, hit.shape))


def beluga(p: BeamParameters, r: FloatArray, r_star: FloatArray, r_max: float, half_cell: float) -> Components:
    """As Beluga: hit normalised on [0, r_max], short on [0, r*]; z_max from r_max on, else the uniform."""
    del half_cell
    hit = p.z_hit * _hit_density(r, np.minimum(r_star, r_max), p.sigma_hit, r_max)
    before = (r >= 0.0) & (r < r_star)
    until = np.maximum(np.where(before, r_star, 1.0), 1e-12)  # far below any cell
    short = np.where(before, p.z_short, 0.0) * _short_density(r, until, p.lambda_short, r_max)
    at_max, rand = np.where(r < r_max, 0.0, p.z_max), np.where(r < r_max, p.z_rand / r_max, 0.0)
    return Components(hit, short, np.broadcast_to(at_max, hit.shape), np.broadcast_to(rand, hit.shape))


def sum_of_logs(likelihood: FloatArray) -> FloatArray:
    """Σ log max(p, 1e-12) over the last axis."""
    floored = np.maximum(likelihood, FLOOR)
    return np.asarray(np.log(floored, out=floored).sum(axis=-1))


def one_plus_cubes(likelihood: FloatArray) -> FloatArray:
    """log(1 + Σ p³) over the last axis."""
    return np.asarray(np.log1p((likelihood**3).sum(axis=-1)))


def cubes(likelihood: FloatArray) -> FloatArray:
    """log Σ p³ over the last axis; −inf where all p are 0."""
    with np.errstate(divide="ignore"):
        return np.asarray(np.log((likelihood**3).sum(axis=-1)))


FORMS: Final[dict[BeamForm, Form]] = {"textbook": textbook, "nav2": nav2, "beluga": beluga}
COMBINATIONS: Final[dict[BeamCombination, Combination]] = {
    "log": sum_of_logs,
    "one_plus_cubes": one_plus_cubes,
    "cubes": cubes,
}


@final
@dataclass(frozen=True, slots=True)
class BeamParameters:
    """Parameters of the beam mixture."""

    z_hit: float = parameter(0.75, "weight of the hit component", low=0.0, in_nav2=True)
    z_short: float = parameter(0.10, "weight of unexpected obstacles before the expected one", low=0.0, in_nav2=True)
    z_max: float = parameter(0.05, "weight of seeing nothing", low=0.0, in_nav2=True)
    z_rand: float = parameter(0.10, "weight of the uniform component over [0, r_max]", low=0.0, in_nav2=True)
    sigma_hit: float = parameter(
        0.2, "standard deviation of the hit component", unit="m", low=1e-9, high=1e9, in_nav2=True
    )
    lambda_short: float = parameter(
        0.1, "rate per metre at which unexpected obstacles occur", low=0.0, high=1e9, in_nav2=True
    )
    no_return: NoReturn = parameter(
        "mixture",
        "a reading of r_max: all components add up there, or the probability that there is nothing nearer "
        "(beam_form=textbook)",
        choices=get_args(NoReturn),
    )
    beam_form: BeamForm = parameter(
        "textbook",
        "components as proper densities, or as nav2_amcl or Beluga have them",
        choices=get_args(BeamForm),
    )
    combination: BeamCombination = parameter(
        "log",
        "beams combine as Σ log p, as log(1 + Σ p³) or as log Σ p³",
        choices=get_args(BeamCombination),
    )
    weights_sum_to_1: YesNo = parameter(
        "yes", "the four weights must sum to 1 ± 1e-6, or need not", choices=get_args(YesNo)
    )
    raycast: CastMethod = parameter(
        "exact", "how expected ranges are found: entering a cell, or on Bresenham's line", choices=get_args(CastMethod)
    )
    ray_unknown: RayUnknown = parameter("occupied", "what an unknown cell is to a ray", choices=get_args(RayUnknown))

    def __post_init__(self) -> None:
        validate(self)
        total = self.z_hit + self.z_short + self.z_max + self.z_rand
        if self.weights_sum_to_1 == "yes" and not abs(total - 1.0) <= 1e-6:
            raise UsageError(
                f"parameters z_hit + z_short + z_max + z_rand = {total:.9g}: must be 1; "
                "change one of them, or give --set weights_sum_to_1=no"
            )
