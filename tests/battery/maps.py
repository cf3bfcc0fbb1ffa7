"""Maps: the right grid or a refusal that names the file, never another grid."""

from __future__ import annotations

import io
import struct
import zlib
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image

from mclcli.errors import MclError
from mclcli.io.maps.map_yaml import load_map
from tests.battery.harness import WRONG, Case, Verdict
from tests.battery.outcome import said, unclean
from tests.cli.support import mcl
from tests.io.logs import seeded

if TYPE_CHECKING:
    import random
    from collections.abc import Iterator
    from pathlib import Path

    from numpy.typing import NDArray

    Pixels = NDArray[np.uint8]

WIDTH, HEIGHT = 37, 23
GRAYS = (0, 254, 205)
CELLS = {0: 100, 254: 0, 205: -1}
KEYS = {
    "image": "m.pgm",
    "resolution": "0.05",
    "origin": "[-1.5, 2.5, 0.0]",
    "negate": "0",
    "occupied_thresh": "0.65",
    "free_thresh": "0.196",
}


def cases(seed: int, share: float) -> list[Case]:
    """All maps, healthy and damaged."""
    pixels = picture(seeded(f"{seed} maps"))
    found = [Case(f"whole: {name}", partial(check, data, {}, pixels, None)) for name, data in encodings(pixels).items()]
    for name, data in _damaged(pixels, seeded(f"{seed} map damage")):
        found.append(Case(f"damaged: {name}", partial(check, data, {}, pixels, 1)))
    for number, (changes, code) in enumerate(YAMLS):
        name = f"yaml {number}: {changes or 'as it is'}"
        found.append(Case(name, partial(check, pgm(pixels), changes, pixels, code)))
    return found[:: max(1, round(0.4 / share))] if share < 0.4 else found


def check(data: bytes, changes: dict[str, str | None], pixels: Pixels, code: int | None, folder: Path) -> Verdict:
    """Load one map; ``code`` is that of its refusal, None where it is whole."""
    (folder / "m.pgm").write_bytes(data)
    values = {**KEYS, **changes}
    text = "".join(f"{key}: {value}\n" for key, value in values.items() if value is not None)
    (folder / "m.yaml").write_text(text)
    problems = unclean(mcl("dt", folder / "m.yaml", "--no-cache"))
    try:
        grid = load_map(folder / "m.yaml")
    except MclError as error:
        problems += said(str(error))
        if error.exit_code != code:
            problems.append((WRONG, f"refused with {error.exit_code} instead of {code}: {error}"))
        if str(folder) not in str(error) or "\n" in str(error):
            problems.append((WRONG, f"does not name the file in one line: {error}"))
        return Verdict(problems, {"refused": 1})
    expected = np.vectorize(CELLS.get)(pixels)[::-1]
    if not np.array_equal(grid.cells, expected):
        problems.append((WRONG, f"{int((grid.cells != expected).sum())} cells are not as drawn"))
    elif code is not None:
        problems.append((WRONG, "loaded, although it is damaged"))
    return Verdict(problems, {"right": 1})


def picture(rng: random.Random) -> Pixels:
    """Gray values (H, W) that no shift by a pixel leaves alone; the last is white.

    A black one that was pushed out could not be told from a zero after the pixels.
    """
    pixels = np.array([[rng.choice(GRAYS) for _ in range(WIDTH)] for _ in range(HEIGHT)], np.uint8)
    pixels[-1, -1] = 254
    return pixels


def pgm(pixels: Pixels) -> bytes:
    """Plain P5."""
    return b"P5\n%d %d\n255\n" % (WIDTH, HEIGHT) + pixels.tobytes()


def encodings(pixels: Pixels) -> dict[str, bytes]:
    """The same picture in all ways that are taken."""
    size, flat = b"%d %d" % (WIDTH, HEIGHT), pixels.ravel().tolist()
    wide = (pixels.astype(np.uint32) * 257).astype(">u2").tobytes()
    found = {
        "P5": pgm(pixels),
        "P5 with comments": b"P5\n# by hand\n" + size + b"\n# more\n255\n" + pixels.tobytes(),
        "P5 on one line": b"P5 " + size + b" 255 " + pixels.tobytes(),
        "P5 with a line end": pgm(pixels) + b"\n",
        "P5 with zeros": pgm(pixels) + bytes(9),
        "P5 twice": pgm(pixels) * 2,
        "P5 of 16 bits": b"P5\n" + size + b"\n65535\n" + wide,
        "P2": b"P2\n" + size + b"\n255\n" + b" ".join(b"%d" % value for value in flat),
        "P2 with CRLF": b"P2\r\n" + size + b"\r\n255\r\n" + b"\r\n".join(b"%d" % value for value in flat),
        "P2 of maxval 10,000": b"P2 "
        + size
        + b" 10000 "
        + b" ".join(b"%d" % round(value / 255 * 1e4) for value in flat),
        "P6": b"P6\n" + size + b"\n255\n" + np.repeat(pixels, 3).tobytes(),
        "P3": b"P3\n" + size + b"\n255\n" + b" ".join(b"%d %d %d" % (value, value, value) for value in flat),
    }
    gray = Image.fromarray(pixels)
    for name, image, form, options in (
        ("PNG", gray, "PNG", {}),
        ("PNG, optimised", gray, "PNG", {"optimize": True}),
        ("PNG of colours", gray.convert("RGB"), "PNG", {}),
        ("PNG with alpha", gray.convert("RGBA"), "PNG", {}),
        ("PNG with a palette", gray.convert("P"), "PNG", {}),
        ("PNG of 16 bits", Image.fromarray(pixels.astype(np.uint16) * 257), "PNG", {}),
        ("BMP", gray, "BMP", {}),
        ("BMP of colours", gray.convert("RGB"), "BMP", {}),
    ):
        stream = io.BytesIO()
        image.save(stream, form, **options)
        found[name] = stream.getvalue()
    return found


def _damaged(pixels: Pixels, rng: random.Random) -> Iterator[tuple[str, bytes]]:
    """Pictures with damage that can be told."""
    whole = encodings(pixels)
    for name in ("P5", "P5 of 16 bits", "P2", "P6", "PNG", "PNG with a palette", "BMP"):
        data = whole[name]
        yield f"{name} cut in the middle", data[: len(data) // 2]
        yield f"{name} cut by its last bytes", data[:-3]
        yield f"{name} cut in its header", data[:7]
    for name in ("P5", "P6", "P5 of 16 bits"):
        data, at = whole[name], rng.randrange(40, len(whole[name]))
        yield f"{name} without one byte", data[:at] + data[at + 1 :]
        yield f"{name} with one byte more", data[:at] + b"\xfe" + data[at:]
    raw = pgm(pixels)
    lined = b"P5 %d %d 255 " % (WIDTH, HEIGHT) + np.where(pixels == 205, 10, pixels).astype(np.uint8).tobytes()
    yield "P5 through a text editor", raw.replace(b"\n", b"\r\n")
    yield "P5 on one line through a text editor", lined.replace(b"\n", b"\r\n")
    yield "P5 in UTF-8", raw.decode("latin-1").encode()
    yield "P5 with a comment after maxval", raw.replace(b"255\n", b"255\n# late\n", 1)
    yield "P5 of maxval 0", raw.replace(b"255", b"0", 1)
    yield "P5 of maxval 65536", raw.replace(b"255", b"65536", 1)
    yield "P5 of maxval 200", raw.replace(b"255", b"200", 1)
    yield "P5 of width 0", raw.replace(b"37", b"0", 1)
    yield "P5 of negative width", raw.replace(b"37", b"-37", 1)
    yield "P5 of another width", raw.replace(b"37 23", b"23 38", 1)
    yield "P2 with a letter", whole["P2"].replace(b"254", b"2S4", 1)
    yield "P2 with a number too many", whole["P2"] + b" 0"
    yield "P2 with a large number", whole["P2"].replace(b"254", b"999", 1)
    png = whole["PNG"]
    for number in range(12):
        at = rng.randrange(8, len(png) - 12)
        yield f"PNG with a bit flipped {number}", png[:at] + bytes([png[at] ^ 1 << rng.randrange(8)]) + png[at + 1 :]
    raster = zlib.compress(b"".join(b"\0" + row.tobytes() for row in pixels[:-2]))
    head = png[: png.index(b"IDAT") - 4]
    chunk = struct.pack(">I", len(raster)) + b"IDAT" + raster + struct.pack(">I", zlib.crc32(b"IDAT" + raster))
    yield "PNG with rows missing", head + chunk + png[-12:]
    yield "nothing", b""
    yield "a Git LFS pointer", b"version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 1\n"
    yield "a web page", b"<!DOCTYPE html><html></html>"
    yield "a JPEG", b"\xff\xd8\xff\xe0\0\x10JFIF" + bytes(100)
    yield "a TIFF", b"II*\0" + bytes(100)
    yield "noise", rng.randbytes(900)


YAMLS: list[tuple[dict[str, str | None], int | None]] = [
    ({}, None),
    ({"resolution": "5e-2"}, None),
    ({"mode": "Trinary"}, None),
    ({"negate": "false"}, None),
    ({"resolution": "0"}, 2),
    ({"resolution": "-0.05"}, 2),
    ({"resolution": ".nan"}, 2),
    ({"resolution": ".inf"}, 2),
    ({"resolution": "1e-7"}, 2),
    ({"resolution": "1e30"}, 2),
    ({"resolution": "five"}, 2),
    ({"resolution": None}, 2),
    ({"origin": "[0, 0]"}, 2),
    ({"origin": "[.nan, 0, 0]"}, 2),
    ({"origin": "[1e300, 0, 0]"}, 2),
    ({"origin": "here"}, 2),
    ({"free_thresh": "0.7"}, 2),
    ({"free_thresh": "-0.1"}, 2),
    ({"occupied_thresh": "65"}, 2),
    ({"mode": "trinery"}, 2),
    ({"negate": "maybe"}, 2),
    ({"image": "../m.pgm"}, None),
    ({"image": "../none.pgm"}, 2),
    ({"image": "/etc/passwd"}, 2),
    ({"image": "none.pgm"}, 2),
    ({"image": '"a\\0b"'}, 2),
    ({"image": None}, 2),
    ({"more": "&a [*a]"}, 1),
    ({"more": "!!python/object/apply:os.system [false]"}, 1),
    ({"more": "{<<: {image: x}}"}, 1),
    ({"more": "[" * 20 + "]" * 20}, 1),
    ({"more": "x" * 70_000}, 1),
]
