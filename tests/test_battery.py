"""A quick share of the battery, everything it ever found, and that it would notice what it looks for."""

from __future__ import annotations

import os
import signal
from collections import Counter
from functools import partial
from typing import TYPE_CHECKING

import pytest

from mclcli.io.logs.base import Tally
from tests import processes
from tests.battery import bases, damaged, harness, intact, outcome, writing
from tests.battery.__main__ import QUICK, main
from tests.battery.classes import CLASSES
from tests.battery.damages import COUNTS
from tests.battery.harness import ALTERATION, CRASH, HANG, LARGE, LOSS, WRONG, Case, Verdict
from tests.cli.support import Result

if TYPE_CHECKING:
    from pathlib import Path

FOUND = {
    "crafted logs": (
        "mcap: two files in one",
        "db3: definitions are an endless view",
        "db3: data are computed",
        "db3: 2^32 − 1 pages",
        "db3: one leaf again and again",
    ),
    "maps": (
        "damaged: PNG with rows missing",
        "yaml 14: {'origin': '[1e300, 0, 0]'}",
        "yaml 9: {'resolution': '1e30'}",
    ),
    "scans and frames": ("odometry at 1e+300", "odometry at 10000000000.0", "range_min nan", "angle_max off by ten"),
}
FOUND_IN_DAMAGE = ("ros1.mcap, dropped span 30", "unchecked.mcap, bit in the body 20")  # with seed 7
FINE = Verdict([], {})


def cases(name: str, share: float = 1.0, seed: int = 0) -> dict[str, Case]:
    return {case.name: case for case in CLASSES[name](seed, share)}


@pytest.mark.parametrize("name", CLASSES)
def test_a_quick_share(name: str, tmp_path: Path) -> None:
    problems = []
    for number, case in enumerate(CLASSES[name](1, QUICK)):
        folder = tmp_path / str(number)
        folder.mkdir()
        case.prepare(folder)
        problems += [(case.name, *problem) for problem in case.check(folder).problems]
    assert problems == []


@pytest.mark.parametrize(("name", "case"), [(name, case) for name, found in FOUND.items() for case in found])
def test_what_was_found(name: str, case: str, tmp_path: Path) -> None:
    assert cases(name)[case].check(tmp_path).problems == []


@pytest.mark.parametrize("case", FOUND_IN_DAMAGE)
def test_what_was_found_in_damaged_logs(case: str, tmp_path: Path) -> None:
    assert cases("damaged logs", seed=7)[case].check(tmp_path).problems == []


def test_the_classes_are_as_large_as_promised() -> None:
    least = {
        "damaged logs": 12 * 480,
        "crafted logs": 125,
        "bombs": 16,
        "maps": 92,
        "scans and frames": 60,
        "edited logs": 270,
        "cache": 1300,
        "hostile names": 200,
    }
    assert {name: len(CLASSES[name](0, 1.0)) >= count for name, count in least.items()} == dict.fromkeys(least, True)
    assert sum(count for count, _ in COUNTS.values()) == 480
    for name in CLASSES:
        names = [case.name for case in CLASSES[name](0, 1.0)]
        assert len(names) == len(set(names)), name


def _die(_: Path) -> Verdict:
    os.kill(os.getpid(), signal.SIGKILL)
    return FINE


def _sleep(_: Path) -> Verdict:
    signal.pause()
    return FINE


def _spin(_: Path) -> Verdict:
    while True:
        pass


def _fill(_: Path) -> Verdict:
    assert len(b"x" * (600 << 20)) > 0
    return FINE


def _raise(_: Path) -> Verdict:
    raise RuntimeError("a bug")


def test_crashes_hangs_and_gigabytes_are_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(harness, "PATIENCE_S", 2.0)
    monkeypatch.setattr(processes, "ASLEEP", 20)
    made = [Case("fine", lambda _: FINE), Case("dies", _die), Case("sleeps", _sleep), Case("fills", _fill)]
    made.append(Case("spins", _spin))
    total = harness.run_cases([*made, Case("raises", _raise), Case("fine again", lambda _: FINE)])
    assert {(case, kind) for case, kind, _ in total.problems} == {
        ("dies", CRASH),
        ("sleeps", HANG),
        ("spins", HANG),
        ("fills", LARGE),
        ("raises", CRASH),
    }
    assert total.cases == 7


def test_losses_and_alterations_are_noticed() -> None:
    base = bases.base_logs()[0]
    whole, tally = base.stamped, Tally()
    changed = [(topic, stamp, data[:-1] + b"\xff") for topic, stamp, data in whole[:1]]
    kinds = [
        [kind for kind, _ in damaged.compare(base, found, tally)[0]]
        for found in (whole, whole[1:], [*changed, *whole[1:]], [*whole, whole[0]])
    ]
    assert kinds == [[], [LOSS], [ALTERATION], [ALTERATION]]


def test_intact_chunks_are_asked_for() -> None:
    for base in bases.base_logs()[:3]:
        chunk = intact.parts_of(base.name).chunks[3]
        hurt = base.data[: chunk.start + 90] + b"\xff" + base.data[chunk.start + 91 :]
        wanted = intact.required(base, hurt)
        assert wanted == Counter(base.stamped) - Counter(chunk.messages)
        kinds = [kind for kind, _ in damaged.compare(base, list(wanted)[1:], Tally(undecodable=1), hurt)[0]]
        assert kinds == [WRONG]
    assert damaged.compare(base, wanted, Tally(undecodable=1), hurt)[0] == []


def test_a_file_that_is_gone_broken_or_left_over_is_noticed(tmp_path: Path) -> None:
    whole = {"a": b"new", "b": b"new", "c": b"new"}
    (tmp_path / "a").write_bytes(writing.OLD)
    (tmp_path / "b").write_bytes(b"ne")
    (tmp_path / "d.part").write_bytes(b"")
    expected = [(WRONG, "c is gone"), (WRONG, "b is broken")]
    assert writing.left_behind(tmp_path, whole, parts=True) == expected
    assert writing.left_behind(tmp_path, whole) == [*expected, (WRONG, "d.part was left behind")]


def test_seeds_make_other_cases() -> None:
    for name in ("crafted logs", "bombs", "failing writes", "hostile names"):
        made = {repr(_described(CLASSES[name](seed, 1.0))) for seed in (0, 0, 1, 2)}
        assert len(made) == 3, name


def _described(found: list[Case]) -> list[object]:
    """Names of cases and what they are given, without the functions."""
    return [(case.name, *(getattr(part, "args", ()) for part in (case.check, case.prepare))) for case in found]


@pytest.mark.parametrize("text", ["\x1b[2J", "\x9b1m", "a\u202eb", "\x07", "\x00", "\r"])
def test_control_bytes_are_noticed(text: str) -> None:
    assert [kind for kind, _ in outcome.unclean(Result(0, text.encode(), ""))] == [WRONG]
    assert [kind for kind, _ in outcome.unclean(Result(0, b"", text))] == [WRONG]
    assert [kind for kind, _ in outcome.unclean(Result(70, b"", "Traceback"))] == [CRASH]


def test_the_table(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(
        CLASSES, "maps", lambda _seed, _share: [Case("a", partial(_with, WRONG)), Case("b", partial(_with, LOSS))]
    )
    assert main(["--only", "maps", "--seed", "3"]) == 1
    printed = capsys.readouterr()
    assert printed.out.splitlines()[-1].startswith("| maps | 2 | 0 | 0 | 0 | 1 | 0 | 1 | 0.0")
    assert "wrong: a: as asked" in printed.err


def _with(kind: str, _: Path) -> Verdict:
    return Verdict([(kind, "as asked")], {"asked": 1})


def test_the_battery_explains_itself(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="0"):
        main(["--help"])
    assert "--quick" in capsys.readouterr().out
