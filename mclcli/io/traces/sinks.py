"""What the writers of traces and tracks share: their shape, the sinks below them, the text of a stamp."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Protocol, TypeVar

import numpy as np

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray

T_contra = TypeVar("T_contra", contravariant=True)

NANOSECONDS = 1_000_000_000
_FEW = 16  # numbers that Python looks at sooner than NumPy
COVARIANCE_COLUMNS = "cov_xx,cov_xy,cov_xyaw,cov_yy,cov_yyaw,cov_yawyaw"


class TextSink(Protocol):
    """Anything that takes text: an ``Output``, an open text file, an ``io.StringIO``."""

    def write(self, data: str, /) -> object:
        """Append text."""
        ...


class BinarySink(Protocol):
    """Anything that takes bytes: an ``Output``, an open binary file, a pipe."""

    def write(self, data: bytes, /) -> object:
        """Append bytes."""
        ...

    def flush(self) -> object:
        """Hand everything to the system."""
        ...


class RecordWriter(Protocol[T_contra]):
    """What every writer of step records or track points looks like."""

    def write(self, item: T_contra, /) -> None:
        """Append one record; a ValueError if a pose, covariance or weight in it is not finite."""
        ...

    def close(self) -> None:
        """Finish the format; the stream below stays open."""
        ...


def stamp_text(stamp_ns: int) -> str:
    """Absolute seconds with exactly 9 decimals, by integer arithmetic: ``1318384871.000000001``."""
    seconds, rest = divmod(abs(int(stamp_ns)), NANOSECONDS)
    return f"{'-' if stamp_ns < 0 else ''}{seconds}.{rest:09d}"


def csv_text(text: str) -> str:
    """A field of text for a CSV: quoted where CSV needs it, with ' before what a spreadsheet would run as a formula."""
    if text.startswith(("=", "+", "-", "@", "\t", "\r")) and not _is_number(text):
        text = f"'{text}"
    return '"' + text.replace('"', '""') + '"' if any(c in text for c in ',"\r\n') else text


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def covariance_text(covariance: FloatArray) -> str:
    """Fields of ``COVARIANCE_COLUMNS``, 9 significant digits, of a covariance (3, 3)."""
    require_finite("covariance", covariance)
    (xx, xy, xyaw), (_, yy, yyaw), (_, _, yawyaw) = covariance.tolist()
    return f"{xx:.9g},{xy:.9g},{xyaw:.9g},{yy:.9g},{yyaw:.9g},{yawyaw:.9g}"


def require_finite(what: str, values: FloatArray) -> None:
    """Refuse NaN and ±inf where a pose, covariance or weight is about to be written.

    Raises
    ------
    ValueError
        If a value is not finite: a fault of the caller, never of the data.

    """
    few = values.size <= _FEW
    if not (all(map(math.isfinite, values.ravel().tolist())) if few else np.isfinite(values).all()):
        raise ValueError(f"{what} to be written is not finite")
