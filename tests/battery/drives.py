"""Odd scans, odometry and frames: what must become of a run over the drive."""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from mclcli.io.tables.tum import read_tum
from tests.battery import content
from tests.battery.bases import mcap_log
from tests.battery.harness import CRASH, LOSS, WRONG, Case, Verdict
from tests.battery.outcome import unclean
from tests.cli.support import mcl
from tests.io.ros_messages import STORES

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    Edit = Callable[[Any, int], object]

STORE = STORES["cdr"]
NAN, INF = math.nan, math.inf
SCANS = 60


class Drive(NamedTuple):
    """An edit of the messages of one topic, and what a run over them must give.

    ``edit`` gets a decoded message and its number on its topic; False drops it. ``poses`` are those that the track must
    have at least, each within ``error`` metres of the truth; ``says`` stands in what the user is told.
    """

    name: str
    topic: str
    edit: Edit
    poses: int = SCANS - 2
    codes: tuple[int, ...] = (0,)
    says: str = ""
    error: float = 0.25


def cases(seed: int, share: float) -> list[Case]:
    """All of them, or a share evenly spread."""
    del seed
    return [Case(drive.name, partial(check, drive)) for drive in DRIVES][:: max(1, round(1 / share))]


def check(drive: Drive, folder: Path) -> Verdict:
    """Edit the drive, run over it, compare."""
    (folder / "x.mcap").write_bytes(mcap_log("cdr", edited(drive)))
    (folder / "room.pgm").write_bytes(content.room())
    (folder / "room.yaml").write_text(content.MAP_YAML)
    words = ("--map", folder / "room.yaml", "--init", content.INIT, "--track", folder / "t.tum", "--particles", 200)
    result = mcl("run", folder / "x.mcap", *words, "-o", folder / "trace.csv", "-o", folder / "trace.mcap")
    problems = unclean(result) + unclean(mcl("info", folder / "x.mcap"))
    if result.code not in drive.codes:
        problems.append((CRASH if result.code == 70 else WRONG, f"ended with {result.code}: {result.err[-400:]}"))
    if drive.says not in result.err:
        problems.append((WRONG, f"{drive.says!r} is not in {result.err[-600:]!r}"))
    if result.code in {0, 3}:
        problems += _compared(drive, folder)
    return Verdict(problems, {"runs": 1})


def edited(drive: Drive) -> tuple[content.Known, ...]:
    """Messages after the edit, in order of log time."""
    kind, number, found = content.TYPES[drive.topic], -1, []
    for known in content.messages("cdr"):
        if known.topic != drive.topic:
            found.append(known)
            continue
        number += 1
        message: Any = STORE.deserialize_cdr(known.data, kind)
        if drive.edit(message, number) is not False:
            found.append(known._replace(data=bytes(STORE.serialize_cdr(message, kind))))
    return tuple(found)


def _compared(drive: Drive, folder: Path) -> list[tuple[str, str]]:
    track = read_tum(folder / "t.tum")
    problems: list[tuple[str, str]] = []
    if len(track.stamps_ns) < drive.poses:
        problems.append((LOSS, f"{len(track.stamps_ns)} poses instead of {drive.poses}"))
    truth = np.array([content.pose_at((int(stamp) - content.START_NS) / 1e9)[:2] for stamp in track.stamps_ns])
    error = float(np.hypot(*(track.poses[:, :2] - truth).T).max())
    if not error <= drive.error:
        problems.append((WRONG, f"{error:.2f} m from the truth"))
    if b"nan" in (folder / "trace.csv").read_bytes():
        problems.append((WRONG, "the trace holds a number that is none"))
    return problems


def fields(**values: Any) -> Edit:
    """Edit that sets fields, ``a__b`` for a field within a field."""

    def edit(message: Any, number: int) -> None:
        del number
        for path, value in values.items():
            owner, names = message, path.split("__")
            for name in names[:-1]:
                owner = owner[int(name)] if name.isdecimal() else getattr(owner, name)
            setattr(owner, names[-1], value)

    return edit


def _only(which: Callable[[int], bool], edit: Edit) -> Edit:
    """The edit, of some messages."""
    return lambda message, number: edit(message, number) if which(number) else None


def _ranges(change: Callable[[Any], Any]) -> Edit:
    """Other ranges."""

    def edit(message: Any, number: int) -> None:
        del number
        message.ranges = np.asarray(change(message.ranges.copy()), np.float32)

    return edit


def _all(value: float) -> Callable[[Any], Any]:
    return lambda ranges: np.full_like(ranges, value)


def _every_third(value: float) -> Edit:
    def change(ranges: Any) -> Any:
        ranges[::3] = value
        return ranges

    return _ranges(change)


def _turned(message: Any, number: int) -> None:
    """The same scan, told clockwise."""
    del number
    message.ranges = message.ranges[::-1].copy()
    message.angle_min, message.angle_max = message.angle_max, message.angle_min
    message.angle_increment = -message.angle_increment


def _later(seconds: int, after: int = 0) -> Edit:
    """Stamps moved, from message number ``after`` on."""

    def edit(message: Any, number: int) -> None:
        if number >= after:
            message.header.stamp.sec += seconds

    return edit


def _twist(x: float, y: float, z: float, w: float, norm: float = 1.0) -> Edit:
    def edit(message: Any, number: int) -> None:
        del number
        rotation = message.transforms[0].transform.rotation
        rotation.x, rotation.y, rotation.z, rotation.w = (norm * part for part in (x, y, z, w))

    return edit


def _stretched(norm: float) -> Edit:
    def edit(message: Any, number: int) -> None:
        del number
        turn = message.pose.pose.orientation
        turn.z, turn.w = turn.z * norm, turn.w * norm

    return edit


def _middle(number: int) -> bool:
    return 20 <= number < 25


def _one(number: int) -> bool:
    return number == 30


ZERO = {"header__stamp__sec": 0, "header__stamp__nanosec": 0}
POSE = "pose__pose__position__x"
PLACE = "transforms__0__transform__translation__x"
DRIVES = [
    Drive("as it is", "/scan", fields()),
    *(
        Drive(f"every third beam {value}", "/scan", _every_third(value))
        for value in (NAN, INF, -INF, 0.0, -1.0, 12.0, 99.0, 1e38)
    ),
    *(
        Drive(f"five scans of {value} alone", "/scan", _only(_middle, _ranges(_all(value))))
        for value in (NAN, INF, 0.0)
    ),
    Drive("all scans of NaN", "/scan", _ranges(_all(NAN)), error=0.5),
    *(
        Drive(f"range_max {value}", "/scan", fields(range_max=value), 0, (1,), "range_max")
        for value in (NAN, 0.0, -1.0)
    ),
    *(
        Drive(
            f"five times range_max {value}",
            "/scan",
            _only(_middle, fields(range_max=value)),
            SCANS - 7,
            says="5 skipped",
        )
        for value in (NAN, 0.0)
    ),
    Drive("range_max without end", "/scan", fields(range_max=INF), 0, (1, 2)),
    Drive(
        "range_max of 3e38, ranges of 1e38",
        "/scan",
        lambda m, n: (fields(range_max=3e38)(m, n), _every_third(1e38)(m, n))[0],
    ),
    *(Drive(f"range_min {value}", "/scan", fields(range_min=value), 0, (0, 1)) for value in (NAN, -INF, -5.0)),
    Drive("range_min above range_max", "/scan", fields(range_min=50.0), 0, (0, 1), error=0.5),
    Drive("increment 0", "/scan", fields(angle_increment=0.0), 0, (1,), "increment"),
    Drive("five times increment 0", "/scan", _only(_middle, fields(angle_increment=0.0)), SCANS - 7, says="5 skipped"),
    Drive("increment NaN", "/scan", fields(angle_increment=NAN), 0, (1,)),
    Drive("increment below zero", "/scan", _turned),
    *(
        Drive(f"angle_min {value}", "/scan", _only(_middle, fields(angle_min=value)), SCANS - 7)
        for value in (NAN, INF, 1e30)
    ),
    Drive("angle_max off by one", "/scan", lambda m, n: fields(angle_max=m.angle_max + m.angle_increment)(m, n)),
    Drive(
        "angle_max off by ten",
        "/scan",
        lambda m, n: fields(angle_max=m.angle_max + 10 * m.angle_increment)(m, n),
        says="angle_max",
    ),
    Drive("angle_max NaN", "/scan", fields(angle_max=NAN)),
    Drive("no beams", "/scan", _only(_middle, _ranges(lambda _: [])), SCANS - 7),
    Drive("one beam", "/scan", _only(_middle, _ranges(lambda r: r[:1])), SCANS - 7),
    Drive("time_increment NaN", "/scan", fields(time_increment=NAN)),
    Drive("stamps of 0", "/scan", fields(**ZERO), says="stamp is 0"),
    Drive("one stamp of 0", "/scan", _only(_one, fields(**ZERO)), says="stamp is 0"),
    Drive(
        "equal stamps",
        "/scan",
        _only(_middle, lambda m, _: fields(header__stamp__sec=1_700_000_005, header__stamp__nanosec=0)(m, 0)),
        SCANS - 8,
    ),
    Drive("a year ahead", "/scan", _later(31_536_000), 0, (1,), "after the odometry's end"),
    Drive("one a year ahead", "/scan", _only(_one, _later(31_536_000)), SCANS - 3),
    Drive("one a year behind", "/scan", _only(_one, _later(-31_536_000)), SCANS - 3),
    Drive("one of a stamp below zero", "/scan", _only(_one, fields(header__stamp__sec=-5)), SCANS - 3),
    Drive("a frame with a slash", "/scan", fields(header__frame_id="/laser")),
    Drive("a frame nobody knows", "/scan", fields(header__frame_id="lidar"), 0, (1,), "--mount"),
    Drive("no frame", "/scan", fields(header__frame_id=""), 0, (1,), "--mount"),
    *(
        Drive(f"odometry at {value}", "/odom", _only(_one, fields(**{POSE: value})), codes=(3,), says="/odom")
        for value in (NAN, INF, 1e300, 1e10)
    ),
    Drive(
        "odometry far from zero", "/odom", lambda m, _: setattr(m.pose.pose.position, "x", m.pose.pose.position.x + 5e6)
    ),
    Drive("odometry without rotation", "/odom", _only(_one, _stretched(0.0)), codes=(3,), says="/odom"),
    Drive("quaternions of length 1.005", "/odom", _stretched(1.005)),
    Drive("quaternions of length 1.05", "/odom", _only(_one, _stretched(1.05)), codes=(3,), says="/odom"),
    Drive("covariances of NaN", "/odom", fields(pose__covariance=np.full(36, NAN))),
    Drive("odometry without child", "/odom", fields(child_frame_id="")),
    Drive("odometry with slashes", "/odom", fields(child_frame_id="/base_link", header__frame_id="/odom")),
    Drive("odometry with stamps of 0", "/odom", fields(**ZERO), says="stamp is 0"),
    Drive(
        "three seconds without odometry", "/odom", lambda _, n: not 40 <= n < 70, says="1 gap over 1 s, the longest 3."
    ),
    Drive("no odometry topic", "/odom", lambda *_: False),
    Drive("a mount without rotation", "/tf_static", _twist(0, 0, 0, 0), 0, (1, 3), "laser"),
    Drive("a mount at NaN", "/tf_static", fields(**{PLACE: NAN}), 0, (1, 3), "laser"),
    Drive("no mount", "/tf_static", lambda *_: False, 0, (1,), "--mount"),
    Drive(
        "a mount with slashes",
        "/tf_static",
        fields(transforms__0__child_frame_id="/laser", transforms__0__header__frame_id="/base_link"),
    ),
    Drive("a mount below the laser itself", "/tf_static", fields(transforms__0__header__frame_id="laser"), 0, (1,)),
    Drive("a mount upside down", "/tf_static", _twist(1, 0, 0, 0), 0, (0,), error=9.0),
    Drive("transforms of NaN", "/tf", _only(_one, fields(**{PLACE: NAN})), says="not rigid"),
]
