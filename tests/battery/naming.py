"""Hostile names of topics, frames, types and files: in the table, in the log of messages, in CSV, in MCAP."""

from __future__ import annotations

import csv
import io
import json
import logging
from functools import partial
from typing import TYPE_CHECKING, Any

from mcap.reader import make_reader
from mcap.writer import Writer

from tests.battery import content
from tests.battery.harness import WRONG, Case, Verdict
from tests.battery.outcome import said, unclean
from tests.cli.support import mcl
from tests.io.logs import seeded
from tests.io.ros_messages import STORES

if TYPE_CHECKING:
    from pathlib import Path
    from random import Random

STORE = STORES["cdr"]
NAMES = (
    "\x1b[2J\x1b[31mred",
    "\x1b]0;title\x07",
    "\x1b]8;;http://x\x1b\\link\x1b]8;;\x1b\\",
    "\x1bP+q\x1b\\",
    "\x9b31m",
    "\x9d0;t\x9c",
    "\x07bell",
    "back\x08\x08space",
    "\rcarriage",
    "new\nline",
    "\x0bvertical",
    "\x0cform",
    "tab\tbed",
    "nul\0nul",
    "\x7fdelete",
    "\u202eright to left",
    "\u2066isolate\u2069",
    "\u200fmark",
    "\u061cletter",
    "\u2028line",
    "\u2029paragraph",
    "\ufeffbom",
    "zero\u200bwidth",
    "[red]markup[/red]",
    "[link=http://x]text[/link]",
    "[bold",
    ":smile:",
    "%s%n%d",
    "{0.__class__}",
    "$(reboot)",
    "=1+1",
    "+1+1",
    "-1+1",
    "@SUM(A1)",
    "\t=1",
    '=HYPERLINK("http://x")',
    'quote"comma,',
    "../../etc/passwd",
    "x" * 5000,
    "\U0001f600\u0301" * 50,
)


_FORMULA = ("", "=")
MADE_UP = 12
"""Names of a seed's own."""
_KINDS = (
    "\x01\x02\x07\x08\x0b\x0e\x1a",
    "\x80\x85\x90\x9b\x9d\x9f",
    "\u061c\u200e\u202b\u2029\u2068",
    "=+-@[]{}%$:#'\"",
)


def cases(seed: int, share: float) -> list[Case]:
    """Every name, and some made up, in the table, the messages, the CSV files and the MCAP files."""
    rng = seeded(f"{seed} names")
    names = list(NAMES) if share == 1.0 else rng.sample(NAMES, max(4, round(share * len(NAMES))))
    names += [_FORMULA[n % 2] + _made_up(rng) for n in range(max(2, round(MADE_UP * share)))]
    checks = {"table": table, "messages": messages, "CSV": tables, "MCAP": mcaps}
    return [Case(f"{place}: {name[:30]!a}", partial(check, name)) for name in names for place, check in checks.items()]


def _made_up(rng: Random) -> str:
    """Letters with one character of every harmful kind between them."""
    parts = [rng.choice(kind) for kind in _KINDS] + [rng.choice("abcXYZ_") for _ in range(6)]
    rng.shuffle(parts)
    return "".join(parts)


def table(name: str, folder: Path) -> Verdict:
    """``mcl info``, as text and as JSON."""
    path = write(folder, name)
    plain, structured = mcl("info", path), mcl("info", path, "--json")
    problems = unclean(plain) + unclean(structured)
    topics = {topic["topic"] for topic in json.loads(structured.out)["topics"]}
    if f"/{name}" not in topics:
        problems.append((WRONG, f"JSON lacks the topic: {sorted(topics)}"))
    if len(plain.out.splitlines()) > 25:
        problems.append((WRONG, "a name breaks the lines of the table"))
    return Verdict(problems, {})


def messages(name: str, folder: Path) -> Verdict:
    """What ``mcl run`` and others say, of good and of impossible wishes; records of the library as well."""
    path = write(folder, name)
    problems: list[tuple[str, str]] = []
    topic = f"/{name}".replace("\0", "")
    for words in (
        ("run", path, "--map", folder / "room.yaml", "--init", content.INIT, "--particles", 20, "-v"),
        ("run", path, "--map", folder / "room.yaml", "--scan", topic),
        ("run", path, "--map", folder / "room.yaml", "--odom", topic, "--set", f"{name}=1"),
        ("run", path, "--map", folder / "room.yaml", "--init", name, "--set", "base_frame_id=nowhere"),
        ("extract", path, "--topic", topic),
        ("score", path, "--map", folder / name.replace("/", "").replace("\0", "")[:99]),
        ("recover", path, "-o", folder / "good.mcap"),
        (name.replace("\0", ""),),
    ):
        problems += unclean(mcl(*words))
    logging.getLogger("mclcli").handlers.clear()
    return Verdict(problems, {})


def tables(name: str, folder: Path) -> Verdict:
    """Fields of CSV files that come from elsewhere."""
    path = write(folder, name)
    stream = io.StringIO(newline="")
    csv.writer(stream).writerows([["x", "y", "yaw", "note"], ["1.5", "0", "1.57", name.replace("\0", "")]])
    (folder / "poses.csv").write_text(stream.getvalue(), newline="")
    scored = mcl("score", path, "--map", folder / "room.yaml", "--poses", folder / "poses.csv", "-o", folder / "s.csv")
    ran = mcl(
        "run", path, "--map", folder / "room.yaml", "--init", content.INIT, "--particles", 20, "-o", folder / "t.csv"
    )
    problems = unclean(scored) + unclean(ran)
    for made in ("s.csv", "t.csv"):
        if (folder / made).exists():
            text = (folder / made).read_bytes().decode()
            metadata = [line for line in text.split("\n") if line.startswith("#")]
            problems += said("".join(metadata))
            lines = text[sum(len(line) + 1 for line in metadata) :]
            problems += [
                (WRONG, f"{made}: {field!r}")
                for row in csv.reader(io.StringIO(lines, newline=""))
                for field in row
                if _is_formula(field)
            ]
    return Verdict(problems, {"files": 2})


def mcaps(name: str, folder: Path) -> Verdict:
    """Names in traces and in what is recovered: as they were, in files that open."""
    path = write(folder, name)
    words = ("--map", folder / "room.yaml", "--init", content.INIT, "--particles", 20, "-o", folder / "t.mcap")
    problems = unclean(mcl("run", path, *words)) + unclean(mcl("recover", path, "-o", folder / "good.mcap"))
    for made in ("t.mcap", "good.mcap"):
        with (folder / made).open("rb") as file:
            topics = {channel.topic for _, channel, _ in make_reader(file, validate_crcs=True).iter_messages()}
        if made == "good.mcap" and f"/{name}" not in topics:
            problems.append((WRONG, f"{sorted(topics)}"))
    return Verdict(problems, {"files": 2})


def write(folder: Path, name: str) -> Path:
    """The drive with this name as topic of the notes, as frame of the laser, and as a type."""
    (folder / "room.pgm").write_bytes(content.room())
    (folder / "room.yaml").write_text(content.MAP_YAML)
    path = folder / f"{name.replace('/', '').replace(chr(0), '')[:40]}.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="ros2")
        channels: dict[str, int] = {}
        for known in content.messages("cdr"):
            if known.topic not in channels:
                kind = content.TYPES[known.topic]
                schema = writer.register_schema(kind, "ros2msg", content.definition("cdr", kind)[0].encode())
                topic = known.topic if known.topic != "/note" else f"/{name}"
                channels[known.topic] = writer.register_channel(topic, "cdr", schema)
            writer.add_message(channels[known.topic], known.log_ns, _renamed(known, name), known.log_ns)
        odd = writer.register_channel("/odd", name, writer.register_schema(name, name, name.encode()))
        writer.add_message(odd, content.START_NS, b"", content.START_NS)
        writer.finish()  # type: ignore[no-untyped-call]
    return path


def _renamed(known: content.Known, name: str) -> bytes:
    """Message with the frame of the laser renamed."""
    if known.topic not in {"/scan", "/tf_static"}:
        return known.data
    kind = content.TYPES[known.topic]
    message: Any = STORE.deserialize_cdr(known.data, kind)
    if known.topic == "/scan":
        message.header.frame_id = name
    else:
        message.transforms[0].child_frame_id = name
    return bytes(STORE.serialize_cdr(message, kind))


def _is_formula(field: str) -> bool:
    if not field.startswith(("=", "+", "-", "@", "\t", "\r")):
        return False
    try:
        float(field)
    except ValueError:
        return True
    return False
