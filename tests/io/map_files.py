"""A small map for tests of its readers: YAML and image, each changed one thing at a time."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mclcli.io.maps.map_yaml import load_map

if TYPE_CHECKING:
    from pathlib import Path

    from mclcli.world.occupancy import OccupancyGrid

YAML = {
    "image": "m.pgm",
    "resolution": "0.05",
    "origin": "[-1.0, 2.0, 0.5]",
    "negate": "0",
    "occupied_thresh": "0.65",
    "free_thresh": "0.196",
}
# Two rows of three pixels, top row first: black, white, gray; white, white, black.
PIXELS = bytes([0, 254, 205, 254, 254, 0])
CELLS = [[0, 0, 100], [100, 0, -1]]
PGM = b"P5\n3 2\n255\n" + PIXELS


def write_map(folder: Path, picture: bytes = PGM, /, **changes: str | None) -> Path:
    """Map YAML with some keys changed (None drops one), and its image m.pgm."""
    (folder / "m.pgm").write_bytes(picture)
    values = {**YAML, **changes}
    path = folder / "m.yaml"
    path.write_text("".join(f"{key}: {value}\n" for key, value in values.items() if value is not None))
    return path


def load(folder: Path, picture: bytes = PGM, /, **changes: str | None) -> OccupancyGrid:
    return load_map(write_map(folder, picture, **changes))
