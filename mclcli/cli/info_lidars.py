"""What ``mcl info`` says of a lidar, from its first scan: its geometry, where it sits, and what contradicts itself."""

from __future__ import annotations

from math import degrees
from typing import TYPE_CHECKING, Any

from mclcli.text import clean, counted

if TYPE_CHECKING:
    from collections.abc import Iterator

    from mclcli.io.recording.recording import Recording
    from mclcli.io.recording.roles import Roles
    from mclcli.io.recording.sampling import SampledLog
    from mclcli.records import LaserScan


def facts_of(recording: Recording | SampledLog, parts: Roles, name: str) -> dict[str, Any]:
    """Geometry of a lidar from its first scan, and where it sits."""
    import numpy as np

    from mclcli.geometry import se3
    from mclcli.records import LaserScan

    scan = recording.survey.topics[name].sample
    assert isinstance(scan, LaserScan)  # noqa: S101 - roles go by type
    mount = parts.frames.nominal(parts.base_frame, scan.frame_id)
    finite = np.isfinite(scan.ranges)
    return {
        "topic": name,
        "frame": scan.frame_id,
        "beams": int(scan.ranges.size),
        "angle_min": _single(scan.angle_min),
        "angle_increment": _single(scan.angle_increment),
        "range_min": _single(scan.range_min),
        "range_max": _single(scan.range_max),
        "time_increment": _single(scan.time_increment),
        "no_return": int(np.isinf(scan.ranges).sum()),
        "invalid": int((~finite & ~np.isinf(scan.ranges)).sum()),
        "base_from_sensor": None if mount is None else list(se3.to_rpy(mount)),
        "mount_moves_by": recording.survey.swing(parts.frames, parts.base_frame, scan.frame_id),
        "odd": list(_oddities(scan)),
    }


def line_of(lidar: dict[str, Any]) -> str:
    """The same for people."""
    mount = lidar["base_from_sensor"]
    where = "nothing says where it sits on the base (--mount)"
    if mount is not None:
        x, y, z, roll, pitch, yaw = mount
        turns = (f"{name} {_fixed(degrees(a), 1)}" for name, a in (("roll", roll), ("pitch", pitch), ("yaw", yaw)))
        angles = f"{', '.join(turns)} deg"
        where = f"at x {_fixed(x, 3)}, y {_fixed(y, 3)}, z {_fixed(z, 3)} m, {angles}"
    if lidar["mount_moves_by"] is not None:
        metres, radians = lidar["mount_moves_by"]
        where += (
            f" at first; it moves on the base, by up to {_fixed(metres, 3)} m and {_fixed(degrees(radians), 1)} deg"
        )
    near, far = (_range(lidar[name]) for name in ("range_min", "range_max"))
    name, frame, beams = clean(lidar["topic"]), clean(lidar["frame"]), counted(lidar["beams"], "beam")
    return f"lidar {name} in frame {frame}: {beams} {_directions(lidar)}, ranges from {near} to {far}; {where}"


def _directions(lidar: dict[str, Any]) -> str:
    first, step = lidar["angle_min"], lidar["angle_increment"]
    if first is None or step is None:
        return "of no direction"
    last = first + step * max(lidar["beams"] - 1, 0)
    return f"from {_fixed(degrees(first), 1)} to {_fixed(degrees(last), 1)} deg"


def _oddities(scan: LaserScan) -> Iterator[str]:
    """What contradicts itself in a scan."""
    import numpy as np

    first, last, step, count = scan.angle_min, scan.angle_max, scan.angle_increment, scan.ranges.size
    told = f"angle_min {first:.6g}, angle_max {last:.6g}, angle_increment {step:.6g}"
    if not np.isfinite([first, step]).all():
        yield f"{told}: not finite, so no beam has a direction"
    elif count > 1 and not step:
        yield f"{told}: all beams point the same way"
    elif count > 1 and (last - first) * step < 0:
        yield f"{told}: the increment goes against the sense from angle_min to angle_max; the increment counts"
    elif count > 1 and not abs(last - first - (count - 1) * step) <= 1.01 * abs(step):
        yield f"{told}: they do not fit {count} readings; the readings count"
    if not scan.range_max > scan.range_min:
        yield f"range_min {scan.range_min:g} is not below range_max {scan.range_max:g}: no reading counts"
    elif not ((scan.ranges >= scan.range_min) & (scan.ranges <= scan.range_max)).any():
        yield "no reading of its first scan is a return, between range_min and range_max"


def _range(metres: float | None) -> str:
    return "no limit" if metres is None else f"{metres:g} m"


def _single(number: float) -> float | None:
    """A number that came as float32 with the digits that one holds; None if it is not finite."""
    import numpy as np

    short = float(str(np.float32(number)))
    return (short if np.float32(short) == number else number) if np.isfinite(number) else None


def _fixed(number: float, digits: int) -> str:
    """Digits behind the point, and no minus before a zero."""
    return f"{round(number, digits) + 0.0:.{digits}f}"
