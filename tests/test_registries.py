"""Adding something is one file and one line in a registry: a toy of each kind (``tests/toys``), used as users would."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from mclcli.errors import UsageError
from mclcli.settings import profiles
from tests.cli.support import (
    OFFICE,
    OFFICE_MAP,
    REFERENCE_MAP,
    ROOT,
    Message,
    Result,
    Table,
    decoded,
    messages,
    single_error,
    without,
    write_mcap,
)
from tests.toys import container, vision
from tests.toys.serving import Served

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

LIDAR = "from mclcli.sensors.models import LIDAR_MODELS; LIDAR_MODELS['toy'] = 'tests.toys.lidar_model:TOY'"
RESAMPLER = (
    "from mclcli.filter.resampling import RESAMPLERS; from tests.toys.resampler import likeliest; "
    "RESAMPLERS['toy'] = likeliest"
)
OUTPUT = "from mclcli.io.traces.formats import OUTPUTS; OUTPUTS['trace']['.toy'] = 'tests.toys.output:TOY'"
CONTAINER = (
    "from mclcli.io.logs.sniff import CONTAINERS, Kind; "
    "CONTAINERS[b'TOYLOG'] = Kind('a toy', ('.toy',), 'tests.toys.container:ToyFile')"
)
VISION = "from mclcli.io.messages.sightings import VISION; VISION['toy_msgs/msg/Seen'] = 'tests.toys.vision:TOY'"


SERVED: dict[str, Served] = {}


@pytest.fixture(scope="module", autouse=True)
def _ended() -> Iterator[None]:
    yield
    assert [served.end() for served in SERVED.values()] == [0] * len(SERVED)
    SERVED.clear()


def mcl(line: str, *words: object) -> Result:
    """Run mcl with one line more in a registry, and with nothing else that a test has done."""
    if line not in SERVED:
        code = f"{line}; from tests.toys.serving import serve; serve()"
        pipe = subprocess.PIPE
        SERVED[line] = Served(subprocess.Popen([sys.executable, "-c", code], cwd=ROOT, stdin=pipe, stdout=pipe))
    result: Result = SERVED[line].ask([str(word) for word in words])
    return result


def good(line: str, *words: object) -> str:
    """What mcl writes to standard output where all is well."""
    done = mcl(line, *words)
    assert done.code == 0, done.err
    return done.out.decode()


SCORE = ("score", "samples/reference_set1.yaml", "--map", REFERENCE_MAP)
RUN = ("run", OFFICE, "--map", OFFICE_MAP, "--init", "0,0,0", "--duration", "2", "--particles", "50", "-q")
LOCATE = ("locate", OFFICE, "--map", OFFICE_MAP, "--index", "0", "-q")


def test_a_lidar_model_scores() -> None:
    words = (*SCORE, "--model", "toy", "--pose", "1.5,2,0", "--temperature", "1", "-q")
    near, far = (Table(good(LIDAR, *words, "--set", f"stiffness={k}"))["log_lidar"][0] for k in (0.1, 0.3))
    assert near < 0.0
    assert far == pytest.approx(3.0 * near)
    rows = Table(good(LIDAR, *words, "--explain"))
    assert set(rows.texts("log_p")) == {"-0.625"}


def test_a_lidar_model_runs_and_its_map_is_searched() -> None:
    track = Table(good(LIDAR, *RUN, "--model", "toy", "--track", "-"))
    assert len(track.rows) > 1
    assert mcl(LIDAR, *LOCATE, "--model", "toy") == mcl(LIDAR, *LOCATE)


def test_a_lidar_model_has_parameters_by_profile(tmp_path: Path) -> None:
    assert "likelihood_field_prob|beam|toy" in good(LIDAR, "run", "--help").replace("\n", "").replace(" ", "")
    for form in ("mcl", "nav2"):
        for profile, stiffness in (("textbook", "0.25"), ("nav2", "0.5")):
            text = good(LIDAR, "params", "--model", "toy", "--profile", profile, "--format", form)
            assert (f"stiffness: {stiffness}" in text) == (form == "mcl")  # the other leaves defaults out
            assert "sigma_hit" not in text
            file = tmp_path / "params.yaml"
            file.write_text(text)
            again = good(LIDAR, "params", "--params", file, "--format", form)
            assert again == text
            assert "model: toy" in text.replace('"', "")
    assert "stiffness" not in good(LIDAR, "params")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--model", "toys"), "toy"),
        (("--model", "toy", "--set", "stiffnes=1"), "stiffness"),
        (("--model", "toy", "--set", "stiffness=-1"), "at least 0"),
    ],
)
def test_what_a_lidar_model_does_not_have_is_said_plainly(words: tuple[str, ...], said: str) -> None:
    for command in (("params",), (*SCORE, "--pose", "1.5,2,0"), RUN):
        assert said in single_error(mcl(LIDAR, *command, *words), 2)


def test_unknown_names_are_refused_by_the_library_as_well() -> None:
    with pytest.raises(UsageError, match=r"model 'beams': must be one of .* beam"):
        profiles.build({}, model="beams")
    with pytest.raises(UsageError, match="profile 'nav': must be one of"):
        profiles.build({}, profile="nav")  # type: ignore[arg-type]


def test_a_resampler_draws_the_particles_of_a_run() -> None:
    words = (*RUN, "--set", "resample_ess=1", "--steps", "-")
    likeliest = Table(good(RESAMPLER, *words, "--set", "resampler=toy"))
    usual = Table(good(RESAMPLER, *words))
    assert likeliest.rows != usual.rows
    assert "resampler: toy" in good(RESAMPLER, "params", "--set", "resampler=toy")
    assert "multinomial, toy" in single_error(mcl(RESAMPLER, *RUN, "--set", "resampler=toys"), 2)


def test_an_output_takes_the_points_of_a_run(tmp_path: Path) -> None:
    track = Table(good(OUTPUT, *RUN, "-o", tmp_path / "x.toy", "--track", "-"))
    frame, points, transforms = (tmp_path / "x.toy").read_text().split()
    assert (frame, int(points)) == ("map", len(track.rows))
    assert int(transforms) > 0
    assert ".mcap, .parquet, .toy, or -" in " ".join(good(OUTPUT, "run", "--help").split())
    refused = single_error(mcl(OUTPUT, *RUN, "-o", tmp_path / "x.toys"), 2)
    assert "must end in .csv or .csv.gz or .mcap or .parquet or .toy" in refused
    assert "must end in .csv or .tum" in single_error(mcl(OUTPUT, *RUN, "--track", tmp_path / "x.toy"), 2)
    assert [path.name for path in tmp_path.iterdir()] == ["x.toy"]


def test_a_container_is_read_by_its_first_bytes(tmp_path: Path) -> None:
    file, other = tmp_path / "some.name", tmp_path / "folder"
    file.write_bytes(container.MAGIC + b"1 2\n3 4\n")
    other.mkdir()
    (other / "x.toy").write_bytes(file.read_bytes())
    for log in (file, other):
        said = json.loads(good(CONTAINER, "info", log, "--json"))
        assert [(topic["topic"], topic["messages"], topic["problem"]) for topic in said["topics"]] == [
            ("/poses", 2, "")
        ]
    whole = good(CONTAINER, "recover", file, "-o", tmp_path / "x.mcap", "-q")
    assert whole == ""
    assert '"toy log"' in good(CONTAINER, "info", file, "--json")
    file.write_bytes(b"TOILOG")
    assert "nor a ROS 1 bag, nor a toy)" in single_error(mcl(CONTAINER, "info", file), 1)
    (other / "x.toy").unlink()
    assert "(no .mcap, .db3, .bag or .toy file)" in single_error(mcl(CONTAINER, "info", other), 1)


def test_a_message_of_landmarks_weighs_the_particles_of_a_run(tmp_path: Path) -> None:
    contents = messages(OFFICE)[:1000]
    seen = [_seen(message) for message in contents if message.topic == "/landmarks" and decoded(message).ids]
    in_order = sorted([*without(contents, "/landmarks"), *seen], key=lambda message: message.log_ns)
    log = write_mcap(tmp_path / "x.mcap", in_order)
    words = ("run", log, *RUN[2:], "--duration", "10", "--landmarks", "samples/office.landmarks.csv")
    topics = json.loads(good(VISION, "info", log, "--json"))["topics"]
    assert {topic["topic"]: (topic["role"], topic["problem"]) for topic in topics}["/seen"] == ("vision", "")
    assert (Table(good(VISION, *words, "--steps", "-"))["beams_vision"] > 0.0).any()
    assert "cannot use messages of type toy_msgs" in single_error(mcl("pass", *words, "--vision", "/seen"), 2)


def _seen(message: Message) -> Message:
    """The first landmark of a message, as the toy."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    store.register(get_types_from_msg(vision.TEXT, vision.KIND))
    told = decoded(message)
    x, y = math.cos(told.bearings[0]), math.sin(told.bearings[0])
    stamp = store.types["builtin_interfaces/msg/Time"](told.header.stamp.sec, told.header.stamp.nanosec)
    header = store.types["std_msgs/msg/Header"](stamp, told.header.frame_id)
    data = store.serialize_cdr(store.types[vision.KIND](header, told.ids[0], x, y), vision.KIND)
    text, _ = store.generate_msgdef(vision.KIND, ros_version=2)
    return Message("/seen", vision.KIND, text.encode(), message.log_ns, bytes(data))
