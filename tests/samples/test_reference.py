"""The files of the worked example reproduce its numbers, computed here from the equations alone."""

from __future__ import annotations

import csv
import heapq
import itertools
import math
from typing import TYPE_CHECKING

import numpy as np
import pytest
from ruamel.yaml import YAML

from tests.samples.naive import ROOT

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from mclcli.arrays import BoolArray, FloatArray

SIGMA, Z_HIT, Z_RAND, R_MAX, MAX_DIST = 0.15, 0.95, 0.05, 8.0, 2.0
SIGMA_B, EPS = math.radians(3), 0.1

LIDAR = {
    "set2": {
        "brushfire": [-15.49383560677658, -15.714564571949802, -20.708357111059797, -21.69195677610226],
        "exact": [-15.49383560677658, -15.714564571949722, -20.322874163746285, -21.30248252410169],
    },
    "set3": {
        "brushfire": [-15.417167898002397, -15.028881888128133, -11.991725681847718],
        "exact": [-15.049353224268536, -14.74528777092102, -11.692274262121142],
    },
}
VISION = [-2.6661197675024013, -2.306220471001957, -14.259227357457316, -14.223857278586806]
SUM_SET1 = [-58.09788422066158, -58.09596021851833, -58.07910227140370]


def occupied() -> BoolArray:
    head, size, maximum, pixels = (ROOT / "maps/reference.pgm").read_bytes().split(b"\n", 3)
    assert (head, size, maximum) == (b"P5", b"120 120", b"255")
    return np.asarray(np.frombuffer(pixels, dtype=np.uint8).reshape(120, 120)[::-1] == 0)


def exact_field(cells: BoolArray) -> FloatArray:
    rows, columns = np.nonzero(cells)
    y, x = np.mgrid[:120, :120]
    squared = (x[..., np.newaxis] - columns) ** 2 + (y[..., np.newaxis] - rows) ** 2
    return np.asarray(np.minimum(0.05 * np.sqrt(squared.min(axis=-1)), MAX_DIST))


def brushfire_field(cells: BoolArray) -> FloatArray:
    best = {(int(r), int(c)): 0.0 for r, c in np.argwhere(cells)}
    queue = [(0.0, cell) for cell in best]
    while queue:
        length, (row, column) = heapq.heappop(queue)
        for dr, dc in itertools.product((-1, 0, 1), repeat=2):
            there, total = (row + dr, column + dc), length + math.hypot(dr, dc)
            if 0 <= there[0] < 120 and 0 <= there[1] < 120 and total < best.get(there, math.inf):
                best[there] = total
                heapq.heappush(queue, (total, there))
    return np.minimum(0.05 * np.array([[best[r, c] for c in range(120)] for r in range(120)]), MAX_DIST)


FIELDS: dict[str, Callable[[BoolArray], FloatArray]] = {
    "exact": exact_field,
    "brushfire": brushfire_field,
}


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as stream:
        return list(csv.DictReader(stream))


def degrees(text: str) -> float:
    assert text.endswith("deg")
    return math.radians(float(text.removesuffix("deg")))


def poses(name: str) -> list[tuple[float, float, float]]:
    found = rows(ROOT / f"samples/reference_{name}.poses.csv")
    return [(float(r["x"]), float(r["y"]), degrees(r["yaw"])) for r in found]


def lidar(name: str, field: FloatArray, *, score_all: bool) -> list[float]:
    first, *_ = YAML(typ="safe").load_all(ROOT / f"samples/reference_{name}.yaml")
    totals = []
    for x, y, yaw in poses(name):
        total = 0.0
        for i, reading in enumerate(first["ranges"]):
            if not score_all and not 0.0 < reading < R_MAX:
                continue
            r = min(max(reading, 0.0), R_MAX)
            angle = yaw + first["angle_min"] + i * first["angle_increment"]
            column = math.floor((x + r * math.cos(angle) + 3.0) / 0.05)
            row = math.floor((y + r * math.sin(angle) + 3.0) / 0.05)
            d = field[row, column] if 0 <= row < 120 and 0 <= column < 120 else MAX_DIST
            total += math.log(Z_HIT * math.exp(-(d**2) / (2 * SIGMA**2)) + Z_RAND / R_MAX)
        totals.append(total)
    return totals


def vision(name: str) -> list[float]:
    marks = {r["id"]: (float(r["x"]), float(r["y"])) for r in rows(ROOT / "samples/reference.landmarks.csv")}
    seen = [(r["id"], degrees(r["bearing"])) for r in rows(ROOT / f"samples/reference_{name}.bearings.csv")]
    return [sum(_sighting(marks.get(mark), bearing, pose) for mark, bearing in seen) for pose in poses(name)]


def _sighting(mark: tuple[float, float] | None, bearing: float, pose: Sequence[float]) -> float:
    if mark is None:
        return math.log(1 / math.tau)
    error = math.remainder(bearing - (math.atan2(mark[1] - pose[1], mark[0] - pose[0]) - pose[2]), math.tau)
    normal = math.exp(-(error**2) / (2 * SIGMA_B**2)) / math.sqrt(math.tau) / SIGMA_B
    return math.log((1 - EPS) * normal + EPS / math.tau)


@pytest.mark.parametrize("method", FIELDS)
@pytest.mark.parametrize("name", LIDAR)
def test_lidar_numbers(name: str, method: str) -> None:
    field = FIELDS[method](occupied())
    np.testing.assert_allclose(lidar(name, field, score_all=True), LIDAR[name][method], atol=1e-9, rtol=0)


def test_vision_numbers() -> None:
    np.testing.assert_allclose(vision("set2"), VISION, atol=1e-9, rtol=0)


def test_sums_of_the_original_demonstration() -> None:
    sums = np.add(lidar("set1", brushfire_field(occupied()), score_all=True), vision("set1"))
    np.testing.assert_allclose(sums, SUM_SET1, atol=1e-9, rtol=0)


@pytest.mark.parametrize("spoil", [np.flipud, np.fliplr, np.transpose], ids=lambda f: f.__name__)
def test_a_spoiled_map_misses_the_numbers(spoil: Callable[[BoolArray], BoolArray]) -> None:
    field = exact_field(spoil(occupied()))
    for name, expected in LIDAR.items():
        assert np.max(np.abs(np.subtract(lidar(name, field, score_all=True), expected["exact"]))) > 0.1
