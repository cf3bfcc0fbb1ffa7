"""Maps as nav2's map_server reads them: a YAML that names an image and says how to take its gray values."""

from __future__ import annotations

import logging
import re
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from mclcli.errors import InputError, UsageError
from mclcli.io.maps import doubts, image
from mclcli.io.maps.map_description import describe, wrong
from mclcli.io.tables import safe_yaml
from mclcli.text import clean
from mclcli.world.occupancy import FREE, OCCUPIED, UNKNOWN, OccupancyGrid

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mclcli.io.maps.map_description import MapDescription
    from mclcli.io.tables.safe_yaml import Document

MAX_CELLS = 64_000_000
_SUFFIXES = (".pgm", ".pbm", ".ppm", ".pnm", ".png", ".bmp", ".jpg", ".jpeg", ".gif", ".tif", ".tiff", ".webp")


def load_map(yaml_path: str | Path, *, max_cells: int = MAX_CELLS, allow_outside: bool = False) -> OccupancyGrid:
    """Load the map that a map_server YAML describes.

    Warnings tell of opacity, of bytes after the pixels, and of what can hardly be meant.

    Parameters
    ----------
    yaml_path
        The YAML; its ``image`` is looked for relative to the YAML's folder, then by its bare name beside the YAML.
    max_cells
        Most pixels an image may have; checked in its header, before it is decoded.
    allow_outside
        Whether the image may lie outside the YAML's folder, symbolic links followed.

    Raises
    ------
    UsageError
        If the YAML or its image does not exist, or a value in it is wrong, naming key and line.
    InputError
        If the YAML is not one, or the image is damaged, too large or not an image.

    """
    path = Path(yaml_path)
    document = _read_yaml(path)
    description = describe(document)
    where = _image_path(path, description.image, document, allow_outside=allow_outside)
    try:
        raster = image.read_image(where, max_cells)
    except OSError as error:
        raise InputError(f"{where}: cannot read: {error.strerror or error}; check the file") from error
    grid = OccupancyGrid(to_cells(raster, description), description.resolution, np.array(description.origin))
    doubts.tell_opacity(raster, description, grid.cells, str(where))
    doubts.tell(grid, description, document)
    return grid


def to_cells(raster: image.Raster, description: MapDescription) -> NDArray[np.int8]:
    """Cells (H, W) int8, row 0 at the bottom, by the rules of map_server.

    Pixels that are not opaque are unknown, except in mode raw.
    """
    table = rule(description, raster.maxval)
    if raster.gray.dtype == np.uint8:
        padded = np.full(256, UNKNOWN, np.int8)
        padded[: table.size] = table
        translated = raster.gray.tobytes().translate(padded.tobytes())
        cells = np.frombuffer(translated, np.int8).reshape(raster.gray.shape)
    else:
        cells = table[raster.gray]
    if raster.transparent is not None and description.mode != "raw":
        cells = np.where(raster.transparent, np.int8(UNKNOWN), cells)
    flipped = np.ascontiguousarray(cells[::-1])
    flipped.flags.writeable = False
    return flipped


def rule(description: MapDescription, maxval: int = 255) -> NDArray[np.int8]:
    """Cell value of every gray value 0…maxval, (maxval + 1,) int8.

    In float32, as map_server computes. With p = 1 − gray/maxval (gray/maxval if negated): p ≥ occupied_thresh is
    occupied, p ≤ free_thresh free (which wins), what lies between unknown or, in mode scale, 100·(p − free) /
    (occupied − free) rounded half away from zero. Mode raw takes the 8-bit gray value itself, up to 100.
    """
    gray = np.arange(maxval + 1)
    if description.mode == "raw":
        value = gray * 255 // maxval
        return np.where(value <= OCCUPIED, value, UNKNOWN).astype(np.int8)
    share = gray.astype(np.float32) / np.float32(maxval)
    p = share if description.negate else np.float32(1.0) - share
    high, low = np.float32(description.occupied_thresh), np.float32(description.free_thresh)
    cells = np.full(p.shape, UNKNOWN, np.int8)
    if description.mode == "scale":
        between = (p > low) & (p < high)
        scaled = (p[between] - low) / (high - low) * np.float32(100.0)
        cells[between] = np.floor(scaled.astype(np.float64) + 0.5)
    cells[p >= high] = OCCUPIED
    cells[p <= low] = FREE
    return cells


def _read_yaml(path: Path) -> Document:
    """YAML of a map; an image in its place is told apart before it is taken for broken YAML."""
    try:
        with path.open("rb") as stream:
            head = stream.read(16)
    except (OSError, ValueError):
        head = b""  # safe_yaml.read says what is wrong
    if image.is_image(head) or (head and path.suffix.lower() in _SUFFIXES):
        beside = next((p for p in (path.with_suffix(".yaml"), path.with_suffix(".yml")) if p.is_file()), None)
        hint = f"; give {beside}" if beside else " (image, resolution, origin…), which says how to read it"
        raise UsageError(f"{path}: is an image; a map is named by its YAML{hint}")
    return safe_yaml.read(path)


def _image_path(path: Path, name: str, document: Document, *, allow_outside: bool) -> Path:
    """Where the image lies; refused outside the YAML's folder, which is also where a link to the YAML leads.

    Where that cannot be used, a file of the same bare name beside the YAML is taken, and said: maps are copied from
    machine to machine, their YAML with the paths of the first one.
    """
    folders = (path.parent.resolve(), path.resolve().parent)
    try:
        where = (path.parent / name).resolve()
        exists, inside = where.is_file(), any(where.is_relative_to(folder) for folder in folders)
    except (OSError, ValueError, RuntimeError):  # a NUL, a name too long, links in a circle
        raise wrong("image", document, f"'{clean(name, 100)}' cannot be a file") from None
    if exists and (inside or allow_outside):
        return path.parent / name
    bare = re.split(r"[/\\]", name)[-1]
    for folder in folders:
        beside = folder / bare
        if beside.is_file() and any(beside.resolve().is_relative_to(home) for home in folders):
            what = "lies outside the YAML's folder (--allow-outside takes it)" if exists else "does not exist"
            text = "%s: image: '%s' %s, line %d; %s beside the YAML is used"
            logging.getLogger("mclcli").warning(
                text, document.name, clean(name, 100), what, document.line("image"), clean(bare, 100)
            )
            return beside
    if exists:
        raise wrong(
            "image", document, f"'{clean(name, 100)}' lies outside the YAML's folder (--allow-outside permits it)"
        )
    remedy = "put it beside the YAML, or correct the name"
    if bare and bare != name:
        remedy = f"put {clean(bare, 100)} beside the YAML"
    raise wrong("image", document, f"no such file '{clean(name, 100)}'", remedy)
