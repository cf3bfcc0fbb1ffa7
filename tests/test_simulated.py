"""Whole runs over simulated logs, where the truth is known: kidnapping, sweeps, clocks, threads."""

from __future__ import annotations

import functools
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from mclcli.filter.kld import KldParameters
from mclcli.filter.start import AroundPose
from mclcli.geometry import se3
from mclcli.records import LaserScan
from mclcli.replay.loop import ReplayTally, replay
from mclcli.settings import profiles
from samples.sim import memory
from samples.sim.layouts import office_floor
from samples.sim.recording import Recording, Scenario, simulate
from samples.sim.robot import Drive
from samples.sim.sensors import Lidar, Mount
from tests.replay.replays import NOISY, ns, odom, setup
from tests.replay.replays import run as replayed
from tests.support import scan_of

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray
    from mclcli.records import TrackPoint
    from tests.replay.replays import Event

MOUNT = Mount(0.1, 0.0, 0.2)
TOUR = ("lobby", "south2", "south3")
KIDNAPPED = (TOUR, ("north4", "core1", "lobby", "south3"))


@functools.cache
def drive(tours: tuple[tuple[str, ...], ...] = (TOUR,), sweep: float = 0.0, turn: float = 1.2) -> Recording:
    floor = office_floor(seed=4, origin=(-9.6, -6.4, 0.0))
    lidar = Lidar(MOUNT, sweep=sweep)
    return simulate(Scenario(name="office", mapped=floor, tours=tours, lidar=lidar, drive=Drive(turn=turn), seed=3))


def run(
    recording: Recording, values: dict[str, object] | None = None, seed: int = 0, **changes: Any
) -> list[TrackPoint]:
    ready = memory.setup(
        recording, profiles.build({"hypotheses": 0, **(values or {})}), seed=seed, alpha="auto", **changes
    )
    return list(replay(memory.events(recording), ready, ReplayTally()))


def errors(recording: Recording, points: list[TrackPoint]) -> tuple[FloatArray, FloatArray]:
    """Errors of position [m] and yaw [rad] at every scan."""
    poses = np.array([point.estimate.pose for point in points])
    truth = recording.truth.at(np.array([point.stamp_ns for point in points]))
    return np.hypot(*(poses - truth)[:, :2].T), np.abs(np.angle(np.exp(1j * (poses - truth)[:, 2])))


def rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def test_a_simulated_robot_is_tracked_and_the_filter_knows_it() -> None:
    points = run(drive())
    distance, _ = errors(drive(), points)
    assert rms(distance) < 0.06
    steps = [point.step for point in points if point.step]
    assert min(step.reliability for step in steps) > 0.85
    assert sum(step.injected for step in steps) == 0


def test_a_kidnapped_robot_is_found_again_with_recovery_and_not_without() -> None:
    recording = drive(KIDNAPPED)
    found, lost = (run(recording, {"recovery": choice}, seed=1) for choice in ("uniform", "off"))
    assert errors(recording, found)[0][-20:].max() < 0.5
    assert errors(recording, lost)[0][-20:].min() > 1.0
    jump = int(np.argmax(np.hypot(*np.diff(recording.truth.poses[:, :2], axis=0).T)))
    before = [p.step for p in found if p.step and p.stamp_ns <= recording.truth.stamps_ns[jump]]
    after = [p.step for p in lost if p.step and p.stamp_ns > recording.truth.stamps_ns[jump] + 2_000_000_000]
    assert sum(step.injected for step in before) <= 0.05 * 2000 * len(before)
    assert np.median([step.reliability for step in after]) < 0.8


def test_sweeps_are_straightened() -> None:
    """A lidar that takes 125 ms for a turn, on a robot that turns at up to 1.6 rad/s."""
    recording = drive(sweep=0.12, turn=1.6)
    plain, straight = (errors(recording, run(recording, deskew=deskew)) for deskew in (False, True))
    assert rms(straight[0]) < 0.9 * rms(plain[0])
    assert rms(straight[1]) < 0.7 * rms(plain[1])


def test_a_clock_that_lags_is_put_right() -> None:
    recording = drive()
    late_ns = 150_000_000
    shifted = replace(recording, scan_stamps_ns=recording.scan_stamps_ns + late_ns)
    setups = [memory.setup(shifted, alpha="auto", scan_offset_ns=offset) for offset in (0, -late_ns)]
    wrong, right = (errors(recording, list(replay(memory.events(shifted), setup))) for setup in setups)
    assert rms(right[0]) < 0.06
    assert rms(right[1]) < 0.6 * rms(wrong[1])


def track_bytes(points: list[TrackPoint]) -> bytes:
    return b"".join(point.estimate.pose.tobytes() for point in points)


@pytest.mark.parametrize("threads", [2, 4])
def test_threads_change_no_bit(threads: int) -> None:
    recording = drive()
    values = {"particles": 9000, "recovery": "uniform"}
    plain = memory.setup(recording, profiles.build(values), alpha="auto")
    lidar: Any = plain.instruments["/scan"]
    shared = replace(plain, instruments={"/scan": replace(lidar, model=replace(lidar.model, threads=threads))})
    events = memory.events(recording)[:400]
    assert track_bytes(list(replay(events, plain))) == track_bytes(list(replay(events, shared)))


def test_driving_backwards_keeps_one_cluster() -> None:
    """Ten metres of reverse gear facing west, where yaw wraps."""
    localizer = replace(setup().localizer, motion=NOISY, size=KldParameters(500, 500))
    nothing = np.full(3, np.nan)
    events: list[Event] = []
    for i in range(41):
        events += [odom(i, -0.2 * i), ("/scan", replace(scan_of(nothing), stamp_ns=ns(i + 0.1)))]
    points, _ = replayed(events, localizer=localizer, start=AroundPose(np.array([2.0, 3.0, np.pi]), np.zeros((3, 3))))
    steps = [point.step for point in points if point.step]
    assert len(steps) > 10
    assert min(step.hypotheses()[0].weight for step in steps) > 0.9  # all but a few far-flung; nav2_amcl: 0.28
    assert {bool((step.poses[:, 2] < 0).any()) for step in steps[1:]} == {
        True
    }  # it lies on both sides of the half turn
    assert points[-1].estimate.pose[0] > 8.5  # 9.8, less what a spread of headings takes from the mean


def test_another_lidar_does_not_shift_the_motion_noise() -> None:
    recording = drive()
    one = memory.setup(recording, alpha="auto")
    blind: Any = one.instruments["/scan"]
    both = replace(one, instruments={**one.instruments, "/rear": replace(blind, name="lidar_2")})
    events = memory.events(recording)[:60]
    scan: LaserScan = next(record for topic, record in events if topic == "/scan")  # type: ignore[assignment]
    rear = ("/rear", replace(scan, stamp_ns=scan.stamp_ns + 1000, ranges=np.full(scan.ranges.size, np.nan)))
    first, second = list(replay(events, one)), list(replay([*events[:30], rear, *events[30:]], both))
    assert [p.step.poses.tobytes() for p in first if p.step][:2] == [p.step.poses.tobytes() for p in second if p.step][
        :2
    ]


def test_lidars_with_mounts_and_stamps_of_their_own_agree() -> None:
    """The same sweep from a second lidar, turned on its mount by 2 rad: a wrong mount would tear the two apart."""
    recording = drive()
    one = memory.setup(recording, alpha="auto")
    lidar: Any = one.instruments["/scan"]
    events = memory.events(recording)
    mount = one.frames.lookup("base_link", "laser", 0)
    assert mount is not None
    behind = [
        ("/rear", replace(record, frame_id="rear", angle_min=record.angle_min - 2.0))
        for _, record in events
        if isinstance(record, LaserScan)
    ]
    same_place = mount @ se3.from_planar([0.0, 0.0, 2.0])
    both = replace(
        one,
        instruments={"/scan": lidar, "/rear": replace(lidar, name="lidar_2")},
        mounts={"rear": same_place},
    )
    merged = sorted([*events, *behind], key=lambda event: event[1].stamp_ns)  # type: ignore[attr-defined]
    points = list(replay(merged, both))
    assert rms(errors(recording, points)[0]) < 0.06
    assert {step.sensors for step in (p.step for p in points) if step} == {("lidar", "lidar_2")}
