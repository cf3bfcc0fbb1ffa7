from __future__ import annotations

import _thread
import io
import os
import signal
import struct
import threading
from contextlib import suppress
from dataclasses import replace
from itertools import islice
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.exceptions import EndOfFile
from mcap.reader import NonSeekingReader, make_reader
from mcap.records import Chunk, Message
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap_ros2.decoder import DecoderFactory
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from mclcli.errors import InputError
from mclcli.geometry import se2, se3
from mclcli.io.traces import trace_mcap
from mclcli.io.traces import trace_messages as messages
from mclcli.io.traces.cdr import CdrWriter
from mclcli.io.traces.chunked_mcap import CHUNK_BYTES
from mclcli.io.traces.output import open_output
from mclcli.io.traces.trace_mcap import TraceMcap
from mclcli.records import LaserScan, Transform
from tests.data import shared
from tests.io.traces import START_NS, grid, point, record

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from mclcli.io.traces.sinks import BinarySink

_STATIC = Transform(START_NS, "base_link", "laser", se3.from_rpy([0.1, 0.0, 0.2], np.pi, 0.0, 0.3), static=True)
_SEPARATOR = "\n" + "=" * 80 + "\n"


def _writer(stream: BinarySink, *, static_transforms: tuple[Transform, ...] = (_STATIC,)) -> TraceMcap:
    return TraceMcap(
        stream,
        grid=grid(),
        metadata={"version": "1.2"},
        parameters_yaml="seed: 0\n",
        odom_frame="odom",
        base_frame="base_link",
        static_transforms=static_transforms,
    )


def _odometry(step: int, parent: str = "odom", child: str = "base_link") -> Transform:
    made = point(step)
    return Transform(made.stamp_ns, parent, child, se3.from_planar(made.odom_from_base), static=False)


def _fill(writer: TraceMcap, steps: int = 3, n: int = 5) -> None:
    for step in range(steps):
        made = point(step, updated=step != 1, n=n)
        writer.transforms(made.stamp_ns, [_odometry(step), _odometry(step, "map", "odom")])
        writer.write(made)


def _file(steps: int = 3, n: int = 5) -> bytes:
    stream = io.BytesIO()
    writer = _writer(stream)
    _fill(writer, steps, n)
    writer.close()
    return stream.getvalue()


def _decoded(data: bytes) -> list[tuple[str, int, Any]]:
    reader = NonSeekingReader(io.BytesIO(data), validate_crcs=True, decoder_factories=[DecoderFactory()])
    found = reader.iter_decoded_messages(log_time_order=False)
    return [(channel.topic, message.log_time, decoded) for _, channel, message, decoded in found]


def _by_rosbags(data: bytes) -> list[tuple[str, int, Any]]:
    """The same messages by another reader's codec; types it lacks from the schemas in the file."""
    store = get_typestore(Stores.ROS2_JAZZY)
    found = []
    for schema, channel, message in make_reader(io.BytesIO(data), validate_crcs=True).iter_messages():
        assert schema is not None
        if schema.name not in store.fielddefs:
            types = get_types_from_msg(schema.data.decode(), schema.name)
            store.register({name: fields for name, fields in types.items() if name not in store.fielddefs})
        found.append((channel.topic, message.log_time, store.deserialize_cdr(message.data, schema.name)))
    return found


_READERS = [_decoded, _by_rosbags]


def _of(found: list[tuple[str, int, Any]], topic: str) -> list[Any]:
    return [message for name, _, message in found if name == topic]


def _planar(pose: Any) -> list[float]:
    q = pose.orientation
    return [pose.position.x, pose.position.y, 2 * np.arctan2(q.z, q.w)]


@pytest.mark.parametrize("read", _READERS)
def test_order_and_times(read: Any) -> None:
    found = read(_file())
    ours = ["/tf", "/mcl/pose", "/scan"]
    update = ["/amcl_pose", "/mcl/step", "/mcl/hypotheses", "/particlecloud", "/particle_cloud"]
    expected = ["/map", "/tf_static", "/tf", *ours, *update, "/tf", *ours, "/tf", *ours, *update]
    assert [topic for topic, _, _ in found] == expected
    assert {time for _, time, _ in found} == {point(step).stamp_ns for step in range(3)}


@pytest.mark.parametrize("read", _READERS)
def test_the_map(read: Any) -> None:
    (found,) = _of(read(_file()), "/map")
    assert (found.info.width, found.info.height) == (4, 3)
    assert found.info.resolution == np.float32(0.05)
    np.testing.assert_allclose(_planar(found.info.origin), [-3.0, 2.0, 0.5])
    assert np.frombuffer(bytes(np.array(found.data, dtype=np.int8)), np.int8).reshape(3, 4).tolist() == (
        grid().cells.tolist()
    )
    assert found.header.frame_id == "map"


@pytest.mark.parametrize("read", _READERS)
def test_transforms_make_one_tree(read: Any) -> None:
    found = read(_file())
    (static,) = _of(found, "/tf_static")[0].transforms
    assert (static.header.frame_id, static.child_frame_id) == ("base_link", "laser")
    q, t = static.transform.rotation, static.transform.translation
    rebuilt = se3.from_quaternion([t.x, t.y, t.z], [q.x, q.y, q.z, q.w])
    np.testing.assert_allclose(rebuilt, _STATIC.parent_from_child, atol=1e-15)
    edges = [(e.header.frame_id, e.child_frame_id) for m in _of(found, "/tf") for e in m.transforms]
    assert edges == [("odom", "base_link"), ("map", "odom")] * 3
    for step, message in enumerate(_of(found, "/tf")[1::2]):
        (edge,) = message.transforms
        t, q = edge.transform.translation, edge.transform.rotation
        map_from_odom = [t.x, t.y, 2 * np.arctan2(q.z, q.w)]
        map_from_base = se2.compose(map_from_odom, point(step).odom_from_base)
        np.testing.assert_allclose(map_from_base, point(step).estimate.pose, atol=1e-12)
        assert edge.header.stamp.sec * 10**9 + edge.header.stamp.nanosec == point(step).stamp_ns


def test_the_base_is_placed_where_no_recorded_tf_does() -> None:
    stream = io.BytesIO()
    writer = _writer(stream)
    writer.transforms(START_NS, [_odometry(0, "map", "odom"), _odometry(0, "world", "odom")])
    writer.write(point())
    writer.close()
    edges = [
        (e.header.frame_id, e.child_frame_id) for m in _of(_decoded(stream.getvalue()), "/tf") for e in m.transforms
    ]
    assert edges == [("map", "odom"), ("odom", "base_link")]


@pytest.mark.parametrize("read", _READERS)
def test_poses_and_covariances(read: Any) -> None:
    found = read(_file())
    for step, message in enumerate(_of(found, "/mcl/pose")):
        np.testing.assert_allclose(_planar(message.pose), point(step).estimate.pose, atol=1e-12)
    (first, _) = _of(found, "/amcl_pose")
    expected = np.zeros((6, 6))
    c = point().estimate.covariance
    for (i, a), (j, b) in [((i, a), (j, b)) for i, a in enumerate((0, 1, 5)) for j, b in enumerate((0, 1, 5))]:
        expected[a, b] = c[i, j]
    np.testing.assert_array_equal(np.reshape(first.pose.covariance, (6, 6)), expected)


@pytest.mark.parametrize("read", _READERS)
def test_particles_keep_their_weights_and_round_as_stated(read: Any) -> None:
    found, made = read(_file(n=300)), record(2, n=300)
    cloud, array = _of(found, "/particle_cloud")[1], _of(found, "/particlecloud")[1]
    weights = np.array([p.weight for p in cloud.particles])
    np.testing.assert_array_equal(weights, made.weights)
    assert abs(weights.sum() - 1.0) <= 1e-12
    poses = np.array([_planar(p.pose) for p in cloud.particles])
    np.testing.assert_array_equal(poses, [_planar(p) for p in array.poses])
    error = poses - made.poses
    error[:, 2] = se2.wrap(error[:, 2])
    assert np.abs(error[:, :2]).max() <= 2.0**-21
    assert np.abs(error[:, 2]).max() <= 2.0**-22
    np.testing.assert_array_equal(poses[:, :2] * 2**20, np.rint(poses[:, :2] * 2**20))


@pytest.mark.parametrize("read", _READERS)
def test_steps(read: Any) -> None:
    found, made = _of(read(_file()), "/mcl/step")[1], record(2)
    assert (found.step, found.n, found.beams_used) == (2, 5, 60)
    assert (found.ess, found.log_evidence) == (made.ess, made.log_evidence)
    assert (found.resampled, found.degenerate) == (True, False)
    assert list(found.sensors) == ["lidar", "vision"]
    assert list(found.alphas) == [0.3, 0.3]
    logs = np.reshape(found.log_likelihoods, (2, 5))
    np.testing.assert_allclose(logs, made.log_likelihoods, atol=2.0**-18)


@pytest.mark.parametrize("read", _READERS)
def test_scans_are_as_recorded(read: Any) -> None:
    found = _of(read(_file()), "/scan")[0]
    np.testing.assert_array_equal(found.ranges, point().scan.ranges)  # type: ignore[union-attr]
    assert (found.range_min, found.range_max, found.scan_time) == (0.125, 30.0, 0.25)
    assert found.header.frame_id == "laser"
    assert len(found.intensities) == 0


def test_a_real_scan_keeps_every_byte() -> None:
    store = get_typestore(Stores.ROS2_JAZZY)
    with shared("intel/intel.mcap").open("rb") as stream:
        for _, _, message in islice(make_reader(stream).iter_messages("/scan"), 5):
            found: Any = store.deserialize_cdr(message.data, "sensor_msgs/msg/LaserScan")
            stamp = found.header.stamp.sec * 10**9 + found.header.stamp.nanosec
            again = LaserScan(
                stamp,
                found.header.frame_id,
                found.angle_min,
                found.angle_increment,
                found.range_min,
                found.range_max,
                found.ranges.astype(np.float64),
                found.angle_max,
                found.time_increment,
                found.scan_time,
            )
            assert len(found.intensities) == 0
            assert messages.laser_scan(again) == bytes(message.data)


@pytest.mark.parametrize("sensors", [(), ("lidar",), ("lidar", "vision", "lidar_2")])
def test_empty_sequences_read_alike(sensors: tuple[str, ...]) -> None:
    stream = io.BytesIO()
    writer = _writer(stream, static_transforms=())
    logs = np.full((len(sensors), 5), -np.inf)
    made = replace(record(sensors=sensors), log_likelihoods=logs)
    writer.write(replace(point(), step=made))
    writer.close()
    for read in _READERS:
        (found,) = _of(read(stream.getvalue()), "/mcl/step")
        assert list(found.sensors) == list(sensors)
        assert list(found.log_likelihoods) == [-np.inf] * 5 * len(sensors)


def test_channels_schemas_metadata_and_attachment() -> None:
    reader = make_reader(io.BytesIO(_file()), validate_crcs=True)
    assert reader.get_header().profile == "ros2"
    summary = reader.get_summary()
    assert summary is not None
    for channel in summary.channels.values():
        schema = summary.schemas[channel.schema_id]
        assert (channel.message_encoding, schema.encoding) == ("cdr", "ros2msg")
        latched = channel.topic in {"/map", "/tf_static"}
        assert f"durability: {1 if latched else 2}" in channel.metadata["offered_qos_profiles"]
    assert len(summary.channels) == 10
    assert len(summary.schemas) == 8
    metadata = {record.name: record.metadata for record in reader.iter_metadata()}
    assert metadata["mcl"]["version"] == "1.2"
    assert "2^-20" in metadata["mcl"]["rounding"]
    (attachment,) = reader.iter_attachments()
    assert (attachment.name, attachment.data, attachment.log_time) == ("parameters.yaml", b"seed: 0\n", 0)


@pytest.mark.parametrize("name", ["sensor_msgs/msg/LaserScan", "nav_msgs/msg/OccupancyGrid", "tf2_msgs/msg/TFMessage"])
def test_definitions_are_those_of_ros(name: str) -> None:
    known, _ = get_typestore(Stores.ROS2_JAZZY).generate_msgdef(name, ros_version=2)
    ours, theirs = messages.definition(name).strip().split(_SEPARATOR), known.strip().split(_SEPARATOR)
    assert ours[0] == theirs[0]
    assert sorted(ours[1:]) == sorted(theirs[1:])


def test_types_are_described_in_the_order_in_which_they_are_needed() -> None:
    first, *others = messages.definition("tf2_msgs/msg/TFMessage").split(_SEPARATOR)
    assert first == "geometry_msgs/TransformStamped[] transforms"
    assert [text.splitlines()[0] for text in others] == [
        "MSG: geometry_msgs/TransformStamped",
        "MSG: std_msgs/Header",
        "MSG: geometry_msgs/Transform",
        "MSG: builtin_interfaces/Time",
        "MSG: geometry_msgs/Vector3",
        "MSG: geometry_msgs/Quaternion",
    ]
    assert others[-1] == "MSG: geometry_msgs/Quaternion\nfloat64 x\nfloat64 y\nfloat64 z\nfloat64 w\n"
    assert "MSG: nav2_msgs/Particle\ngeometry_msgs/Pose pose\nfloat64 weight\n" in messages.definition(
        "nav2_msgs/msg/ParticleCloud"
    )


def _chunks(data: bytes) -> list[list[tuple[int, int]]]:
    """(log time, size) of the messages in every whole chunk, up to where the file ends, complete or not."""
    chunks = []
    with suppress(EndOfFile, struct.error):
        for found in StreamReader(io.BytesIO(data), emit_chunks=True).records:
            if isinstance(found, Chunk):
                inside = [record for record in breakup_chunk(found, validate_crc=True) if isinstance(record, Message)]
                chunks.append([(message.log_time, len(message.data)) for message in inside])
    return chunks


def test_a_step_stays_in_one_chunk_and_chunks_end_after_64_kib() -> None:
    chunks = _chunks(_file(steps=12, n=300))  # a step is about 37 kB
    assert len(chunks) > 3
    times = [{time for time, _ in chunk} for chunk in chunks]
    assert sum(len(of_one) for of_one in times) == 12  # no stamp is in two chunks
    for chunk in chunks[:-1]:
        last = max(time for time, _ in chunk)
        assert sum(size for _, size in chunk) > CHUNK_BYTES
        assert sum(size for time, size in chunk if time != last) <= CHUNK_BYTES


def test_log_times_are_in_order_though_transforms_run_ahead_of_the_points() -> None:
    stream = io.BytesIO()
    writer = _writer(stream)
    for step in (1, 0, 2, 3):  # two of them the wrong way round
        writer.transforms(point(step).stamp_ns, [_odometry(step)])
    for step in range(3):
        writer.write(point(step, updated=True, n=5))
        writer.transforms(point(step + 4).stamp_ns, [_odometry(step + 4)])
    writer.close()
    times = [time for chunk in _chunks(stream.getvalue()) for time, _ in chunk]
    assert times == sorted(times)
    stream.seek(0)
    assert len(list(make_reader(stream).iter_messages(topics=["/tf"]))) == 7 + 3


def test_few_transforms_are_held(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(trace_mcap, "_HELD", 10)
    stream = io.BytesIO()
    writer = _writer(stream)
    for step in range(2000):
        writer.transforms(point(step).stamp_ns, [_odometry(step)])
    assert stream.tell() > 0  # a chunk is written before the end
    writer.close()
    times = [time for chunk in _chunks(stream.getvalue()) for time, _ in chunk]
    assert times == sorted(times)


def test_the_same_input_makes_the_same_bytes() -> None:
    assert _file(steps=8, n=300) == _file(steps=8, n=300)


def test_compressed_well() -> None:
    steps, n = 6, 2000
    assert len(_file(steps, n)) / ((steps - 1) * n) <= 50.0  # bytes a particle; one step makes no update


def test_a_pipe_will_do() -> None:
    read_end, write_end = os.pipe()
    received: list[bytes] = []

    def drain() -> None:
        with os.fdopen(read_end, "rb") as stream:
            received.append(stream.read())

    reader = threading.Thread(target=drain)
    reader.start()
    with os.fdopen(write_end, "wb") as stream:
        writer = _writer(stream)
        _fill(writer)
        writer.close()
    reader.join()
    assert received[0] == _file()


def test_an_interrupted_run_keeps_whole_steps(tmp_path: Path) -> None:
    def interrupted() -> None:
        with open_output(tmp_path / "t.mcap", binary=True) as out:
            writer = _writer(out)
            try:
                _fill(writer, steps=4, n=300)
                raise KeyboardInterrupt
            finally:
                writer.close()
                out.allow_part()

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert [p.name for p in tmp_path.iterdir()] == ["t.mcap.part"]
    assert (tmp_path / "t.mcap.part").read_bytes() == _file(steps=4, n=300)


def test_a_killed_run_loses_at_most_one_chunk(tmp_path: Path) -> None:
    with open_output(tmp_path / "t.mcap", binary=True) as out:
        writer = _writer(out)
        _fill(writer, steps=12, n=300)
        writer._file._wait()  # noqa: SLF001 - a kill may come when the thread has caught up
        (growing,) = tmp_path.iterdir()
        kept = _chunks(growing.read_bytes())
        writer.close()
    assert kept == _chunks((tmp_path / "t.mcap").read_bytes())[:-1]


class _Interrupting(io.BytesIO):
    """Presses Ctrl-C while the k-th piece is being written."""

    def __init__(self, k: int) -> None:
        super().__init__()
        self.k = k

    def write(self, data: Any, /) -> int:
        self.k -= 1
        if self.k == 0:
            _thread.interrupt_main()
        return super().write(data)


@pytest.fixture
def _interruptible() -> Iterator[None]:
    """Ctrl-C interrupts, also where the tests were started in the background, with SIGINT ignored."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("_interruptible")
@pytest.mark.parametrize("k", [10, 11, 12, 13, 30])
def test_ctrl_c_tears_no_chunk(k: int) -> None:
    stream = _Interrupting(k)
    writer = _writer(stream)

    def run_until_interrupted() -> None:
        for step in range(1000):
            writer.write(point(step, n=700))

    with pytest.raises(KeyboardInterrupt):
        run_until_interrupted()
    writer.close()
    found = _decoded(stream.getvalue())
    steps = [message.step for message in _of(found, "/mcl/step")]
    assert steps == list(range(len(steps)))
    assert len(_of(found, "/particle_cloud")) == len(steps) > 0


class _Refusing:
    def __init__(self, room: int) -> None:
        self.room = room

    def write(self, data: bytes, /) -> int:
        self.room -= len(data)
        if self.room < 0:
            raise InputError("t.mcap: cannot write: No space left on device; nothing was kept")
        return len(data)

    def flush(self) -> None:
        pass


@pytest.mark.parametrize("room", [3_000, 20_000, 60_000])
def test_an_error_in_writing_is_told(room: int) -> None:
    writer = _writer(_Refusing(room))

    def run() -> None:
        try:
            _fill(writer, steps=8, n=300)
        finally:
            writer.close()

    with pytest.raises(InputError, match="No space left"):
        run()


def test_nothing_that_is_not_a_number_is_written() -> None:
    writer = _writer(io.BytesIO())
    made = record()
    poses = np.array(made.poses)
    poses[2, 0] = np.nan
    with pytest.raises(ValueError, match="pose to be written is not finite"):
        writer.write(replace(point(), step=replace(made, poses=poses)))
    writer.close()
    with pytest.raises(InputError, match="before 1970"):
        _writer(io.BytesIO()).write(replace(point(scanned=False, updated=False), stamp_ns=-1))
    with pytest.raises(InputError, match="does not fit ROS time"):
        _writer(io.BytesIO()).write(replace(point(scanned=False, updated=False), stamp_ns=2**62))


@given(st.lists(st.floats(-1.0, 1.0), min_size=4, max_size=4).filter(lambda q: sum(v * v for v in q) > 1e-3))
def test_quaternions_come_back(values: list[float]) -> None:
    q = np.array(values) / np.linalg.norm(values)
    found = messages.quaternion(se3.from_quaternion([0, 0, 0], q))
    assert found[3] >= 0
    assert min(np.abs(found - q).max(), np.abs(found + q).max()) < 1e-14


_KINDS = st.sampled_from("bBiIfds")


@settings(max_examples=60)
@given(st.lists(_KINDS, min_size=1, max_size=12), st.integers(0, 5))
def test_cdr_aligns_as_another_implementation_does(kinds: list[str], count: int) -> None:
    names = {
        "b": "int8[]",
        "B": "uint8[]",
        "i": "int32",
        "I": "uint32",
        "f": "float32[]",
        "d": "float64[]",
        "s": "string",
    }
    text = "\n".join(f"{names[kind]} f{i}" for i, kind in enumerate(kinds))
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(text, "t/msg/T"))
    writer, values = CdrWriter(), []
    for kind in kinds:
        value: Any = "ab" * count
        if kind in "iI":
            value = count
            writer.i32(count) if kind == "i" else writer.u32(count)
        elif kind == "s":
            writer.string(value)
        else:
            value = np.arange(count, dtype=kind)
            writer.sequence(value)
        values.append(value)
    message = store.types["t/msg/T"](*values)
    assert writer.finish() == bytes(store.serialize_cdr(message, "t/msg/T"))


def test_cdr_of_single_numbers() -> None:
    writer = CdrWriter()
    writer.boolean(True)
    writer.f64(1.5)
    writer.boolean(False)
    writer.f32(0.5, 2.0)
    expected = struct.pack("<4s?7xd?3xff", b"\0\1\0\0", True, 1.5, False, 0.5, 2.0)
    assert writer.finish() == expected
