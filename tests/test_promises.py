"""Promises that concern all of mcl and have no better home; docs/reliability.md says where the others are tested."""

from __future__ import annotations

import ast
import os
import re
import subprocess
import sys
import threading
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, cast

import numpy as np
import pytest
import zstandard

from tests.battery import content, records
from tests.battery.bases import base_logs, mcap_log
from tests.battery.drives import STORE
from tests.cli.support import ENTRY, ROOT, Table, mcl, single_error

if TYPE_CHECKING:
    from tests.cli.support import Result

SECOND = 10**9
NETWORK = {
    "socket",
    "ssl",
    "http",
    "urllib",
    "ftplib",
    "smtplib",
    "requests",
    "asyncio",
    "subprocess",
    "pty",
    "webbrowser",
}


def prepared(folder: Path, known: tuple[content.Known, ...], origin: str = "[-5.0, -4.0, 0]") -> tuple[object, ...]:
    """Arguments that run over these messages in the room."""
    (folder / "x.mcap").write_bytes(mcap_log("cdr", known))
    (folder / "room.pgm").write_bytes(content.room())
    (folder / "room.yaml").write_text(content.MAP_YAML.replace("[-5.0, -4.0, 0]", origin))
    return "run", folder / "x.mcap", "--map", folder / "room.yaml"


def track_of(result: Result) -> Table:
    assert result.code == 0, result.err
    return result.table


def test_nothing_of_mcl_knows_a_network_or_starts_a_process() -> None:
    for path in (ROOT / "mclcli").rglob("*.py"):
        tree = ast.parse(path.read_text())
        names = {alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names}
        names |= {node.module or "" for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
        calls = {ast.unparse(node.func) for node in ast.walk(tree) if isinstance(node, ast.Call)}
        assert not {name.partition(".")[0] for name in names} & NETWORK, path
        assert not {call for call in calls if call.startswith(("os.system", "os.popen", "os.exec", "os.spawn"))}, path


@pytest.mark.parametrize("particles", [1, 1_000_000])
def test_one_particle_and_a_million(tmp_path: Path, particles: int) -> None:
    first = tuple(known for known in content.messages("cdr") if known.log_ns < content.START_NS + 0.45 * SECOND)
    words = prepared(tmp_path, first)
    track = track_of(
        mcl(*words, "--init", content.INIT, "--particles", particles, "--steps", tmp_path / "s.csv", "--track", "-")
    )
    assert set(Table((tmp_path / "s.csv").read_text())["n"]) == {particles}
    assert np.hypot(track["x"][0] - 1.5, track["y"][0]) < 1.5
    assert np.isfinite([track[name] for name in track.names if name.startswith("cov")]).all()


def test_origins_far_from_zero_lose_nothing(tmp_path: Path) -> None:
    words = prepared(tmp_path, content.messages("cdr"))
    near = track_of(mcl(*words, "--init", "1.5,0,90deg,0.1,2deg", "--track", "-"))
    far = track_of(
        mcl(
            *prepared(tmp_path, content.messages("cdr"), "[499995.0, 4999996.0, 0]"),
            "--init",
            "500001.5,5000000,90deg,0.1,2deg",
            "--track",
            "-",
        )
    )
    assert np.abs(far["x"] - 5e5 - near["x"]).max() < 1e-6
    assert np.abs(far["y"] - 5e6 - near["y"]).max() < 1e-6
    assert np.abs(far["yaw"] - near["yaw"]).max() < 1e-6


@pytest.mark.parametrize("name", ["zstd.mcap", "plain.bag", "rosbag2.db3"])
def test_strict_stops_at_the_first_damage_and_writes_nothing(tmp_path: Path, name: str) -> None:
    (base,) = (base for base in base_logs() if base.name == name)
    prepared(tmp_path, ())
    (tmp_path / name).write_bytes(base.data[: len(base.data) // 2])
    before = sorted(tmp_path.iterdir())
    words = ("--init", content.INIT, "-o", tmp_path / "t.csv", "-o", tmp_path / "t.mcap", "--track", tmp_path / "p.tum")
    result = mcl("run", tmp_path / name, "--map", tmp_path / "room.yaml", *words, "--strict")
    assert "leave --strict out to use the rest" in single_error(result, 1)
    assert sorted(tmp_path.iterdir()) == before
    assert mcl("run", tmp_path / name, "--map", tmp_path / "room.yaml", *words).code == 3


def test_time_that_jumps_back_begins_a_new_segment(tmp_path: Path) -> None:
    """After 6 s all clocks are 5 s earlier, and so they stay: recorded times, stamps of scans, odometry and tf."""

    def later(known: content.Known) -> content.Known:
        if known.log_ns < content.START_NS + 6 * SECOND:
            return known
        kind = content.TYPES[known.topic]
        message: Any = STORE.deserialize_cdr(known.data, kind)
        for item in getattr(message, "transforms", [message]):
            if hasattr(item, "header"):
                item.header.stamp.sec -= 5
        return content.Known(known.topic, known.log_ns - 5 * SECOND, bytes(STORE.serialize_cdr(message, kind)))

    words = prepared(tmp_path, tuple(map(later, content.messages("cdr"))))
    result = mcl(*words, "--init", content.INIT, "--track", "-")
    track = track_of(result)
    assert "jump" in result.err
    assert set(track["segment"]) == {0.0, 1.0}
    assert len(track.rows) > 50


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="needs /proc")
def test_a_stream_takes_bounded_memory() -> None:
    """Of 400 MB on stdin, no more than is held back for reordering stays in memory."""
    own = records.schema(9, "std_msgs/msg/String", "ros2msg", "string data") + records.channel(9, 9, "/own")
    noise = os.urandom(500) * 200

    def chunk(number: int) -> bytes:
        plain = own + b"".join(records.message(9, content.START_NS + number, noise) for _ in range(20))
        return records.chunk(plain, "zstd", zstandard.compress(plain))

    told = "import atexit; atexit.register(lambda: print(open('/proc/self/status').read())); "
    words = [sys.executable, "-c", told + ENTRY, "info", "-"]
    started = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, cwd=ROOT)

    def feed(stream: IO[bytes]) -> None:
        stream.write(records.mcap(end=False))
        for number in range(200):
            stream.write(chunk(number))
        stream.write(records.mcap()[len(records.mcap(end=False)) :])
        stream.close()

    feeder = threading.Thread(target=feed, args=(cast("IO[bytes]", started.stdin),))
    feeder.start()
    text = cast("IO[bytes]", started.stdout).read().decode()
    feeder.join()
    cast("IO[bytes]", started.stdout).close()
    assert started.wait() == 0
    assert "4000 messages on 1 topic," in text
    most = re.search(r"VmHWM:\s+(\d+) kB", text)
    assert most is not None
    assert int(most[1]) < 250 * 1024, f"{int(most[1]) / 1024:.0f} MiB"
