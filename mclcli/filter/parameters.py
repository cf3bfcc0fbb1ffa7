"""The filter's own parameters: its rhythm, and what it states."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, final, get_args

from mclcli.filter.resampling import RESAMPLERS
from mclcli.parameters import parameter, validate

Estimated = Literal["before", "after"]
Averaged = Literal["set", "heaviest"]
CovarianceOf = Literal["sandwich", "sample"]
MeanOf = Literal["set", "heaviest", "heaviest_if_apart"]
Degenerate = Literal["carry", "uniform"]
Gate = Literal["euclidean", "per_axis"]


@final
@dataclass(frozen=True, slots=True)
class FilterParameters:
    """Rhythm of the filter, and what it states."""

    resampler: str = parameter("systematic", "how ancestors are drawn", choices=tuple(RESAMPLERS))
    resample_ess: float = parameter(
        0.5,
        "resample when the effective sample size falls below this share of the particles; 1: always",
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
    fit_trusted: float = parameter(
        0.8,
        "temperature `auto`: a reading that fits worse than this counts less; 0: all count alike",
        low=0.0,
        high=1.0,
    )
    fit_ignored: float = parameter(
        0.5, "temperature `auto`: a reading that fits no better than this counts 1/20", low=0.0, high=1.0
    )
    estimate: Estimated = parameter(
        "before",
        "the estimate is of the weighted set before resampling, or of the set after",
        choices=get_args(Estimated),
    )
    estimate_mean: MeanOf = parameter(
        "heaviest_if_apart",
        "the pose reported is the mean of the whole set, or of its heaviest cluster: always, or if clusters are apart",
        choices=get_args(MeanOf),
    )
    estimate_covariance: Averaged = parameter(
        "set",
        "the covariance reported is that of the whole set, or of its heaviest cluster",
        choices=get_args(Averaged),
    )
    covariance: CovarianceOf = parameter(
        "sandwich",
        "the covariance reported is that of the estimate's error, or the particles' own",
        choices=get_args(CovarianceOf),
        source="White 1982",
    )
    hypotheses: int = parameter(
        4, "clusters of particles reported at every update, the heaviest first; 0: none", low=0, high=100
    )
    degenerate: Degenerate = parameter(
        "carry",
        "where no weight is left, the carried ones stay, or all become equal",
        choices=get_args(Degenerate),
    )
    gate: Gate = parameter(
        "euclidean",
        "update_min_d is a distance, or bounds x and y of the odometry frame each",
        choices=get_args(Gate),
    )
    update_min_d: float = parameter(
        0.25, "motion that calls for an update; below 0 every scan does", unit="m", in_nav2=True
    )
    update_min_a: float = parameter(
        0.2, "turn that calls for an update; below 0 every scan does", unit="rad", in_nav2=True
    )
    vision_min_d: float = parameter(0.02, "motion that calls for an update in runs without a lidar", unit="m", low=0.0)
    vision_min_a: float = parameter(0.02, "turn that calls for an update in runs without a lidar", unit="rad", low=0.0)

    def __post_init__(self) -> None:
        validate(self)
