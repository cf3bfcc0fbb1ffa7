"""What sensors said: messages of a log as plain values, free of any file format.

Stamps are int64 nanoseconds (suffix ``_ns``), angles radians, lengths metres. Arrays are read-only.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, final

if TYPE_CHECKING:
    from collections.abc import Callable

    from mclcli.arrays import FloatArray


@final
@dataclass(frozen=True, slots=True, eq=False)
class LaserScan:
    """One sweep of a planar lidar (sensor_msgs/LaserScan).

    ``ranges``: (B,) float64 as recorded: NaN, ±inf and out-of-range values are still there. Beam i points along
    ``angle_min + i·angle_increment`` in the plane z = 0 of ``frame_id``, at ``stamp_ns + i·time_increment``.
    """

    stamp_ns: int
    frame_id: str
    angle_min: float
    angle_increment: float
    range_min: float
    range_max: float
    ranges: FloatArray
    angle_max: float = 0.0
    time_increment: float = 0.0
    scan_time: float = 0.0


@final
@dataclass(frozen=True, slots=True, eq=False)
class Odometry:
    """Pose of the base in the odometry frame: ``pose`` (3,) float64, x, y [m], yaw [rad].

    ``twist`` is the velocity that is stated beside it, in the base's frame: x, y [m/s], yaw [rad/s].
    """

    stamp_ns: int
    frame_id: str
    child_frame_id: str
    pose: FloatArray
    twist: tuple[float, float, float] = (0.0, 0.0, 0.0)


@final
@dataclass(frozen=True, slots=True, eq=False)
class Transform:
    """One edge of the transform tree: ``parent_from_child`` (4, 4) float64; ``static`` if from /tf_static."""

    stamp_ns: int
    parent: str
    child: str
    parent_from_child: FloatArray
    static: bool


@final
@dataclass(frozen=True, slots=True, eq=False)
class StampedPose:
    """A pose from outside: ground truth, an initial pose, another localizer's answer.

    ``pose`` (3,) x, y [m], yaw [rad] in ``frame_id``; ``covariance`` (3, 3) of (x, y, yaw), or None if unusable.
    ``matrix`` (4, 4) is the pose in space where that is known: a frame may have another axis up.
    """

    stamp_ns: int
    frame_id: str
    pose: FloatArray
    covariance: FloatArray | None = None
    matrix: FloatArray | None = None


@final
@dataclass(frozen=True, slots=True, eq=False)
class LandmarkSightings:
    """Landmarks seen from one image: ids, and rays (M, 3) float64 towards them in ``frame_id`` (any length > 0)."""

    stamp_ns: int
    frame_id: str
    ids: tuple[str, ...]
    rays: FloatArray


@final
@dataclass(frozen=True, slots=True, eq=False)
class PixelSightings:
    """Landmarks seen in one image: ids, and where: ``pixels`` (M, 2) float64, u to the right, v down [px].

    ``frame_id`` is the camera's optical frame: x right, y down, z forward.
    """

    stamp_ns: int
    frame_id: str
    ids: tuple[str, ...]
    pixels: FloatArray


@final
@dataclass(frozen=True, slots=True, eq=False)
class CameraModel:
    """A camera's calibration as in sensor_msgs/CameraInfo; ``geometry.pinhole`` checks it.

    ``k`` (3, 3) and ``distortion`` (C,) of model ``distortion_model`` belong to the raw image, the rotation ``r``
    (3, 3) leads from it to the rectified one, to which ``p`` (3, 4) belongs. They are told for the full image, of
    which ``binning`` (x, y) pixels make one of the published image, after ``offset`` (x, y) [px] was cut off.
    """

    stamp_ns: int
    frame_id: str
    distortion_model: str
    distortion: FloatArray
    k: FloatArray
    r: FloatArray
    p: FloatArray
    binning: tuple[int, int] = (1, 1)
    offset: tuple[int, int] = (0, 0)


@final
@dataclass(frozen=True, slots=True)
class NextLog:
    """From here on come messages of another log, which does not follow the one before; ``why`` for the user."""

    why: str


@final
@dataclass(frozen=True, slots=True, eq=False)
class Estimate:
    """What the filter believes: ``pose`` (3,) x, y [m], yaw [rad] in map, and its ``covariance`` (3, 3)."""

    pose: FloatArray
    covariance: FloatArray


@final
@dataclass(frozen=True, slots=True, eq=False)
class Hypothesis:
    """One place where the robot may be: a cluster of particles with its ``weight``, mean and covariance."""

    weight: float
    estimate: Estimate


@final
@dataclass(frozen=True, slots=True, eq=False)
class StepRecord:
    """One filter update over N particles and S sensors, with every weight.

    ``poses`` (N, 3) as scored, before resampling. ``log_likelihoods`` (S, N), untempered, a row per name in
    ``sensors``. ``log_weights`` (N,) = log W_{t−1} + Σ α·ℓ; ``weights`` (N,) is its softmax.
    ``log_evidence`` = log Σ W_{t−1} e^{Σℓ}, untempered. ``beams_used`` counts beams and sightings scored.
    ``reliability`` in [0, 1]: about the share of beams that the map explains, see ``mclcli.filter.fit``.
    ``hypotheses`` finds the heaviest clusters, in falling order of weight, when somebody asks: that takes as long as
    half a step. ``injected`` particles of the next step were drawn anew. ``counts`` are beams and sightings scored per
    sensor; with temperature ``auto``, α·count is K_eff. ``lost``: the robot is probably lost, or off the map.
    ``modes`` places are kept alive that the start has found; 0 once one of them is chosen.
    """

    step: int
    stamp_ns: int
    poses: FloatArray
    sensors: tuple[str, ...]
    alphas: tuple[float, ...]
    log_likelihoods: FloatArray
    log_weights: FloatArray
    weights: FloatArray
    ess: float
    log_evidence: float
    resampled: bool
    degenerate: bool
    beams_used: int
    estimate: Estimate
    segment: int
    converged: bool
    reliability: float
    hypotheses: Callable[[], tuple[Hypothesis, ...]] = tuple
    injected: int = 0
    counts: tuple[int, ...] = ()
    lost: bool = False
    modes: int = 0


@final
@dataclass(frozen=True, slots=True, eq=False)
class TrackPoint:
    """Where the robot was at one scan: between updates the last estimate carried on by odometry.

    ``odom_from_base`` (3,) is the interpolated odometry at the stamp; ``step`` is the update made at this scan, or
    None where the gate let it pass; ``scan`` the scan itself, or None for runs without a lidar. ``measured``: the
    scan took part in the estimate though there is no update, as in a smoothed track.
    """

    stamp_ns: int
    estimate: Estimate
    segment: int
    odom_from_base: FloatArray
    step: StepRecord | None = None
    scan: LaserScan | None = None
    measured: bool = False

    @property
    def updated(self) -> bool:
        """Whether the scan took part in the estimate, which else was carried on by odometry."""
        return self.measured or self.step is not None
