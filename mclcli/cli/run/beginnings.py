"""Where a run began that had to search for the robot, and how sure that is."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from mclcli.cli import console

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray
    from mclcli.filter.start import Placed
    from mclcli.io.recording.recording import Recording
    from mclcli.replay.tally import ReplayTally

_SURE = 0.8  # probability below which a start is a warning
_RIVALS = 2  # other places that a warning names


def tell(recording: Recording, tally: ReplayTally, told: int) -> int:
    """Say where each start is that was found since ``told`` of them were, with a warning where it is in doubt."""
    for stamp_ns, placed in tally.found[told:]:
        console.remark(line(recording, stamp_ns, placed))
        doubt = doubt_of(placed)
        if doubt:
            console.warn(f"start: {doubt}; if it is wrong, give --init X,Y,YAW, or another map")
    return len(tally.found)


def repeated(recording: Recording, tally: ReplayTally) -> list[str]:
    """The same in lines of a summary."""
    lines = []
    for number, (stamp_ns, placed) in enumerate(tally.found):
        doubt = doubt_of(placed)
        lines.append(line(recording, stamp_ns, placed) + f"; {doubt}" * bool(doubt))
        if number in tally.undecided:
            last_ns, modes = tally.undecided[number]
            seconds = (last_ns - recording.first_ns) * 1e-9
            lines.append(f"  {modes} places kept alive up to {seconds:.1f} s of the log; column modes of --steps")
    return lines


def undecided(tally: ReplayTally, last_ns: int) -> list[str]:
    """A doubt where several places were still possible at the last update."""
    stamp_ns, modes = tally.undecided.get(len(tally.found) - 1, (None, 0))
    if stamp_ns != last_ns:
        return []
    return [f"{modes} places were still possible at the last update; the pose stated is at the most probable of them"]


def line(recording: Recording, stamp_ns: int, placed: Placed) -> str:
    """The most probable place, as --init takes it, with its probability."""
    seconds = f"at {(stamp_ns - recording.first_ns) * 1e-9:.1f} s of the log"
    if not placed.probabilities.size:
        return f"start: anywhere on the map {seconds}, probability of any one place 0.00"
    return f"start: {pose_text(placed.places[0])}, probability {placed.probabilities[0]:.2f} {seconds}"


def doubt_of(placed: Placed) -> str:
    """Why a start is not to be relied on, empty if it is."""
    if not placed.probabilities.size:
        return "the readings say nothing of where the robot is"
    best = float(placed.probabilities[0])
    if placed.elsewhere > best:
        return f"not on this map, with probability {placed.elsewhere:.2f}"
    if best >= _SURE:
        return ""
    others = zip(placed.places[1 : 1 + _RIVALS], placed.probabilities[1 : 1 + _RIVALS], strict=True)
    rivals = [f"{pose_text(pose)} ({share:.2f})" for pose, share in others if share >= 0.005]
    rivals += [f"not on this map ({placed.elsewhere:.2f})"] * (placed.elsewhere >= 0.005)
    return f"ambiguous, probability {best:.2f}; or {', '.join(rivals) or 'elsewhere'}"


def pose_text(pose: FloatArray) -> str:
    """A pose as --init takes it, to a centimetre and a tenth of a degree; never -0."""
    x, y, yaw = (float(value) for value in pose)
    turned = np.degrees(math.remainder(yaw, 2.0 * math.pi))
    x, y, degrees = round(x, 2) + 0.0, round(y, 2) + 0.0, round(float(turned), 1) + 0.0
    return f"{x:.2f},{y:.2f},{degrees:.1f}deg"
