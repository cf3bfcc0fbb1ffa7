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
from tests.io.logs import seeded

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path
    from random import Random

GIB = 1 << 30
MAP = "image: m.{}\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.25\n"


def cases(seed: int, share: float) -> list[Case]:
    """All bombs, or those that are quick to make; their sizes, fillings and places are the seed's."""
    found = [
        Case(f"log: {name}", partial(_log, whole), partial(_made, make, f"{seed} {name}"))
        for name, (whole, make) in LOGS.items()
    ]
    found += [Case(f"map: {name}", _map, partial(_made, make, f"{seed} {name}")) for name, make in MAPS.items()]
    found += [Case(f"text: {name}", partial(_text, name, make, f"{seed} {name}")) for name, make in TEXTS.items()]
    return found if share == 1.0 else found[8:]  # the larger ones take a minute to make


def _made(make: Callable[[Random, Path], Path], seed: str, folder: Path) -> Path:
    return make(seeded(seed), folder)


def _nearly(size: int, rng: Random) -> int:
    """A size that is up to a sixteenth smaller."""
    return size - rng.randrange(1 + (size >> 4))


def _filling(rng: Random, size: int) -> bytes:
    """One byte again and again."""
    return bytes([rng.randrange(256)]) * size


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


def _text(name: str, make: Callable[[Random], str], seed: str, folder: Path) -> Verdict:
    """A scan, parameters or poses are refused."""
    (folder / "x").write_text(make(seeded(seed)))
    (folder / "m.pgm").write_bytes(content.room())
    (folder / "m.yaml").write_text(MAP.format("pgm"))
    words = ("score", folder / "x") if "scan" in name else ("params", "--params", folder / "x")
    result = mcl(*words, *(("--map", folder / "m.yaml", "--pose", "1,1,0") if "scan" in name else ()))
    problems = unclean(result)
    if result.code not in {1, 2}:
        problems.append((WRONG, f"{words[0]} ended with {result.code}"))
    return Verdict(problems, {})


def _mcap(compression: str, most: int, count: int, rng: Random, folder: Path) -> Path:
    """Chunks of one byte, said to be what they are."""
    size = _nearly(most, rng)
    pack = zstandard.ZstdCompressor(9).compress if compression == "zstd" else lz4.frame.compress
    # One message of the drive's topic /note that fills the chunk.
    head = struct.pack("<BQ", r.MESSAGE, size - 9) + struct.pack("<HIQQ", 5, 0, content.START_NS, content.START_NS)
    plain = head + _filling(rng, size - len(head))
    bomb = r.chunk(plain, compression, pack(plain))
    return _file(folder / "x.mcap", r.beside(rng, *[bomb] * count))


def _bag(most: int, rng: Random, folder: Path) -> Path:
    import bz2

    size = _nearly(most, rng)
    packed = bz2.compress(_filling(rng, size))
    declared = struct.pack("<I", size)
    chunk = r.bag_record(packed, op=b"\5", compression=b"bz2", size=declared)
    return _file(folder / "x.bag", r.bag_beside(rng, chunk))


def _zeros(size: int, start: bytes, rng: Random) -> bytes:
    """A zstd frame of ``start`` and one byte."""
    packer = zstandard.ZstdCompressor(3).compressobj()
    parts = [packer.compress(start)]
    block = _filling(rng, 1 << 24)
    parts += [packer.compress(block) for _ in range(size >> 24)]
    return b"".join([*parts, packer.flush()])


def _packed(start: Callable[[], bytes], name: str, rng: Random, folder: Path) -> Path:
    return _file(folder / name, _zeros(_nearly(4 * GIB, rng), start(), rng))


def _blobs(rng: Random, folder: Path) -> Path:
    """A database with a table whose content SQLite would make up."""
    path = folder / "x.db3"
    path.write_bytes(db3_log())
    with contextlib.closing(sqlite3.connect(path)) as database:
        database.executescript(
            f"ALTER TABLE messages ADD COLUMN more BLOB AS (zeroblob({_nearly(900_000_000, rng)})) VIRTUAL;"
        )
    return path


def _sparse(rng: Random, folder: Path) -> Path:
    """A database said to have four thousand million pages."""
    raw = bytearray(db3_log())
    struct.pack_into(">I", raw, 28, _nearly(2**32 - 2, rng))
    return _file(folder / "x.db3", bytes(raw))


def _png(most: int, rng: Random, folder: Path) -> Path:
    width, height = _nearly(most, rng), _nearly(most, rng)

    def part(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    packer, block = zlib.compressobj(9), _filling(rng, 1 << 20)
    raster = b"".join(packer.compress(block) for _ in range(min(64, width * height >> 20))) + packer.flush()
    head = part(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0))
    (folder / "m.png").write_bytes(b"\x89PNG\r\n\x1a\n" + head + part(b"IDAT", raster) + part(b"IEND", b""))
    return _file(folder / "m.yaml", MAP.format("png").encode())


def _pgm(most: int, rng: Random, folder: Path) -> Path:
    (folder / "m.pgm").write_bytes(b"P5 %d %d 255\n\0" % (_nearly(most, rng), _nearly(most, rng)))
    return _file(folder / "m.yaml", MAP.format("pgm").encode())


def _yaml(text: Callable[[Random], str], rng: Random, folder: Path) -> Path:
    return _file(folder / "m.yaml", text(rng).encode())


def _file(path: Path, data: bytes) -> Path:
    path.write_bytes(data)
    return path


def _laughs(rng: Random) -> str:
    word, most = rng.choice(["lol", "7", "~"]), rng.randrange(8, 15)
    lines = [f"a0: &a0 [{', '.join([word] * 9)}]"]
    lines += [f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 9)}]" for n in range(1, most)]
    return "\n".join(lines) + "\n"


LOGS: dict[str, tuple[int, Callable[[Random, Path], Path]]] = {
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
MAPS: dict[str, Callable[[Random, Path], Path]] = {
    "a PNG of 60,000 × 60,000 pixels": partial(_png, 60_000),
    "a PGM of 4,000,000,000 × 4,000,000,000 pixels": partial(_pgm, 4_000_000_000),
    "a YAML of aliases": partial(_yaml, _laughs),
    "a YAML nested 30,000 deep": partial(_yaml, lambda rng: "a: " + rng.choice("[{") * _nearly(30_000, rng)),
}
TEXTS: dict[str, Callable[[Random], str]] = {
    "a scan nested 100,000 deep": lambda rng: rng.choice("[{") * _nearly(100_000, rng),
    "a JSON scan nested 100,000 deep": lambda rng: json.dumps({"ranges": 1})[:-2] + "[" * _nearly(100_000, rng),
    "parameters of aliases": _laughs,
}
