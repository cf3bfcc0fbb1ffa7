"""The ROS 2 messages of a trace: their definitions, and how our records become their bytes."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, Protocol

import numpy as np

from mclcli.errors import InputError
from mclcli.geometry.trigonometry import cos_sin
from mclcli.io.logs.base import Channel
from mclcli.io.traces.cdr import CdrWriter
from mclcli.io.traces.sinks import NANOSECONDS, stamp_text
from mclcli.native.backend import NUMPY, Backend

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from mclcli.arrays import FloatArray
    from mclcli.records import Estimate, LaserScan, StepRecord, Transform

_PLANAR = np.ix_([0, 1, 5], [0, 1, 5])  # x, y and rotation about z of a 6 × 6 covariance
_SEPARATOR = "=" * 80 + "\n"
_NESTED = re.compile(r"^(\w+/\w+)(?:\[\d*\])? ", re.MULTILINE)

ROUNDING = "particles: x, y to 2^-20 m, quaternions to 2^-24; log_likelihoods to 2^-20, then float32; all else exact"


class Grid(Protocol):
    """What a map must have to be written: a ``mclcli.world.occupancy.OccupancyGrid`` has it.

    ``cells`` (H, W) int8 as in nav_msgs/OccupancyGrid, row 0 at the bottom; ``resolution`` [m] a cell; ``origin`` (3,)
    pose of the outer corner of cell (0, 0).
    """

    @property
    def cells(self) -> NDArray[np.int8]:
        """Occupancy, 0 to 100, −1 unknown."""
        ...

    @property
    def resolution(self) -> float:
        """Side of a cell [m]."""
        ...

    @property
    def origin(self) -> FloatArray:
        """Pose (x, y, yaw) of the grid's corner in the map frame."""
        ...


def definition(name: str) -> str:
    """Full text of a message type such as ``tf2_msgs/msg/TFMessage``, every type that it needs below it.

    Fields are those of ROS 2 Humble, without comments; types stand in the order in which they are first needed.
    Format: MCAP specification, registry, schema encoding ``ros2msg``.
    """
    from mclcli.io.messages.definitions import definition_of

    root = name.replace("/msg/", "/")
    sections = f"MSG: {root}\n{definition_of(Channel('', name, 'cdr'))}".split(_SEPARATOR)
    texts = dict(section.removeprefix("MSG: ").split("\n", maxsplit=1) for section in sections)
    needed = [root]
    for known in needed:  # grows while it is read
        needed += [found for found in _NESTED.findall(texts[known]) if found not in needed]
    return texts[root] + "".join(f"{_SEPARATOR}MSG: {other}\n{texts[other]}" for other in needed[1:])


def planar_poses(poses: FloatArray) -> FloatArray:
    """Planar poses (N, 3) as position and quaternion (N, 7): x, y, z, qx, qy, qz, qw."""
    rows = np.zeros((len(poses), 7))
    rows[:, :2] = poses[:, :2]
    rows[:, 5], rows[:, 6] = np.sin(0.5 * poses[:, 2]), np.cos(0.5 * poses[:, 2])
    return rows


def rounded_clouds(poses: FloatArray, weights: FloatArray, backend: Backend = NUMPY) -> tuple[FloatArray, FloatArray]:
    """``planar_poses`` (N, 7), and the same with their weights (N, 8), rounded as ``ROUNDING`` says.

    So their last bytes are zero and chunks compress.
    """
    particles, kernels = np.zeros((len(poses), 8)), backend.kernels("clouds")
    if kernels is not None:
        rows, scratch, poses = np.empty((len(poses), 7)), np.empty((3, 512)), np.ascontiguousarray(poses)
        kernels.rounded_rows(poses, np.ascontiguousarray(weights), 2.0**20, 2.0**24, rows, particles, scratch)
        return rows, particles
    particles[:, :2], particles[:, 7] = _rounded(poses[:, :2], 20), weights
    cos, sin = cos_sin(0.5 * poses[:, 2])
    particles[:, 5], particles[:, 6] = _rounded(sin, 24), _rounded(cos, 24)
    return np.ascontiguousarray(particles[:, :7]), particles


def _rounded(values: FloatArray, bits: int) -> FloatArray:
    """Values to the nearest multiple of 2^-bits."""
    return np.asarray(np.rint(values * 2.0**bits) * 2.0**-bits)


def quaternion(rotation: FloatArray) -> tuple[float, ...]:
    """Unit quaternion (x, y, z, w), w ≥ 0, of a rotation matrix (3, 3) or the upper left of a (4, 4).

    Source: Shepperd 1978: of the four ways to read it off, the one with the largest divisor.
    """
    ((a, b, c), (d, e, f), (g, h, i)) = rotation[:3, :3].tolist()
    candidates = (
        (1 + a - e - i, b + d, c + g, h - f),
        (b + d, 1 - a + e - i, f + h, c - g),
        (c + g, f + h, 1 - a - e + i, d - b),
        (h - f, c - g, d - b, 1 + a + e + i),
    )
    _, q = max((candidates[k][k], candidates[k]) for k in (3, 0, 1, 2))
    length = math.copysign(math.sqrt(sum([v * v for v in q])), q[3])
    return tuple([v / length for v in q])


def occupancy_grid(stamp_ns: int, frame: str, grid: Grid) -> bytes:
    """nav_msgs/OccupancyGrid."""
    message = _with_header(stamp_ns, frame)
    _time(message, stamp_ns)
    message.f32(grid.resolution)
    height, width = grid.cells.shape
    message.u32(width)
    message.u32(height)
    _pose(message, np.asarray(grid.origin, dtype=np.float64))
    message.sequence(np.asarray(grid.cells, dtype=np.int8))
    return message.finish()


def tf_message(transforms: Sequence[Transform]) -> bytes:
    """tf2_msgs/TFMessage."""
    message = CdrWriter()
    message.u32(len(transforms))
    for transform in transforms:
        _header(message, transform.stamp_ns, transform.parent)
        message.string(transform.child)
        message.f64(*transform.parent_from_child[:3, 3].tolist(), *quaternion(transform.parent_from_child))
    return message.finish()


def pose_stamped(stamp_ns: int, frame: str, pose: FloatArray) -> bytes:
    """geometry_msgs/PoseStamped."""
    message = _with_header(stamp_ns, frame)
    _pose(message, pose)
    return message.finish()


def pose_with_covariance(stamp_ns: int, frame: str, estimate: Estimate) -> bytes:
    """geometry_msgs/PoseWithCovarianceStamped; the covariance's rows are x, y, z, roll, pitch, yaw."""
    covariance = np.zeros((6, 6))
    covariance[_PLANAR] = estimate.covariance
    message = _with_header(stamp_ns, frame)
    _pose(message, estimate.pose)
    message.array(covariance)
    return message.finish()


def particle_cloud(stamp_ns: int, frame: str, particles: FloatArray) -> bytes:
    """nav2_msgs/ParticleCloud of poses and weights (N, 8)."""
    message = _with_header(stamp_ns, frame)
    message.sequence(particles, count=len(particles))
    return message.finish()


def pose_array(stamp_ns: int, frame: str, poses: FloatArray) -> bytes:
    """geometry_msgs/PoseArray of poses (N, 7)."""
    message = _with_header(stamp_ns, frame)
    message.sequence(poses, count=len(poses))
    return message.finish()


def step(record: StepRecord, frame: str) -> bytes:
    """mcl_msgs/Step."""
    message = _with_header(record.stamp_ns, frame)
    message.u32(record.step)
    message.u32(len(record.poses))
    message.f64(record.ess, record.log_evidence)
    message.boolean(record.resampled)
    message.boolean(record.degenerate)
    message.u32(record.beams_used)
    message.strings(record.sensors)
    message.sequence(np.asarray(record.alphas, dtype=np.float64))
    message.sequence(_rounded(record.log_likelihoods, 20).astype(np.float32))
    return message.finish()


def laser_scan(scan: LaserScan) -> bytes:
    """sensor_msgs/LaserScan, as recorded but for the intensities."""
    message = _with_header(scan.stamp_ns, scan.frame_id)
    message.f32(scan.angle_min, scan.angle_max, scan.angle_increment, scan.time_increment, scan.scan_time)
    message.f32(scan.range_min, scan.range_max)
    message.sequence(scan.ranges.astype(np.float32))
    message.sequence(np.empty(0, dtype=np.float32))
    return message.finish()


def _pose(message: CdrWriter, pose: FloatArray) -> None:
    """geometry_msgs/Pose of a planar pose (3,)."""
    x, y, yaw = pose.tolist()
    message.f64(x, y, 0.0, 0.0, 0.0, math.sin(0.5 * yaw), math.cos(0.5 * yaw))


def _with_header(stamp_ns: int, frame: str) -> CdrWriter:
    message = CdrWriter()
    _header(message, stamp_ns, frame)
    return message


def _header(message: CdrWriter, stamp_ns: int, frame: str) -> None:
    _time(message, stamp_ns)
    message.string(frame)


def _time(message: CdrWriter, stamp_ns: int) -> None:
    seconds, nanoseconds = divmod(int(stamp_ns), NANOSECONDS)
    if not -(1 << 31) <= seconds < 1 << 31:
        raise InputError(f"MCAP trace: stamp {stamp_text(stamp_ns)} does not fit ROS time (int32 s); write CSV instead")
    message.i32(seconds)
    message.u32(nanoseconds)
