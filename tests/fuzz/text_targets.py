"""Files that people write, and the command line, as targets."""

from __future__ import annotations

import contextlib
import io
import struct
import zlib
from typing import TYPE_CHECKING

import click
import numpy as np
from PIL import Image

from mclcli.cli import COMMANDS, group
from mclcli.cli.clock import parse_seconds, parse_time
from mclcli.cli.eval.options import parse_share
from mclcli.errors import InputError, UsageError
from mclcli.io.maps.image import read_image
from mclcli.io.maps.map_yaml import load_map
from mclcli.io.tables import safe_yaml
from mclcli.io.tables.csv_table import read_poses
from mclcli.io.tables.landmarks_file import read_bearings, read_landmarks
from mclcli.io.tables.scan_file import parse_scan
from mclcli.io.tables.tum import read_tum
from mclcli.quantity import parse_list, parse_quantity
from mclcli.settings import profiles
from mclcli.settings.robots.reading import load_settings
from tests.fuzz.engine import Target

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

REFUSED = (InputError, UsageError)
LINE = (*REFUSED, click.ClickException, click.exceptions.Exit)
MAP = b"image: m.pgm\nresolution: 0.05\norigin: [-1.5, 2.5, 0.0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.25\n"
SCAN = (
    b"header:\n  stamp: {sec: 5, nanosec: 7}\n  frame_id: laser\nangle_min: -1.5\nangle_max: 1.5\n"
    b"angle_increment: 0.1\nrange_min: 0.1\nrange_max: 12\nranges: [1.5, .inf, 2, .nan]\nmcl: {base_frame: base, "
    b"base_from_sensor: [0.1, 0, 0, 0, 0, 1]}\n"
)
JSON = (
    b'{"angle_min": -1.5, "angle_increment": 0.1, "range_min": 0.1, "range_max": 12, "ranges": [1, "nan", NaN, null]}'
)
PARAMS = b"sigma_hit: 0.2\nmax_beams: 60\nlaser_model_type: beam\n"
ROS = b"/amcl:\n  ros__parameters:\n    sigma_hit: 0.2\n    robot_model_type: nav2_amcl::DifferentialMotionModel\n"
LANDMARKS = (b"id,x,y,z\na,1,2,0.5\nb,3m,40cm,0\n", b"landmarks:\n- {id: a, x: 1, y: 2}\n- {id: 7, x: 1, y: 30cm}\n")
TRACKS = (
    b"# a track\n1700000000.5 1 2 0 0 0 0 1\n1700000001.5 1 2 0 0 0 0.6 0.8\n",
    b"stamp,segment,x,y,yaw,cov_xx,cov_xy,cov_xyaw,cov_yy,cov_yyaw,cov_yawyaw,updated\n1.5,0,1,2,3,1,0,0,1,0,1,0\n",
)
YAML = (
    b"- ",
    b": ",
    b"&a ",
    b"*a",
    b"<<: ",
    b"!!x ",
    b"---\n",
    b"...\n",
    b"|\n ",
    b'"\\U',
    b"? ",
    b"[",
    b"{",
    b"%YAML",
    b"\t",
)
ROS1 = b"odom_model_type: omni\nodom_alpha1: 0.1\nlaser_z_hit: 0.5\ninitial_pose_x: 1.0\n"
LAUNCH = b"""<launch>
<arg name="a" default="0.5"/>
<group ns="r" if="true"><rosparam ns="amcl">{kld_err: 0.1}</rosparam>
<node pkg="amcl" type="amcl" name="amcl"><param name="odom_alpha1" value="$(arg a)" type="double"/>
<remap from="scan" to="front"/><rosparam subst_value="true">laser_z_hit: $(arg a)</rosparam></node></group></launch>
"""
XML = (
    b"<!DOCTYPE x [",
    b'<!ENTITY a "b">',
    b"&a;",
    b"&#65;",
    b"<![CDATA[",
    b"]]>",
    b"<!--",
    b"$(arg a)",
    b"$(find a)",
    b' unless="1"',
    b' type="yaml"',
    b"<node>",
    b"</node>",
)
TIMES = (b"12.5", b"@1663967375.8", b"14:32:05.25", b"2022-09-23T21:09:35+02:00", b"1s", b"95%")
LINES = (
    b"run\nx.mcap\n--map\nm.yaml\n--init\n1,2,90deg\n--set\nsigma_hit=0.2\n--mount\nlaser=0.1,0,0,0,0,1deg",
    b"score\nx.yaml\n--map\nm.yaml\n--pose\n1,2,3\n--around\n1,2,90deg\n--spread\n0.5,0.2\n-n\n5\n--grid\n0.5,30deg",
    b"locate\nx.yaml\n--map\nm.yaml\n--prior\n1,2,3\n--region\n1,2,3,4\n--every\n5",
    b"eval\nt.tum\n--truth\nr.tum\n--max-ape\n0.1m\n--within\n95%,10cm",
    b"dt\nm.yaml\n--method\nexact\n--max-dist\n2m",
    b"extract\nx.mcap\n--at\n12.3",
    b"info\nx.mcap\n--json",
    b"recover\nx.mcap\n-o\ny.mcap",
    b"params\n--set\nmax_beams=5",
)
_WORDS = (
    b"--temperature --particles --seed --model --profile --steps --track --start --duration --offset --deskew "
    b"--recovery --lidar --threads --color --landmarks --bearings --format --topic --scan --odom --help -v -q"
)
OPTIONS = tuple(b"\n%b\n" % word for word in _WORDS.split())


def targets(folder: Path) -> list[Target]:
    """All of them; files are written in a folder."""
    (folder / "m.pgm").write_bytes(PICTURES[0])

    def file(name: str, read: Callable[[Path], object]) -> Callable[[bytes], object]:
        def run(data: bytes) -> object:
            (folder / name).write_bytes(data)
            return read(folder / name)

        return run

    def image(path: Path) -> object:
        return read_image(path, 1 << 12)

    return [
        Target("yaml", lambda data: safe_yaml.parse(data, "x"), REFUSED, [MAP, PARAMS, LANDMARKS[1]], YAML, limit=300),
        Target("map", file("m.yaml", load_map), REFUSED, [MAP], YAML, limit=300),
        Target("parameters", file("p.yaml", load_settings), REFUSED, [PARAMS, ROS], YAML, limit=300),
        Target("launch file", file("a.launch", load_settings), REFUSED, [LAUNCH, ROS1], XML, limit=500),
        Target("scan", lambda data: parse_scan(data, "x"), REFUSED, [SCAN, JSON], YAML, limit=500),
        Target("landmarks", file("l", read_landmarks), REFUSED, LANDMARKS, YAML, limit=200),
        Target("bearings", file("b.csv", read_bearings), REFUSED, [b"id,bearing\na,35deg\nb,-0.1\n"], limit=200),
        Target("poses", file("p.csv", read_poses), REFUSED, [b'x,y,yaw,"n"\n1,2,90deg,a\n1,2,3,"b""c"\n'], limit=300),
        Target("track", file("t", read_tum), REFUSED, TRACKS, limit=400),
        Target("image", file("i", image), REFUSED, PICTURES, mend=png_mended, limit=2048),
        Target("quantity", quantity, REFUSED, [b"m1.5cm", b"r-90deg", b"s5min", b"m1,2,3deg"], TIMES, limit=40),
        Target("time", moment, REFUSED, TIMES, TIMES, limit=50),
        Target("settings", settings, REFUSED, [PARAMS.replace(b": ", b"=")], TIMES, limit=120),
        Target("command line", command_line, LINE, LINES, (*OPTIONS, *TIMES), limit=300),
    ]


def quantity(data: bytes) -> None:
    """A number with its unit, or several; the first letter tells which are expected."""
    text = data.decode("utf-8", "replace")
    unit = {"m": "m", "r": "rad", "s": "s"}.get(text[:1], "")
    with contextlib.suppress(UsageError):
        parse_list(text[1:], ("m", unit, "rad"), "--x")
    parse_quantity(text[1:], unit, "--x")


def moment(data: bytes) -> None:
    """A time within a log, a duration, a share."""
    text = data.decode("utf-8", "replace")
    for parse in (parse_seconds, parse_share):
        with contextlib.suppress(UsageError):
            parse(text, "--x")
    parse_time(text, "--start").stamp_ns(1_700_000_000 * 10**9)


def settings(data: bytes) -> None:
    """Values of parameters, as of --set."""
    pairs = (line.partition("=") for line in data.decode("utf-8", "replace").split("\n"))
    profiles.build({key: value for key, _, value in pairs if key}, profile="nav2", model="beam")


def command_line(data: bytes) -> None:
    """Words of a command line, one a line: as far as it goes before anything is read."""
    name, *words = data.decode("utf-8", "surrogateescape").replace("\0", "").split("\n")
    command = group.get_command(click.Context(group), name if name in COMMANDS else "run")
    if command is None:
        raise AssertionError(f"no command {name}")
    with contextlib.redirect_stdout(io.StringIO()), command.make_context(name, words):
        pass


def png_mended(data: bytes) -> bytes:
    """A PNG with the checksums that its parts should have; anything else as it is."""
    if not data.startswith(b"\x89PNG\r\n\x1a\n"):
        return data
    parts, at = [data[:8]], 8
    while at + 12 <= len(data):
        (length,) = struct.unpack_from(">I", data, at)
        stop = at + 8 + length
        if stop + 4 > len(data):
            break
        body = data[at + 4 : stop]
        parts += [data[at : at + 4], body, struct.pack(">I", zlib.crc32(body))]
        at = stop + 4
    return b"".join([*parts, data[at:]])


def _pictures() -> list[bytes]:
    """A small picture in every format that is read."""
    pixels = np.array([[0, 254, 205], [254, 205, 0]], np.uint8)
    gray = Image.fromarray(pixels)
    made = [
        b"P5\n3 2\n255\n" + pixels.tobytes(),
        b"P2 # by hand\n3 2\n255\n0 254 205 254 205 0\n",
        b"P5 3 2 65535\n" + (pixels.astype(">u2") * 257).tobytes(),
        b"P6 3 2 255\n" + np.repeat(pixels, 3).tobytes(),
        b"P3 3 2 255\n" + b" 7" * 18,
        b"P1 3 2\n010 110\n",
        b"P4 3 2\n\xa0\x40",
    ]
    for image, form in ((gray, "PNG"), (gray.convert("RGBA"), "PNG"), (gray.convert("P"), "PNG"), (gray, "BMP")):
        stream = io.BytesIO()
        image.save(stream, form)
        made.append(stream.getvalue())
    return made


PICTURES = _pictures()
