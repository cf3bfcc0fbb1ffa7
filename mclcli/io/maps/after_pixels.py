"""Bytes behind complete pixels: what other readers pass over, told apart from pixels that were pushed out.

Where bytes were put in among the pixels, as many pixels stand behind the raster. So only what is hardly ever a pixel
is passed over: line ends, blanks, zeros, and another image (Netpbm files may hold several).
"""

from __future__ import annotations

import logging
import re

_FILLING = re.compile(rb"[\s\0\x1a]*")
_IMAGE = re.compile(rb"P[1-6](?:\s|#[^\r\n]*[\r\n])+[0-9]+(?:\s|#[^\r\n]*[\r\n])+[0-9]+\s|P7\s")


def is_no_pixels(rest: bytes) -> bool:
    """Whether these bytes are filling or another image, not pixels."""
    end = _end_of_filling(rest)
    return end == len(rest) or _IMAGE.match(rest, end) is not None


def tell(rest: bytes | memoryview, name: str) -> None:
    """Warn of the bytes behind the pixels, if there are any, and say of which kind they are."""
    data = bytes(rest)
    if not data:
        return
    end = _end_of_filling(data)
    what = "another image" if _IMAGE.match(data, end) else _filling(data) if end == len(data) else "of another kind"
    text = "%s: bytes follow the last pixel (%d, %s); they are not used"
    logging.getLogger("mclcli").warning(text, name, len(data), what)


def _end_of_filling(rest: bytes) -> int:
    found = _FILLING.match(rest)
    return found.end() if found else 0


def _filling(data: bytes) -> str:
    kinds = (("line ends", b"\r\n"), ("zeros", b"\0"), ("blanks", b" \t\v\f\x1a"))
    return " and ".join(kind for kind, values in kinds if not set(data).isdisjoint(values))
