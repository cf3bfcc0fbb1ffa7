"""Text on pictures, in the one typeface that comes with Pillow (Aileron, CC0)."""

from __future__ import annotations

import unicodedata
from functools import lru_cache
from typing import TYPE_CHECKING

from PIL import Image, ImageDraw, ImageFont

if TYPE_CHECKING:
    from mclcli.render.palette import Color

TITLE, SUBTITLE, BODY, SMALL = 27, 17, 15, 13
_FINE = 4

# The embedded subset of the typeface lacks these.
_SPELLED = str.maketrans({"−": "-", "–": "-", "—": "-", "×": "x", "σ": "sigma", "α": "alpha", "²": "^2", "→": "->"})


@lru_cache(maxsize=32)
def _font(size: int) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    return ImageFont.load_default(size=size)


@lru_cache(maxsize=1024)
def _drawn(character: str) -> bool:
    font = _font(40)
    return bytes(font.getmask(character)) != bytes(font.getmask("\uffff"))


def _shown(character: str) -> str:
    """Character as it is, else without its accents, else ``?``."""
    for candidate in (character, unicodedata.normalize("NFKD", character)[0]):
        if candidate.isprintable() and _drawn(candidate):
            return candidate
    return "?"


def printable(text: str) -> str:
    """Text in one line that the typeface can show: white space collapsed, accents dropped where it has none."""
    line = " ".join(text.split()).translate(_SPELLED)
    return "".join(_shown(c) for c in line[:400])


def width_of(text: str, size: int) -> float:
    """Width of a line of text [px]."""
    return float(_font(size).getlength(text))


def shorten(text: str, size: int, room: float) -> str:
    """Text cut with an ellipsis so that it is at most ``room`` pixels wide."""
    if width_of(text, size) <= room:
        return text
    low, high = 0, len(text)
    while low < high:  # the longest beginning that fits
        middle = (low + high + 1) // 2
        fits = width_of(text[:middle].rstrip() + "…", size) <= room
        low, high = (middle, high) if fits else (low, middle - 1)
    return text[:low].rstrip() + "…"


def write(image: Image.Image, at: tuple[float, float], text: str, size: int, color: Color, anchor: str = "ls") -> None:
    """Write a line at a pixel; ``anchor`` as in Pillow (l, m, r horizontally; a, m, s vertically)."""
    ImageDraw.Draw(image).text(at, text, fill=color, font=_font(size), anchor=anchor)


def write_bold(image: Image.Image, at: tuple[int, int], text: str, size: int, color: Color) -> None:
    """Write a line in a heavier cut, its baseline starting at a pixel.

    The typeface comes in one weight: the letters are drawn large with a thin outline and reduced.
    """
    box = (round(width_of(text, size)) + 8, 2 * size)
    mask = Image.new("L", (box[0] * _FINE, box[1] * _FINE))
    ImageDraw.Draw(mask).text(
        (4 * _FINE, int(1.5 * size) * _FINE),
        text,
        fill=255,
        font=_font(size * _FINE),
        anchor="ls",
        stroke_width=max(1, round(0.018 * size * _FINE)),
        stroke_fill=255,
    )
    image.paste(color, (at[0] - 4, at[1] - int(1.5 * size)), mask.reduce(_FINE))
