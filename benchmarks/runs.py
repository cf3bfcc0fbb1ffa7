"""Rows of the table about whole processes: start-up, memory, and what one more scan costs a run."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING

from benchmarks import drive
from benchmarks.measure import alternate, peak_memory, process

if TYPE_CHECKING:
    from benchmarks.measure import Row

MCL = str(Path(sys.executable).parent / "mcl")
FILTER = ("--particles", "2000", "--set", "max_beams=60", "--set", "update_min_d=0", "--set", "update_min_a=0")
WORDS = ("--map", str(drive.MAP), f"--init={drive.START}", *FILTER)


def start_up() -> list[Row]:
    """``mcl --help`` against importing click, a score of 1,000 poses against importing NumPy."""
    short = alternate(process(MCL, "--help"), process(sys.executable, "-c", "import click"), 15)
    with tempfile.TemporaryDirectory() as folder:
        scan = Path(folder) / "scan.yaml"
        scan.write_text(_scan_text(360), encoding="utf-8")
        words = (MCL, "score", str(scan), "--map", str(drive.MAP), "--around=-7,1.2,1.57", "--spread", "0.3,0.1")
        score = process(*words, "-n", "1000", "--mount", "0,0,0", "-o", "/dev/null")
        long = alternate(score, process(sys.executable, "-c", "import numpy"), 15)
    return [
        ("`mcl --help`", f"{short.a * 1e3:.0f} ms", "≤ 1.5 ×", f"{short.ratio:.2f} × importing click"),
        (
            "`mcl score`, 1,000 × 360, field cached",
            f"{long.a * 1e3:.0f} ms",
            "≤ 3 ×",
            f"{long.ratio:.2f} × importing NumPy",
        ),
    ]


def _scan_text(count: int) -> str:
    ranges = ", ".join(f"{1.0 + 0.01 * (k % 300):.2f}" for k in range(count))
    head = "header: {stamp: {sec: 1, nanosec: 0}, frame_id: laser}\n"
    angles = f"angle_min: -3.14\nangle_max: 3.14\nangle_increment: {6.28 / (count - 1):.9f}\n"
    times = "time_increment: 0.0\nscan_time: 0.0\nrange_min: 0.1\nrange_max: 12.0\n"
    return f"{head}{angles}{times}ranges: [{ranges}]\nintensities: []\n"


def memory() -> Row:
    """Peak memory of a million poses against 1,000 beams."""
    code = "from benchmarks.scoring import *\njob = concentrated(1_000_000, 1000)\njob.score()()\n"
    return (
        "memory, 1,000,000 × 1,000",
        f"{peak_memory(code):.0f} MiB",
        "≤ 400 MB",
        f"{peak_memory('import numpy'):.0f} MiB for importing NumPy",
    )


def scans() -> list[Row]:
    """What one more scan costs: processor time of long runs less that of short ones, over the scans between."""
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        logs = {}
        for count in (1000, 3000):
            logs[count] = Path(folder) / f"{count}.mcap"
            with logs[count].open("wb") as file:
                drive.write(file, count)
        for what, target, output in (
            ("`mcl run`, a scan, track as CSV", "≤ 0.8 ms, aim 0.4", ("--track", f"{folder}/track.csv")),
            ("… with the weight trace as MCAP", "≤ 2 ms", ("-o", f"{folder}/trace.mcap")),
            ("… with the weight trace as CSV", "", ("-o", f"{folder}/trace.csv")),
        ):
            least = {
                n: min(process(MCL, "run", "-q", str(log), *WORDS, *output)() for _ in range(4))
                for n, log in logs.items()
            }
            each = (least[3000] - least[1000]) / 2000
            kept = Path(output[1]).stat().st_size / (3000 * 2000)
            against = f"{kept:.0f} bytes a particle on disk" if output[0] == "-o" else "user and system time"
            rows.append((what, f"{each * 1e3:.2f} ms", target, against))
    return rows


def stream(gigabytes: float) -> Row:
    """Peak memory of a run over a log of so many gigabytes that never touches the disk."""
    scans_of_a_gigabyte = 385_000
    count = int(gigabytes * scans_of_a_gigabyte)
    make = subprocess.Popen([sys.executable, "-m", "benchmarks.drive", str(count)], stdout=subprocess.PIPE)
    sparse = ("--set", "update_min_d=10", "--set", "update_min_a=10")
    began = time.perf_counter()
    run = subprocess.Popen([MCL, "run", "-q", "-", *WORDS, *sparse, "--track", "/dev/null"], stdin=make.stdout)
    _, status, used = os.wait4(run.pid, 0)  # the run's own memory, not that of the process that makes the log
    codes = os.waitstatus_to_exitcode(status), make.wait()
    if any(codes):
        raise RuntimeError(f"exit codes {codes} of the run and of what makes the log")
    peak = used.ru_maxrss / 2**10
    seconds = time.perf_counter() - began
    return (
        f"memory, {gigabytes:g} GB log through a pipe",
        f"{peak:.0f} MiB",
        "bounded",
        f"{seconds:.0f} s, {count:,} scans",
    )
