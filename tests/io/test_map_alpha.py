"""Opacity: what is not opaque is unknown, and who averages it instead is told of the cells that differ."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING

import numpy as np
import pytest
from PIL import Image

from mclcli.io.maps.doubts import averaged
from mclcli.io.maps.map_description import MapDescription
from tests.io.map_files import load

if TYPE_CHECKING:
    from pathlib import Path

# Red, green, blue, opacity; the cell by today's rule; the cell where opacity is averaged, by hand from the formula with
# thresholds 0.65 and 0.196: p = 1 - (R + G + B + A) / 1020.
GOLDEN = [
    ((0, 0, 0, 255), 100, 100),  # p = 0.75
    ((0, 0, 0, 128), -1, 100),  # 0.875
    ((0, 0, 0, 0), -1, 100),  # 1
    ((255, 255, 255, 255), 0, 0),  # 0
    ((255, 255, 255, 128), -1, 0),  # 0.125
    ((255, 255, 255, 0), -1, -1),  # 0.25
    ((205, 205, 205, 255), -1, 0),  # 0.147
    ((205, 205, 205, 0), -1, -1),  # 0.397
    ((60, 60, 60, 255), 100, -1),  # 0.574
    ((100, 100, 100, 254), -1, -1),  # 0.457
    ((0, 255, 0, 255), -1, -1),  # 0.5; gray 149, p = 0.416
]


def _png(mode: str, pixels: list[tuple[int, ...]], **options: object) -> bytes:
    stream = io.BytesIO()
    data = bytes(value for pixel in pixels for value in pixel)
    Image.frombytes(mode, (len(pixels), 1), data).save(stream, "PNG", **options)
    return stream.getvalue()


def test_the_cells_are_those_of_todays_map_server(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    image = _png("RGBA", [pixel for pixel, _, _ in GOLDEN])
    assert load(tmp_path, image).cells.tolist() == [[cell for _, cell, _ in GOLDEN]]
    differ = sum(cell != other for _, cell, other in GOLDEN)
    (record,) = caplog.records
    assert f"has an alpha channel: {differ} cells (" in record.getMessage()


@pytest.mark.parametrize("negate", [False, True])
def test_the_other_rule_by_the_formula(negate: bool) -> None:  # noqa: FBT001 - a property of the map
    description = MapDescription("m", 1.0, (0.0, 0.0, 0.0), negate, 0.65, 0.196)
    sums = np.array([[sum(pixel)] for pixel, _, _ in GOLDEN], np.uint16)
    expected = [cell for _, _, cell in GOLDEN]
    if negate:
        expected = [100 if p > 0.65 else 0 if p < 0.196 else -1 for p in (sums[:, 0] / 1020).tolist()]
    assert averaged(sums, description)[::-1, 0].tolist() == expected


@pytest.mark.parametrize(
    ("image", "changes"),
    [
        (_png("RGBA", [(0, 0, 0, 255), (255, 255, 255, 255)]), {}),
        (_png("LA", [(0, 255), (254, 255)]), {}),
        (_png("L", [(254,), (0,)]), {}),
        (_png("RGB", [(205, 205, 205), (0, 0, 0), (255, 255, 255)]), {}),
        (_png("RGBA", [pixel for pixel, _, _ in GOLDEN]), {"mode": "scale"}),
        (_png("RGBA", [(pixel[0] // 8, 0, 0, 0) for pixel, _, _ in GOLDEN]), {"mode": "raw"}),
    ],
)
def test_where_map_servers_agree_nothing_is_said(
    tmp_path: Path, image: bytes, changes: dict[str, str], caplog: pytest.LogCaptureFixture
) -> None:
    load(tmp_path, image, **changes)
    assert not caplog.records


@pytest.mark.parametrize(
    "image",
    [
        _png("LA", [(205, 255), (0, 255), (254, 255)]),
        _png("LA", [(0, 0), (254, 255)]),
        _png("L", [(0,), (254,)], transparency=0),
    ],
)
def test_opacity_of_gray_images_counts_too(tmp_path: Path, image: bytes, caplog: pytest.LogCaptureFixture) -> None:
    load(tmp_path, image)
    (record,) = caplog.records
    assert "has an alpha channel: 1 cells (" in record.getMessage()
