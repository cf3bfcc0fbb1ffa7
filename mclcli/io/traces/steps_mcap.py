"""Updates of a run read back from its trace as MCAP."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

import numpy as np

from mclcli.errors import InputError
from mclcli.io.logs import open_log
from mclcli.io.logs.base import Tally
from mclcli.io.messages.decoding import decode
from mclcli.records import StampedPose

if TYPE_CHECKING:
    from pathlib import Path

    from mclcli.arrays import FloatArray, IntArray

_STEP, _POSE = "/mcl/step", "/amcl_pose"


def read_steps(path: Path) -> tuple[IntArray, FloatArray, FloatArray, FloatArray]:
    """Stamps (N,) int64, estimated poses (N, 3), numbers of particles (N,) and their ESS (N,) of every update.

    Raises
    ------
    UsageError, InputError
        If there is no such file, or it is no trace of ``mcl run``.

    """
    steps: list[tuple[int, int, float]] = []
    poses: dict[int, FloatArray] = {}
    for message in open_log([path]).messages(frozenset({_STEP, _POSE}), Tally()):
        if message.channel.topic == _STEP and message.channel.type.endswith("Step"):
            steps.append(_step(message.data, path))
        else:
            record = decode(message)
            if isinstance(record, StampedPose):
                poses[record.stamp_ns] = record.pose
    whole = [step for step in steps if step[0] in poses]
    if not whole:
        raise InputError(f"{path}: no update of `mcl run` in it; name its steps (--steps F.csv) or its trace (-o)")
    stamps, particles, ess = zip(*whole, strict=True)
    return (
        np.array(stamps, dtype=np.int64),
        np.array([poses[stamp] for stamp in stamps]),
        np.array(particles, dtype=np.float64),
        np.array(ess, dtype=np.float64),
    )


def _step(data: bytes, path: Path) -> tuple[int, int, float]:
    """Stamp, n and ess at the head of an ``mcl_msgs/msg/Step`` in little-endian CDR."""
    body = bytes(data)[4:]
    try:
        seconds, nanoseconds, length = struct.unpack_from("<iII", body)
        at = -(-(12 + length) // 4) * 4
        _, n = struct.unpack_from("<II", body, at)
        (ess,) = struct.unpack_from("<d", body, -(-(at + 8) // 8) * 8)
    except struct.error:
        raise InputError(f"{path}: a message of {_STEP} is damaged; write the trace again") from None
    return seconds * 10**9 + nanoseconds, n, ess
