"""Small files that would like to be large ones."""

from __future__ import annotations

import contextlib
import json
import sqlite3
import struct
import zlib
from functools import partial
from typing import TYPE_CHECKING

import lz4.frame
import zstandard

from mclcli.io.logs import open_log
from mclcli.io.logs.base import Tally
from tests.battery import content
from tests.battery import records as r
from tests.battery.bases import db3_log
from tests.battery.harness import LOSS, WRONG, Case, Verdict
from tests.battery.outcome import unclean
from tests.cli.support import mcl

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

GIB = 1 << 30
MAP = "image: m.{}\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.25\n"


def cases(seed: int, share: float) -> list[Case]:
    """All bombs, or those that are quick to make."""
    del seed
    found = [Case(f"log: {name}", partial(_log, whole), make) for name, (whole, make) in LOGS.items()]
    found += [Case(f"map: {name}", _map, make) for name, make in MAPS.items()]
    found += [Case(f"text: {name}", partial(_text, name, make)) for name, make in TEXTS.items()]
    return found if share == 1.0 else found[8:]  # the larger ones take a minute to make


def _log(whole: int, folder: Path) -> Verdict:
    """A log is read as far as it is honest (``whole`` messages), and the rest is said to be lost."""
    (path,) = folder.iterdir()
    info, recovered = mcl("info", path), mcl("recover", path, "-o", folder / "good.mcap")
    problems = unclean(info) + unclean(recovered)
    if info.code != (0 if whole == 314 else 3):
        problems.append((LOSS, f"info ended with {info.code}"))
    count = sum(1 for _ in open_log([path]).messages(None, Tally(), announce=False))
    if count < whole:
        problems.append((LOSS, f"{count} messages of {whole} came out"))
    return Verdict(problems, {})


def _map(folder: Path) -> Verdict:
    """A map is refused."""
    result = mcl("dt", folder / "m.yaml", "--no-cache")
    problems = unclean(result)
    if result.code not in {1, 2}:
        problems.append((WRONG, f"dt ended with {result.code}"))
    return Verdict(problems, {})


def _text(name: str, make: Callable[[], str], folder: Path) -> Verdict:
    """A scan, parameters or poses are refused."""
    (folder / "x").write_text(make())
    (folder / "m.pgm").write_bytes(content.room())
    (folder / "m.yaml").write_text(MAP.format("pgm"))
    words = ("score", folder / "x") if "scan" in name else ("params", "--params", folder / "x")
    result = mcl(*words, *(("--map", folder / "m.yaml", "--pose", "1,1,0") if "scan" in name else ()))
    problems = unclean(result)
    if result.code not in {1, 2}:
        problems.append((WRONG, f"{words[0]} ended with {result.code}"))
    return Verdict(problems, {})


def _mcap(compression: str, size: int, count: int, folder: Path) -> Path:
    """Chunks of zeros, said to be what they are."""
    pack = zstandard.ZstdCompressor(9).compress if compression == "zstd" else lz4.frame.compress
    # One message of the drive's topic /note that fills the chunk.
    head = struct.pack("<BQ", r.MESSAGE, size - 9) + struct.pack("<HIQQ", 5, 0, content.START_NS, content.START_NS)
    plain = head + bytes(size - len(head))
    bomb = r.chunk(plain, compression, pack(plain))
    return _file(folder / "x.mcap", r.mcap(r.drive(), *[bomb] * count))


def _bag(size: int, folder: Path) -> Path:
    import bz2

    packed = bz2.compress(bytes(size))
    declared = struct.pack("<I", size)
    chunk = r.bag_record(packed, op=b"\5", compression=b"bz2", size=declared)
    return _file(folder / "x.bag", r.bag(r.bag_drive(), chunk))


def _zeros(size: int, start: bytes) -> bytes:
    """A zstd frame of ``start`` and zeros."""
    packer = zstandard.ZstdCompressor(3).compressobj()
    parts = [packer.compress(start)]
    parts += [packer.compress(bytes(1 << 24)) for _ in range(size >> 24)]
    return b"".join([*parts, packer.flush()])


def _packed(start: Callable[[], bytes], name: str, folder: Path) -> Path:
    return _file(folder / name, _zeros(4 * GIB, start()))


def _blobs(folder: Path) -> Path:
    """A database with a table whose content SQLite would make up."""
    path = folder / "x.db3"
    path.write_bytes(db3_log())
    with contextlib.closing(sqlite3.connect(path)) as database:
        database.executescript("ALTER TABLE messages ADD COLUMN more BLOB AS (zeroblob(900000000)) VIRTUAL;")
    return path


def _sparse(folder: Path) -> Path:
    """A database said to have four thousand million pages."""
    raw = bytearray(db3_log())
    struct.pack_into(">I", raw, 28, 2**32 - 2)
    return _file(folder / "x.db3", bytes(raw))


def _png(width: int, height: int, folder: Path) -> Path:
    def part(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    packer = zlib.compressobj(9)
    raster = b"".join(packer.compress(bytes(1 << 20)) for _ in range(min(64, width * height >> 20))) + packer.flush()
    head = part(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0))
    (folder / "m.png").write_bytes(b"\x89PNG\r\n\x1a\n" + head + part(b"IDAT", raster) + part(b"IEND", b""))
    return _file(folder / "m.yaml", MAP.format("png").encode())


def _pgm(head: bytes, folder: Path) -> Path:
    (folder / "m.pgm").write_bytes(head)
    return _file(folder / "m.yaml", MAP.format("pgm").encode())


def _yaml(text: Callable[[], str], folder: Path) -> Path:
    return _file(folder / "m.yaml", text().encode())


def _file(path: Path, data: bytes) -> Path:
    path.write_bytes(data)
    return path


def _laughs() -> str:
    lines = ["a0: &a0 [lol, lol, lol, lol, lol, lol, lol, lol, lol]"]
    lines += [f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 9)}]" for n in range(1, 12)]
    return "\n".join(lines) + "\n"


LOGS: dict[str, tuple[int, Callable[[Path], Path]]] = {
    "one zstd chunk of 250 MiB in 8 KiB": (314, partial(_mcap, "zstd", 250 << 20, 1)),
    "one zstd chunk of 1 GiB": (313, partial(_mcap, "zstd", GIB, 1)),
    "one lz4 chunk of 250 MiB": (314, partial(_mcap, "lz4", 250 << 20, 1)),
    "a thousand zstd chunks of 64 MiB": (313, partial(_mcap, "zstd", 64 << 20, 1000)),
    "a bz2 chunk of 250 MB in a bag": (313, partial(_bag, 250_000_000)),
    "a bz2 chunk of 1 GB in a bag": (313, partial(_bag, 1_000_000_000)),
    "4 GiB in a .mcap.zstd": (313, partial(_packed, lambda: r.mcap(r.drive()), "x.mcap.zstd")),
    "4 GiB in a .db3.zstd": (313, partial(_packed, db3_log, "x.db3.zstd")),
    "computed blobs in a database": (0, _blobs),
    "a database of 16 TiB": (313, _sparse),
}
MAPS: dict[str, Callable[[Path], Path]] = {
    "a PNG of 60,000 × 60,000 pixels": partial(_png, 60_000, 60_000),
    "a PGM of 4,000,000,000 × 4,000,000,000 pixels": partial(_pgm, b"P5 4000000000 4000000000 255\n\0"),
    "a YAML of aliases": partial(_yaml, _laughs),
    "a YAML nested 30,000 deep": partial(_yaml, lambda: "a: " + "[" * 30_000),
}
TEXTS: dict[str, Callable[[], str]] = {
    "a scan nested 100,000 deep": lambda: "[" * 100_000,
    "a JSON scan nested 100,000 deep": lambda: json.dumps({"ranges": 1})[:-2] + "[" * 100_000,
    "parameters of aliases": _laughs,
}
