"""Writing CDR, the encoding of ROS 2 messages: XCDR version 1, little endian."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING, Any, final

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

_HEADER = b"\x00\x01\x00\x00"  # representation CDR_LE, no options
_I32, _U32 = struct.Struct("<i"), struct.Struct("<I")


@final
class CdrWriter:
    """One message in the making: put its fields in order, then ``finish``.

    Every number stands at a multiple of its size, counted from the end of the 4-byte header. An empty sequence is its
    count alone, without padding for the elements it lacks: so do Fast CDR and rosbags.
    Source: OMG DDSI-RTPS 2.5 §10 (header), OMG CORBA 3.3 part 2 §9.3 (alignment, strings, sequences).
    """

    __slots__ = ("_data", "_parts", "_size")

    def __init__(self) -> None:
        self._data = bytearray(_HEADER)
        self._parts: list[bytes | bytearray | memoryview] = []  # what stands before it, arrays as they are
        self._size = 0  # of those parts

    def boolean(self, value: bool) -> None:  # noqa: FBT001 - a field's value, not a switch
        """Put one bool."""
        self._data.append(bool(value))

    def i32(self, value: int) -> None:
        """Put one int32."""
        self._align(4)
        self._data += _I32.pack(value)

    def u32(self, value: int) -> None:
        """Put one uint32."""
        self._align(4)
        self._data += _U32.pack(value)

    def f32(self, *values: float) -> None:
        """Put float32 values, one after the other."""
        self._pack("f", 4, *values)

    def f64(self, *values: float) -> None:
        """Put float64 values, one after the other."""
        self._pack("d", 8, *values)

    def string(self, text: str) -> None:
        """Put one string: its size with the final NUL, UTF-8, NUL."""
        raw = text.encode("utf-8", "backslashreplace")
        self.u32(len(raw) + 1)
        self._data += raw + b"\0"

    def strings(self, texts: Sequence[str]) -> None:
        """Put a sequence of strings."""
        self.u32(len(texts))
        for text in texts:
            self.string(text)

    def array(self, values: NDArray[Any]) -> None:
        """Put every element of an array in C order, without a count: int8, uint8, float32, float64 or bool.

        It is copied by ``finish``: until then it must not change.
        """
        if values.size:
            self._align(values.dtype.itemsize)
            self._parts += (self._data, values.astype(values.dtype.newbyteorder("<"), order="C", copy=False).data)
            self._size += len(self._data) + values.nbytes
            self._data = bytearray()

    def sequence(self, values: NDArray[Any], count: int | None = None) -> None:
        """Put a count and then the array; ``count`` where an element of the sequence is a row of the array."""
        self.u32(values.size if count is None else count)
        self.array(values)

    def finish(self) -> bytes:
        """Everything put so far, with the header."""
        return b"".join((*self._parts, self._data))

    def _pack(self, code: str, size: int, *values: float) -> None:
        self._align(size)
        self._data += struct.pack(f"<{len(values)}{code}", *values)

    def _align(self, size: int) -> None:
        over = (self._size + len(self._data) - len(_HEADER)) % size
        if over:
            self._data += bytes(size - over)
