from __future__ import annotations

import random
import struct
import warnings
import zlib
from io import BytesIO
from typing import TYPE_CHECKING

import numpy as np
import pytest
from PIL import Image

from mclcli.errors import InputError, MclError
from mclcli.io.maps import netpbm
from mclcli.io.maps.map_yaml import load_map
from tests.data import shared
from tests.io.map_files import CELLS, PGM, PIXELS, load, write_map

if TYPE_CHECKING:
    from pathlib import Path


def _refused(folder: Path, picture: bytes) -> str:
    with pytest.raises(InputError) as caught:
        load(folder, picture)
    assert str(caught.value).startswith(f"{folder / 'm.pgm'}: ")
    assert "\n" not in str(caught.value)
    return str(caught.value)


def _pillow(mode: str, form: str, pixels: bytes, **options: object) -> bytes:
    stream = BytesIO()
    Image.frombytes(mode, (3, 2), pixels).save(stream, form, **options)
    return stream.getvalue()


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def _png(depth: int, colour: int, *rows: bytes, width: int = 3, before: bytes = b"") -> bytes:
    header = struct.pack(">IIBBBBB", width, len(rows), depth, colour, 0, 0, 0)
    raster = zlib.compress(b"".join(b"\0" + row for row in rows))
    parts = _chunk(b"IHDR", header) + before + _chunk(b"IDAT", raster) + _chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + parts


def _interlaced(rows: list[bytes]) -> bytes:
    header = struct.pack(">IIBBBBB", 3, 2, 8, 0, 0, 0, 1)
    raster = zlib.compress(b"".join(b"\0" + row for row in rows))
    return b"\x89PNG\r\n\x1a\n" + _chunk(b"IHDR", header) + _chunk(b"IDAT", raster) + _chunk(b"IEND", b"")


RGB = bytes(value for pixel in PIXELS for value in (pixel, pixel, pixel))
DEEP = b"".join(struct.pack(">H", pixel * 257) for pixel in PIXELS)
PALETTE = _chunk(b"PLTE", bytes([205] * 3 + [254] * 3 + [0] * 3))
FORMATS = {
    "p5": PGM,
    "p5 with comments": b"P5 # a\n# b\n3 # c\n2\n#\n255\n" + PIXELS,
    "p5 of 16 bits": b"P5\n3 2\n65535\n" + DEEP,
    "p5 of maxval 100": b"P5 3 2 100\n" + bytes([0, 100, 80, 99, 99, 1]),
    "p2": b"P2\n3 2\n255\n0 254 205\n254 254 0\n",
    "p2 with comments, no last newline": b"P2 # x\n3 2 255 0 # one\n254\t205\r\n254\n\n254 000",
    "p2 of 16 bits": b"P2 3 2 1000 0 1000 803 1000 1000 0",
    "p6 named pgm": b"P6\n3 2\n255\n" + RGB,
    "p6 of 16 bits": b"P6\n3 2\n65535\n" + b"".join(DEEP[i : i + 2] * 3 for i in range(0, 12, 2)),
    "p3": b"P3 3 2 255 " + b" ".join(b"%d" % value for value in RGB),
    "png gray": _pillow("L", "PNG", PIXELS),
    "png gray, 16 bits": _png(16, 0, DEEP[:6], DEEP[6:]),
    "png colour": _pillow("RGB", "PNG", RGB),
    "png palette": _png(8, 3, b"\2\1\0", b"\1\1\2", before=PALETTE),
    "png palette of 2 bits": _png(2, 3, bytes([0b10010000]), bytes([0b01011000]), before=PALETTE),
    "png alpha": _pillow("RGBA", "PNG", b"".join(bytes([p, p, p, 255 if p != 205 else 0]) for p in PIXELS)),
    "png gray and alpha": _pillow("LA", "PNG", b"".join(bytes([p, 255 if p != 205 else 254]) for p in PIXELS)),
    "png, optimised": _pillow("L", "PNG", PIXELS, optimize=True),
    "bmp gray": _pillow("L", "BMP", PIXELS),
    "bmp colour": _pillow("RGB", "BMP", RGB),
}


INTERLACED = [b"\0", b"\xcd", b"\xfe", b"\xfe\xfe\0"]  # PIXELS by Adam7: passes 1, 4, 6 and 7 have a row each
FORMATS["png interlaced"] = _interlaced(INTERLACED)


@pytest.mark.parametrize("kind", FORMATS)
def test_every_format_draws_the_same_map(tmp_path: Path, kind: str) -> None:
    assert load(tmp_path, FORMATS[kind]).cells.tolist() == CELLS


def test_deep_samples_are_big_endian(tmp_path: Path) -> None:
    for image in (b"P5 2 1 65535 \xfe\x00\x00\xfe", _png(16, 0, b"\xfe\x00\x00\xfe", width=2)):
        assert load(tmp_path, image).cells.tolist() == [[0, 100]]


@pytest.mark.parametrize("size", range(1, 12))
def test_plain_images_are_read_in_pieces(tmp_path: Path, size: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(netpbm, "_PIECE", size)
    assert load(tmp_path, b"P2 # x\n3 2 255 0 # one\n254\t 205\r\n254\n\n254 000 \n").cells.tolist() == CELLS
    assert load(tmp_path, b"P1 3 2\n1 0 1\n010").cells.tolist() == [[0, 100, 0], [100, 0, 100]]


@pytest.mark.parametrize(
    ("image", "cells"),
    [
        (b"P4 3 2\n" + bytes([0b10100000, 0b01000000]), [[0, 100, 0], [100, 0, 100]]),
        (b"P1 3 2\n1 0 1\n010", [[0, 100, 0], [100, 0, 100]]),
        (_png(1, 0, bytes([0b01000000]), bytes([0b10100000])), [[0, 100, 0], [100, 0, 100]]),
    ],
)
def test_one_bit_images(tmp_path: Path, image: bytes, cells: list[list[int]]) -> None:
    assert load(tmp_path, image).cells.tolist() == cells


@pytest.mark.parametrize(("mode", "cell"), [("trinary", -1), ("scale", -1), ("raw", 0)])
@pytest.mark.parametrize(
    "image",
    [
        _png(8, 4, b"\0\xfe", width=1),
        _png(8, 0, b"\0", width=1, before=_chunk(b"tRNS", b"\0\0")),
        _png(16, 0, b"\0\0", width=1, before=_chunk(b"tRNS", b"\0\0")),
        _png(8, 3, b"\1", width=1, before=_chunk(b"PLTE", b"\1\1\1\0\0\0") + _chunk(b"tRNS", b"\xff\x80")),
    ],
    ids=["alpha", "transparent gray", "transparent gray, 16 bits", "palette"],
)
def test_what_is_not_opaque_is_unknown(tmp_path: Path, image: bytes, mode: str, cell: int) -> None:
    assert load(tmp_path, image, mode=mode).cells.tolist() == [[cell]]


def test_colours_become_gray_as_in_graphicsmagick(tmp_path: Path) -> None:
    """(306 R + 601 G + 117 B) / 1024, rounded down; to nearest, the last two would be 30 and 59."""
    image = b"P6 4 1 255 " + bytes([255, 0, 0, 0, 0, 255, 10, 40, 30, 0, 100, 0])
    assert load(tmp_path, image, mode="raw").cells.tolist() == [[76, 29, 29, 58]]


# --- damage


@pytest.mark.parametrize(
    ("image", "named"),
    [
        (PGM[:-1], "5 bytes of pixels where the header says 6"),
        (PGM + b"\xfe", "1 bytes more than the 6 bytes"),
        (PGM + b"\n\xfe", "2 bytes more than the 6 bytes"),
        (PGM[:-2] + b"\x80\0\n\n\xfe", "more than the 6 bytes"),
        (b"P5 3 2 255 " + b"\r\n\xfe\xcd\xfe\xfe\0", "every line end among its pixels is CRLF"),
        (b"P5 3 2 255 " + b"\r\n\xfe\xcd\xfe\xfe\0\r\n", "every line end among its pixels is CRLF"),
        (b"P5\r\n3 2\n255\n" + PIXELS + b"\n", "CRLF"),
        (b"P2 3 2 255 1 2 3 4 5 6 7\0", "more numbers than the 6"),
        (b"P2 3 2 255 1 2 3 4 5\0", "5 numbers where"),
        (b"P2 3 2 255 1 2 3\0 4 5 6", "among the numbers"),
        (b"P5\r\n3 2\r\n255\r\n" + PIXELS, "CRLF"),
        (PGM.replace(b"\n", b"\r\n"), "CRLF"),
        (b"P5\n3 2\n255\r\n" + PIXELS[1:], "CRLF"),
        (b"P5\n3 2\n255\n# made by hand\n" + PIXELS, "a comment after maxval"),
        (b"P5\n3 2\n255 # made by hand\n" + PIXELS, "a comment after maxval"),
        (b"P5\n3 2\n", "no maxval"),
        (b"P5\n3\n", "no width and height"),
        (b"P5\n-3 2\n255\n", "no width and height"),
        (b"P5\n0 2\n255\n", "0 × 2 pixels"),
        (b"P5\n3 2\n0\n" + PIXELS, "maxval 0"),
        (b"P5\n3 2\n65536\n" + PIXELS, "maxval 65536"),
        (b"P5\n3 2\n253\n" + PIXELS, "254, above maxval 253"),
        (b"P5\n3 2\n1000\n" + DEEP, "above maxval 1000"),
        (b"P2\n3 2\n255\n1 2 3 4 5", "5 numbers where the header says 6"),
        (b"P2\n3 2\n255\n1 2 3 4 5 6 7", "more numbers than the 6 the header says"),
        (b"P2\n3 2\n255\n1 2 3 4 5 256", "256, above maxval 255"),
        (b"P2\n3 2\n65535\n1 2 3 4 5 65536", "65536, above maxval 65535"),
        (b"P2\n3 2\n255\n1 2 3 4 5 4294967296", "more than 5 digits"),
        (b"P2\n3 2\n255\n1 2 3 4 5 -6", "b'-' among the numbers"),
        (b"P2\n3 2\n255\n1 2 3 4 5 6.0", "b'.' among the numbers"),
        (b"P1\n3 2\n1 0 1 0 1 2", "2, above maxval 1"),
        (b"P1\n3 2\n1 0 1 0 1", "5 numbers where"),
        (b"P4\n3 2\n\x01", "1 bytes of pixels where the header says 2"),
        (b"P6\n3 2\n255\n" + RGB[:-1], "17 bytes of pixels"),
        (b"", "empty"),
        (b"version https://git-lfs.github.com/spec/v1\noid sha256:0\n", "Git LFS pointer"),
        (b"<html><body>404</body></html>", "web page"),
        (b"GIF89a" + bytes(20), "not an image in PGM"),
        (b"P7\nWIDTH 3\n", "not an image in PGM"),
        (b"BM", "cut off in its header"),
        (b"\x89PNG\r\n\x1a\n", "cut off in its header"),
        (FORMATS["png gray"][:-5], "cut off after"),
        (FORMATS["png gray"][:50] + b"\xff" + FORMATS["png gray"][51:], "checksum"),
        (_png(8, 0, b"\0\0\0", b"\0\0"), "7 bytes of pixels instead of the 8"),
        (_interlaced(INTERLACED[:3]), "6 bytes of pixels instead of the 10"),
        (_png(8, 0, b"\0\0\0", b"\0\0\0\0"), "more than the 8 bytes"),
        (_png(8, 0, b"\0\0\0", b"\0\0\0").replace(b"IDAT", b"IDAX"), "checksum"),
        (_png(8, 3, b"\0\1\2", b"\0\1\2"), "a colour beyond its palette"),
        (_png(8, 3, b"\0\1\3", b"\0\1\2", before=PALETTE), "a colour beyond its palette"),
        (_png(3, 0, b"\0\0\0"), "damaged image"),
        (FORMATS["bmp colour"][:-1], "damaged image"),
    ],
)
def test_damaged_images_are_refused(tmp_path: Path, image: bytes, named: str) -> None:
    assert named in _refused(tmp_path, image)


@pytest.mark.parametrize("kind", ["p5", "p2", "p4", "png gray", "png palette", "png alpha", "bmp gray", "bmp colour"])
def test_no_damage_escapes_or_shifts_pixels(tmp_path: Path, kind: str) -> None:
    """Cuts, flips and insertions: a map of another shape, a warning or another exception never comes out."""
    rng = random.Random(len(kind))  # noqa: S311 - not for secrets
    valid = FORMATS.get(kind, b"P4\n3 2\n\xa0\x40")
    for _ in range(80):
        data = bytearray(valid)
        place = rng.randrange(len(data))
        match rng.randrange(4):
            case 0:
                del data[place:]
            case 1:
                data[place] ^= 1 << rng.randrange(8)
            case 2:
                data[place:place] = rng.randbytes(3)
            case _:
                data[place : place + 4] = b"\xff\xff\xff\xff"
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            try:
                grid = load_map(write_map(tmp_path, bytes(data)), max_cells=10_000)
            except MclError as error:
                assert "\n" not in str(error)  # noqa: PT017 - the message is what matters
            else:
                assert grid.cells.size <= 10_000


TAILS = {
    "a line end": (b"\n", "(1, line ends)"),
    "CRLF": (b"\r\n", "(2, line ends)"),
    "a zero": (b"\0", "(1, zeros)"),
    "a block of zeros": (b"\n" + bytes(500), "(501, line ends and zeros)"),
    "a blank and the end mark of DOS": (b" \x1a", "(2, blanks)"),
    "another image": (b"\n" + PGM, f"({len(PGM) + 1}, another image)"),
    "another image, without a line end": (b"P2 # again\n1 1\n9\n5", "another image)"),
}


@pytest.mark.parametrize("tail", TAILS)
@pytest.mark.parametrize("kind", FORMATS)
def test_what_follows_the_last_pixel_is_passed_over_with_a_warning(
    tmp_path: Path, kind: str, tail: str, caplog: pytest.LogCaptureFixture
) -> None:
    data, told = TAILS[tail]
    assert load(tmp_path, FORMATS[kind] + data).cells.tolist() == CELLS
    if FORMATS[kind][:2] in {b"P2", b"P3"} and not data.strip(b"\r\n"):
        assert not caplog.records, "white space ends a text"
        return
    record = caplog.records[0]  # gray 205 with alpha draws another
    assert record.levelname == "WARNING"
    assert record.getMessage().startswith(f"{tmp_path / 'm.pgm'}: bytes follow the last pixel (")
    if FORMATS[kind][:2] not in {b"P2", b"P3"} and FORMATS[kind][:1] == b"P":
        assert told in record.getMessage()


@pytest.mark.parametrize("image", [b"P4\n3 2\n\xa0\x40", b"P1\n3 2\n101010"])
@pytest.mark.parametrize("tail", [b"\n\0", b"\r\n\0", b"\0", b"P4\n1 1\n\0"])
def test_bitmaps_too(tmp_path: Path, image: bytes, tail: bytes, caplog: pytest.LogCaptureFixture) -> None:
    assert load(tmp_path, image + tail).cells.tolist() == [[0, 100, 0], [100, 0, 100]]
    assert "bytes follow the last pixel" in caplog.text


@pytest.mark.parametrize("kind", ["png gray", "bmp gray"])
def test_anything_may_follow_where_the_file_says_how_long_it_is(
    tmp_path: Path, kind: str, caplog: pytest.LogCaptureFixture
) -> None:
    assert load(tmp_path, FORMATS[kind] + b"\xfe\0made by x").cells.tolist() == CELLS
    assert "(11, of another kind)" in caplog.text


def test_a_lone_line_end_among_pixels_is_a_gray_value(tmp_path: Path) -> None:
    """Pixels of 13 and 10 as in a map of many grays: not every 10 follows a 13, so nothing was converted."""
    pixels = bytes([13, 10, 10, 254, 254, 0])
    assert load(tmp_path, b"P5 3 2 255 " + pixels + b"\n").cells.tolist() == [[0, 0, 100], [100, 100, 100]]


# --- bounds


@pytest.mark.parametrize(
    "image",
    [
        b"P5\n100000 100000\n255\n",
        b"P2 1000000000 9999999999 255 ",
        b"\x89PNG\r\n\x1a\n" + _chunk(b"IHDR", struct.pack(">IIBBBBB", 100_000, 100_000, 8, 0, 0, 0, 0)),
        b"BM" + bytes(12) + struct.pack("<Iii", 40, 100_000, -100_000) + bytes(30),
    ],
)
def test_the_header_is_believed_before_anything_is_decoded(tmp_path: Path, image: bytes) -> None:
    text = _refused(tmp_path, image)
    assert "more than 64000000 cells" in text
    assert "--max-cells 10000000000 " in text or "--max-cells 9999999999000000000 " in text


def test_max_cells_is_a_limit_not_a_hint(tmp_path: Path) -> None:
    path = write_map(tmp_path)
    assert load_map(path, max_cells=6).cells.size == 6
    with pytest.raises(InputError, match="3 × 2 pixels, more than 5 cells; give --max-cells 6"):
        load_map(path, max_cells=5)


def test_large_images_need_no_pillow_limit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Pillow warns from 89 million pixels on, and refuses beyond twice that; both are lowered here."""
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 2)
    assert load(tmp_path, FORMATS["png gray"]).cells.tolist() == CELLS


# --- images of real maps


@pytest.mark.parametrize(
    ("name", "shape", "counts"),
    [
        ("pillow_pnm/hopper_8bit.pgm", (128, 128), None),
        ("pillow_pnm/hopper_16bit.pgm", (128, 128), None),
        ("pillow_pnm/hopper_1bit.pbm", (128, 128), None),
        ("ros1_map_server_test/testmap.bmp", (10, 10), (71, 29)),
        ("ros1_map_server_test/spectrum.png", (16, 16), None),
        ("nav2_map_server_test/testmap.pgm", (10, 10), (71, 29)),
        ("nav2_system_tests/empty_room.pgm", (200, 200), None),
        ("nav2_system_tests/empty_room.png", (200, 200), None),
    ],
)
def test_images_without_a_yaml(
    tmp_path: Path, name: str, shape: tuple[int, int], counts: tuple[int, int] | None
) -> None:
    """They come out as what Pillow sees in them, pixel by pixel, or with the counts of their own YAML."""
    path = shared(f"maps/{name}")
    grid = load(tmp_path, path.read_bytes())
    assert grid.cells.shape == shape
    if counts is not None:
        assert (int(grid.free.sum()), int(grid.occupied.sum())) == counts
    with Image.open(path) as image:
        gray = np.asarray(image.convert("L") if image.mode in {"1", "RGB"} else image).astype(np.float64)
    share = 1.0 - gray / (65535.0 if gray.max() > 255 else 255.0)
    assert np.array_equal(grid.occupied[::-1], share >= 0.65)
    assert np.array_equal(grid.free[::-1], share <= 0.196)


def test_a_plain_image_is_its_binary_twin(tmp_path: Path) -> None:
    plain = load(tmp_path, shared("maps/pillow_pnm/hopper_8bit_plain.pgm").read_bytes())
    binary = load(tmp_path, shared("maps/pillow_pnm/hopper_8bit.pgm").read_bytes())
    assert np.array_equal(plain.cells, binary.cells)


def test_the_same_room_from_png_and_pgm(tmp_path: Path) -> None:
    maps = [shared(f"maps/nav2_system_tests/empty_room.{suffix}").read_bytes() for suffix in ("pgm", "png")]
    assert np.array_equal(load(tmp_path, maps[0]).cells, load(tmp_path, maps[1]).cells)
