"""Images of maps as gray values: PGM, PBM, PPM by our own reading, PNG and BMP through Pillow.

The format is told by the first bytes, the size is read from the header and checked before anything is decoded, and
whatever is damaged is refused. Colours become gray as GraphicsMagick does it, which nav2's map_server uses: Rec. 601 in
integers, (306 R + 601 G + 117 B) / 1024 rounded down (source: its colorspace.h).
"""

from __future__ import annotations

import io
import struct
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.errors import InputError
from mclcli.io.maps import after_pixels, netpbm, png_check
from mclcli.io.tables.text_file import refuse_stand_ins

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray
    from PIL.Image import Image

    from mclcli.arrays import BoolArray
    from mclcli.io.maps.netpbm import Samples

_BMP = b"BM"
_HEAD = 1 << 16
_STRIP = 1 << 20  # pixels converted at a time


@final
@dataclass(frozen=True, slots=True, eq=False)
class Raster:
    """Gray values (H, W) uint8 or uint16 from 0 (black) to ``maxval``, row 0 at the top.

    ``transparent`` (H, W) marks the pixels that are not fully opaque; None if all are. ``sums`` (H, W) uint16 are red,
    green, blue and opacity, 255 each, added up; None without an alpha channel.
    """

    gray: Samples
    maxval: int
    transparent: BoolArray | None = None
    sums: NDArray[np.uint16] | None = None


def is_image(head: bytes) -> bool:
    """Whether a file that starts with these bytes is an image that ``read_image`` knows."""
    return netpbm.MAGIC.match(head) is not None or head.startswith((png_check.MAGIC, _BMP))


def read_image(path: str | Path, max_cells: int) -> Raster:
    """Read an image of at most ``max_cells`` pixels.

    Colour of 16 bits per channel is read to 8 in PNG; gray keeps its depth.

    Raises
    ------
    InputError
        If it is damaged, of another format, or has more pixels.
    OSError
        If it cannot be read.

    """
    name = str(path)
    with Path(path).open("rb") as stream:
        head = stream.read(_HEAD)
        if netpbm.MAGIC.match(head):
            header = netpbm.read_header(head, name)
            _check_size(header.width, header.height, max_cells, name)
            stream.seek(0)
            return _from_netpbm(header, stream.read(header.start + header.raster_size + _HEAD), name)
        width, height = _size(head, name)
        _check_size(width, height, max_cells, name)
        stream.seek(0)
        return _through_pillow(stream.read(8 * width * height + (1 << 24)), name)


def _size(head: bytes, name: str) -> tuple[int, int]:
    """Width and height [pixels] by the header of a PNG or BMP."""
    refuse_stand_ins(head, name)
    layout, start = "", 0
    if head.startswith(png_check.MAGIC):
        layout, start = ">II", 16
    elif head.startswith(_BMP):
        layout, start = ("<HH" if head[14:18] == b"\x0c\0\0\0" else "<ii"), 18
    if not layout:
        raise InputError(f"{name}: not an image in PGM, PBM, PPM, PNG or BMP format; convert it")
    try:
        width, height = struct.unpack_from(layout, head, start)
    except struct.error:
        raise InputError(f"{name}: damaged image: cut off in its header; copy it again") from None
    return width, abs(height)


def _check_size(width: int, height: int, max_cells: int, name: str) -> None:
    if width <= 0 or height <= 0:
        raise InputError(f"{name}: damaged image header: {width} × {height} pixels; copy it again")
    if width * height > max_cells:
        raise InputError(
            f"{name}: {width} × {height} pixels, more than {max_cells} cells; give --max-cells {width * height} to "
            "load it all the same"
        )


def _from_netpbm(header: netpbm.Header, data: bytes, name: str) -> Raster:
    samples = netpbm.samples(header, data, name)
    if header.kind in {1, 4}:
        return Raster(samples ^ np.uint8(1), 1)
    return Raster(_luma(samples) if header.channels == 3 else samples, header.maxval)


def _luma(rgb: Samples) -> Samples:
    """Gray (H, W) of colours (H, W, 3 or 4)."""
    height, width = rgb.shape[:2]
    gray = np.empty((height, width), rgb.dtype)
    for rows in _strips(height, width):
        r, g, b = (rgb[rows, :, channel].astype(np.uint32) for channel in range(3))
        gray[rows] = (306 * r + 601 * g + 117 * b) >> 10
    return gray


def _strips(height: int, width: int) -> Iterator[slice]:
    step = max(1, _STRIP // width)
    return (slice(row, min(row + step, height)) for row in range(0, height, step))


def _through_pillow(data: bytes, name: str) -> Raster:
    from PIL.BmpImagePlugin import BmpImageFile
    from PIL.PngImagePlugin import PngImageFile

    png = data.startswith(png_check.MAGIC)
    colours = png_check.check_png(data, name) if png else 0
    if not png:
        _check_bmp(data, name)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            # Not through Image.open: its limit on pixels is a global setting, and max_cells was checked already.
            image: Image = PngImageFile(io.BytesIO(data)) if png else BmpImageFile(io.BytesIO(data))
            image.load()
            raster = _raster(image)
        except Exception as error:
            raise InputError(f"{name}: damaged image: {type(error).__name__} on decoding; copy it again") from error
    if png and image.mode == "P" and int(np.asarray(image).max()) >= colours:
        raise InputError(f"{name}: damaged image: a pixel names a colour beyond its palette; copy it again")
    return raster


def _raster(image: Image) -> Raster:
    hidden = image.info.get("transparency")
    if image.mode.startswith("I"):
        gray = np.asarray(image).astype(np.uint16)
        if not isinstance(hidden, int):
            return Raster(gray, 65535)
        clear = gray == hidden
        return Raster(gray, 65535, clear, np.where(clear, 0, 255).astype(np.uint16) + 3 * (gray // 257))
    if image.mode in {"1", "L"} and hidden is None:
        return Raster(np.asarray(image.convert("L")), 255)
    gray = np.empty((image.height, image.width), np.uint8)
    transparent = np.zeros(gray.shape, np.bool_)
    alpha = hidden is not None or image.mode in {"LA", "PA", "RGBA"}
    sums = np.zeros(gray.shape, np.uint16) if alpha else None
    for rows in _strips(*gray.shape):
        strip = np.asarray(image.crop((0, rows.start, image.width, rows.stop)).convert("RGBA"))
        gray[rows] = _luma(strip)
        if sums is not None:
            transparent[rows] = strip[..., 3] < 255
            sums[rows] = strip.sum(axis=-1, dtype=np.uint16)
    return Raster(gray, 255, transparent if transparent.any() else None, sums)


def _check_bmp(data: bytes, name: str) -> None:
    """Check the file's length, where the header has it: Pillow takes a row without its last padding bytes."""
    length, _, pixels = struct.unpack_from("<III", data, 2)
    if length > len(data):
        raise InputError(f"{name}: damaged image: cut off after {len(data)} of {length} bytes; copy it again")
    if length > pixels:  # some writers leave it 0
        after_pixels.tell(memoryview(data)[length:], name)
