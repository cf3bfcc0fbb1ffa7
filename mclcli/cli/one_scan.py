"""The one scan that a command works on: a text file, standard input, or one message of a log."""

from __future__ import annotations

import itertools
from array import array
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar, final

import numpy as np

from mclcli.cli import console
from mclcli.errors import InputError, UsageError
from mclcli.records import LaserScan

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from mclcli.arrays import FloatArray
    from mclcli.cli.chosen import Chosen
    from mclcli.cli.clock import LogTime
    from mclcli.cli.options import ScanSource
    from mclcli.io.recording.recording import Recording
    from mclcli.io.recording.roles import Roles

Message = TypeVar("Message")

_CAMERA = "camera"  # the frame of --bearings
_NEAR_NS = 100_000_000  # a time is often told with one decimal


@final
@dataclass(frozen=True, slots=True, eq=False)
class MountedScan:
    """A scan and where its lidar sits: ``base_from_sensor`` (4, 4); ``base_frame`` where known."""

    scan: LaserScan
    base_from_sensor: FloatArray
    base_frame: str


def find_scan(source: ScanSource, mounts: Mapping[str, FloatArray], chosen: Chosen) -> MountedScan:
    """The scan that SCAN, --at, --index, --scan-topic and --mount name."""
    name = source.scan
    if name != "-" and not Path(name).exists():
        raise UsageError(f"{name}: no such file; name a LaserScan as YAML or JSON, a log, or - for stdin")
    if name != "-" and is_log(Path(name)):
        recording, parts = open_for_scan(source, chosen)
        scan = scan_of_log(recording, parts, source.at, source.index)
        return MountedScan(scan, mount_in_log(recording, parts, scan, mounts), parts.base_frame)
    for_logs = {
        "--at": source.at,
        "--index": source.index,
        "--scan-topic": source.scan_topic,
        "--robot": source.robot,
    }
    for option, value in for_logs.items():
        if value is not None:
            raise UsageError(f"{option}: {name} is one scan, not a log; leave the option out")
    return _scan_of_text(name, mounts)


def open_for_scan(
    source: ScanSource, chosen: Chosen | None = None, odometry: str | None = None
) -> tuple[Recording, Roles]:
    """A log, and which of its topics holds the scans: the one named, else the one that ``mcl run`` would use."""
    from mclcli.io.logs import open_log
    from mclcli.io.recording.recording import Recording

    recording = Recording(open_log([Path(source.scan)]), watch=console.look)
    return recording, roles_for_scan(recording, source.scan_topic, source.robot, chosen, odometry)


def roles_for_scan(
    recording: Recording,
    topic: str | None,
    robot: str | None,
    chosen: Chosen | None = None,
    odometry: str | None = None,
) -> Roles:
    """Roles of a log's topics, where the topic of scans, the robot or the odometry may be named."""
    from mclcli.cli.chosen import names_in
    from mclcli.io.recording import roles

    overruled = {"map_topic", "scan_topic"} if topic else {"map_topic"}
    names = {} if chosen is None else names_in(recording.survey, chosen, overruled)
    scan = topic or names.get("scan_topic", "")
    requested = roles.RequestedRoles(
        scan=(scan,) if scan else (),
        odometry=odometry or names.get("odom_topic", ""),
        base_frame=names.get("base_frame_id", ""),
        odom_frame=names.get("odom_frame_id", ""),
        robot=robot or "",
    )
    return roles.assign(recording.survey, requested)


def scan_of_log(recording: Recording, parts: Roles, at: LogTime | None, index: int | None) -> LaserScan:
    """One scan of a log, by time or number; the first one if neither is given.

    Raises
    ------
    InputError
        If the log has no laser scan.
    UsageError
        If there is no scan of that time or number.

    """
    from mclcli.io.recording.unusable import no_scan, problem

    if not parts.scan:
        name = ", ".join(recording.log.names)
        raise InputError(f"{name}: {no_scan(recording.survey)}")
    topic = parts.scan[0]
    if why := problem(recording.survey, recording.survey.topics[topic]):
        raise InputError(f"topic '{topic}' cannot be used: {why}")
    scans = (record for _, record in recording.events([topic]) if isinstance(record, LaserScan))
    return pick_one(scans, lambda scan: scan.stamp_ns, recording.first_ns, at, index)


def pick_one(
    messages: Iterable[Message],
    stamp_of: Callable[[Message], int],
    first_ns: int,
    at: LogTime | None,
    index: int | None,
) -> Message:
    """The message nearest to a time, or of a number; the first one if neither is given.

    Raises
    ------
    UsageError
        If there is no message of that number, or none within two of the topic's periods of that time.

    """
    if at is not None and index is not None:
        raise UsageError("--at and --index name one message each; give one of them")
    if at is None:
        chosen = next(itertools.islice(messages, index or 0, None), None)
    else:
        chosen = _nearest(messages, stamp_of, first_ns, at)
    if chosen is None:
        raise UsageError(f"the topic has no message {'' if index is None else f'of number {index} '}that can be read")
    return chosen


def _nearest(
    messages: Iterable[Message], stamp_of: Callable[[Message], int], first_ns: int, at: LogTime
) -> Message | None:
    """The message nearest to a time; an error that names the times there are where it is too far away."""
    wanted_ns, stamps, chosen, best_ns = at.stamp_ns(first_ns), array("q"), None, 0
    for message in messages:
        away_ns = abs(stamp_of(message) - wanted_ns)
        stamps.append(stamp_of(message))
        if chosen is None or away_ns < best_ns:
            chosen, best_ns = message, away_ns
    known = np.unique(np.array(stamps, dtype=np.int64))
    period_ns = float(np.median(np.diff(known))) if known.size > 1 else 0.0
    if chosen is None or best_ns <= max(_NEAR_NS, 2.0 * period_ns):
        return chosen
    first, last = ((int(stamp) - first_ns) * 1e-9 for stamp in (known[0], known[-1]))
    said = f"{at.option} {at.text}: no message within two periods ({2e-9 * period_ns:.2g} s) of that;"
    if known.size == 1:
        raise UsageError(f"{at.option} {at.text}: the topic has one message, at {first:.3f} s; leave {at.option} out")
    if not known[0] < wanted_ns < known[-1]:
        raise UsageError(f"{said} the topic's messages go from {first:.3f} to {last:.3f} s into the log")
    after = int(np.searchsorted(known, wanted_ns))
    before_s, after_s = ((int(known[i]) - first_ns) * 1e-9 for i in (after - 1, after))
    raise UsageError(f"{said} the topic has a gap there, from {before_s:.3f} to {after_s:.3f} s into the log")


def _scan_of_text(source: str, mounts: Mapping[str, FloatArray]) -> MountedScan:
    from mclcli.io.tables.scan_file import LIMITS, parse_scan, read_scan
    from mclcli.io.tables.text_file import read_stdin

    if source == "-":
        source = "standard input"
        scan, mount, base_frame = parse_scan(read_stdin(LIMITS.size), source)
    else:
        scan, mount, base_frame = read_scan(Path(source))
    given = mounts.get(scan.frame_id, mounts.get(""))
    others = sorted(set(mounts) - {_CAMERA})
    if given is not None:
        mount = given
    elif others:
        raise UsageError(f"--mount {others[0]}: the scan is in frame '{scan.frame_id}'; name that one, or none")
    elif mount is None:
        console.remark(
            f"{source}: nothing says where the lidar sits; taken at the base (--mount X,Y,YAW says otherwise)"
        )
        mount = np.eye(4)
    return MountedScan(scan, mount, base_frame or "")


def mount_in_log(recording: Recording, parts: Roles, scan: LaserScan, mounts: Mapping[str, FloatArray]) -> FloatArray:
    """``base_from_sensor`` (4, 4): the mount given, else the log's.

    Raises
    ------
    UsageError
        If the log knows nothing of a frame that a mount is given for.
    InputError
        If neither says where the lidar sits.

    """
    from mclcli.replay.setup import check_mounts

    check_mounts(recording.survey, mounts)
    given = mounts.get(scan.frame_id, mounts.get(""))
    if given is not None:
        return given
    mount = recording.mount_at(parts, scan.frame_id, scan.stamp_ns)
    if mount is None:
        from mclcli.io.recording.unusable import because

        tree = parts.frames
        when = " at its stamp" if tree.connected(parts.base_frame, scan.frame_id) else ""
        raise InputError(
            f"no transform from '{parts.base_frame}' to '{scan.frame_id}'{when}; frames in the log: "
            f"{', '.join(tree.frames) or 'none'}; give --mount {scan.frame_id}=X,Y,YAW"
            f"{because(recording.survey, 'transforms')}"
        )
    return mount


def is_log(path: Path) -> bool:
    """Whether a path is a folder or begins like a log; anything else is read as text."""
    from mclcli.io.logs import sniff

    if path.is_dir():
        return True
    with path.open("rb") as file:
        head = file.read(sniff.HEAD)
    try:
        sniff.kind_of(head, path.name)
    except InputError:
        return False
    return True
