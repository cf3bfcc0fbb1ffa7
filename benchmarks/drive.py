"""A log of any length, on stdout or in a file: ``python -m benchmarks.drive SCANS [FILE]``.

A robot goes round a circle in a room of the office map: 720-beam scans, one odometry and one tf message a scan, 40 Hz,
MCAP with zstd. The messages of one round are made once; later rounds only get new stamps, so that gigabytes come at the
speed of a disk.
"""

from __future__ import annotations

import math
import struct
import sys
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, cast

import numpy as np
from mcap.writer import Writer

from mclcli.io.maps.map_yaml import load_map
from mclcli.io.traces.cdr import CdrWriter
from mclcli.world.raycast import make_caster

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray

MAP = Path(__file__).resolve().parents[1] / "maps/office.yaml"
CENTRE, RADIUS = (-7.4, 1.2), 0.4
BEAMS, ROUND, PERIOD_NS = 720, 400, 25_000_000
START = f"{CENTRE[0] + RADIUS},{CENTRE[1]},90deg,0.1,5deg"
"""``--init`` of this drive."""
TYPES = {
    "/scan": "sensor_msgs/msg/LaserScan",
    "/odom": "nav_msgs/msg/Odometry",
    "/tf": "tf2_msgs/msg/TFMessage",
}
_BEGIN_NS = 1_700_000_000_000_000_000
_STAMP_AT = {"/scan": 4, "/odom": 4, "/tf": 8}  # bytes of CDR before the stamp
_SCAN_LATE_NS = 1_000_000  # a scan's stamp is this much before that of its odometry


def pose_at(index: int) -> FloatArray:
    """Pose (3,) of the base in map at a scan."""
    angle = 2.0 * math.pi * (index % ROUND) / ROUND
    yaw = math.remainder(angle + math.pi / 2, 2.0 * math.pi)
    return np.array([CENTRE[0] + RADIUS * math.cos(angle), CENTRE[1] + RADIUS * math.sin(angle), yaw])


def _started(frame: str) -> CdrWriter:
    message = CdrWriter()
    message.i32(0)
    message.u32(0)
    message.string(frame)
    return message


def _scan(ranges: FloatArray, increment: float) -> bytes:
    message = _started("base_link")
    message.f32(-math.pi, math.pi - increment, increment, 0.0, 0.025, 0.1, 12.0)
    message.sequence(ranges.astype(np.float32))
    message.sequence(np.empty(0, np.float32))
    return message.finish()


def _pose(message: CdrWriter, pose: FloatArray) -> None:
    message.f64(pose[0], pose[1], 0.0, 0.0, 0.0, math.sin(pose[2] / 2), math.cos(pose[2] / 2))


def _odometry(pose: FloatArray) -> bytes:
    message = _started("odom")
    message.string("base_link")
    _pose(message, pose)
    message.array(np.zeros(36 + 6 + 36))
    return message.finish()


def _transform(pose: FloatArray) -> bytes:
    message = CdrWriter()
    message.u32(1)
    message.i32(0)
    message.u32(0)
    message.string("odom")
    message.string("base_link")
    _pose(message, pose)
    return message.finish()


def one_round() -> list[dict[str, bytearray]]:
    """Messages of one round by topic, their stamps still to come; ranges by casting rays, with 1 cm of noise."""
    increment = 2.0 * math.pi / BEAMS
    angles = -math.pi + increment * np.arange(BEAMS)
    directions = np.column_stack([np.cos(angles), np.sin(angles)])
    poses = np.array([pose_at(index) for index in range(ROUND)])
    ranges = make_caster(load_map(MAP)).ranges(poses, np.zeros((BEAMS, 2)), directions, 12.0)
    ranges += np.random.default_rng(0).normal(0.0, 0.01, ranges.shape)
    return [
        {
            "/odom": bytearray(_odometry(pose)),
            "/tf": bytearray(_transform(pose)),
            "/scan": bytearray(_scan(seen, increment)),
        }
        for pose, seen in zip(poses, ranges, strict=True)
    ]


class _Counted:
    """Knows where it is, as the library asks; a pipe does not."""

    def __init__(self, file: BinaryIO) -> None:
        self._file, self._at = file, 0

    def write(self, data: bytes) -> int:
        self._at += len(data)
        return self._file.write(data)

    def tell(self) -> int:
        return self._at

    def flush(self) -> None:
        self._file.flush()


def write(file: BinaryIO, scans: int) -> None:
    """Write the log of so many scans."""
    from rosbags.typesys import Stores, get_typestore

    store, messages = get_typestore(Stores.ROS2_HUMBLE), one_round()
    writer = Writer(cast("BinaryIO", _Counted(file)))
    writer.start(profile="ros2", library="mcl benchmarks")
    channels = {}
    for topic, name in TYPES.items():
        text, _ = store.generate_msgdef(name, ros_version=2)
        channels[topic] = writer.register_channel(topic, "cdr", writer.register_schema(name, "ros2msg", text.encode()))
    for index in range(scans):
        for topic, data in messages[index % ROUND].items():
            stamp = _BEGIN_NS + index * PERIOD_NS - (_SCAN_LATE_NS if topic == "/scan" and index else 0)
            struct.pack_into("<iI", data, _STAMP_AT[topic], *divmod(stamp, 1_000_000_000))
            writer.add_message(channels[topic], stamp, bytes(data), stamp)
    writer.finish()  # type: ignore[no-untyped-call]


@np.errstate(all="raise")
def main() -> None:
    """Write to the file named, or to stdout."""
    if len(sys.argv) > 2:
        with Path(sys.argv[2]).open("wb") as file:
            write(file, int(sys.argv[1]))
    else:
        write(cast("BinaryIO", sys.stdout.buffer), int(sys.argv[1]))


if __name__ == "__main__":
    main()
