"""Several logs on one command line: those that do not follow one another are segments, and that is said."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from tests.battery import content
from tests.battery.bases import mcap_log
from tests.cli.support import mcl
from tests.io.ros_messages import STORES

if TYPE_CHECKING:
    from pathlib import Path

STORE = STORES["cdr"]
HALF = content.START_NS + 6 * 10**9
DAY = 86_400


def moved(messages: tuple[content.Known, ...], seconds: int) -> tuple[content.Known, ...]:
    """The same log at another time, stamps as well."""
    found = []
    for known in messages:
        message: Any = STORE.deserialize_cdr(known.data, content.TYPES[known.topic])
        for part in getattr(message, "transforms", [message]):
            if hasattr(part, "header"):
                part.header.stamp.sec += seconds
        data = bytes(STORE.serialize_cdr(message, content.TYPES[known.topic]))
        found.append(known._replace(log_ns=known.log_ns + seconds * 10**9, data=data))
    return tuple(found)


def two_logs(folder: Path, later: int) -> tuple[Path, Path]:
    """The two halves of the base log, the second ``later`` seconds later than it was."""
    (folder / "room.pgm").write_bytes(content.room())
    (folder / "room.yaml").write_text(content.MAP_YAML)
    whole = content.messages("cdr")
    halves = [m for m in whole if m.log_ns < HALF], [m for m in whole if m.log_ns >= HALF]
    (folder / "a.mcap").write_bytes(mcap_log("cdr", tuple(halves[0])))
    (folder / "b.mcap").write_bytes(mcap_log("cdr", moved(tuple(halves[1]), later)))
    return folder / "a.mcap", folder / "b.mcap"


def run(folder: Path, *logs: Path) -> Any:
    words = ("--map", folder / "room.yaml", "--init", content.INIT, "--particles", 100, "--track", "-")
    return mcl("run", *logs, *words)


@pytest.mark.parametrize("order", [1, -1])
def test_parts_of_one_recording_are_one_drive(tmp_path: Path, order: int) -> None:
    result = run(tmp_path, *two_logs(tmp_path, 0)[::order])
    assert set(result.table["segment"]) == {0.0}
    assert "segment" not in result.err
    assert json.loads(mcl("info", *two_logs(tmp_path, 0), "--json").out)["problems"] == []


@pytest.mark.parametrize("order", [1, -1])
@pytest.mark.parametrize("later", [2 * 3600, 30 * DAY, 10 * 366 * DAY])
def test_logs_that_are_apart_are_segments(tmp_path: Path, later: int, order: int) -> None:
    """Though odometry goes on as if nothing had been."""
    logs = two_logs(tmp_path, later)[::order]
    result = run(tmp_path, *logs)
    table = result.table
    assert set(table["segment"]) == {0.0, 1.0}
    assert np.ptp(table["stamp"][table["segment"] == 1.0]) < 7.0
    assert "mcl: warning: b.mcap begins " in result.err
    assert "updates over 11." in result.err
    (problem,) = [p for p in json.loads(mcl("info", *logs, "--json").out)["problems"] if "segment" in p]
    assert problem.startswith("b.mcap begins ")


def test_drives_at_the_same_time_are_not_mixed(tmp_path: Path) -> None:
    """As two simulations are that both begin at 0, or two robots that name their topics alike."""
    logs = two_logs(tmp_path, -6)
    result = run(tmp_path, *logs)
    assert set(result.table["segment"]) == {0.0, 1.0}
    assert "a.mcap and b.mcap hold /odom, /scan at the same time: a segment of its own" in result.err
    segment = result.table["segment"]
    assert min((segment == 0.0).sum(), (segment == 1.0).sum()) >= 29  # each with its own scans
    stamps = result.table["stamp"]
    assert np.all(np.diff(stamps[segment == 0.0]) > 0.0)
    assert np.all(np.diff(stamps[segment == 1.0]) > 0.0)
