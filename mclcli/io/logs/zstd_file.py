"""Log files that rosbag2 compressed as a whole (.db3.zstd, .mcap.zstd), unpacked to a temporary file while read."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, final

from mclcli.io.logs.base import EVERYTHING, Damage, Item, Wish

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from mclcli.io.logs.base import Container

_STEP = 1 << 20


@final
@dataclass(frozen=True, slots=True)
class ZstdFile:
    """A compressed log file; ``inner`` makes the container for the unpacked one."""

    source: str
    path: Path
    inner: Callable[[Path], Container]

    def items(self, wish: Wish = EVERYTHING) -> Iterator[Item]:
        """Channels, messages and damage in file order (see ``Container``)."""
        with tempfile.TemporaryDirectory(prefix="mcl-") as folder:
            plain = Path(folder) / self.path.name.removesuffix(".zstd")
            wrong = _unpack(self.path, plain)
            if wrong:
                yield Damage(self.source, 0, wrong)
            yield from self.inner(plain).items(wish)


def first_bytes(path: Path, count: int) -> bytes:
    """First bytes of the unpacked contents, fewer if they cannot be unpacked. Raises OSError."""
    import zstandard

    with path.open("rb") as stream:
        try:
            return zstandard.ZstdDecompressor().stream_reader(stream).read(count)
        except zstandard.ZstdError:
            return b""


def _unpack(path: Path, plain: Path) -> str:
    """Unpack as far as it goes; returns what is wrong, '' if nothing is."""
    import zstandard

    limit = max(1 << 30, 1000 * path.stat().st_size)
    with path.open("rb") as packed, plain.open("wb") as out:
        reader = zstandard.ZstdDecompressor().stream_reader(packed, read_across_frames=True)
        try:
            while block := reader.read(_STEP):
                out.write(block)
                if out.tell() > limit:
                    return "inflates to more than 1000 times its size; the rest of it is skipped"
        except zstandard.ZstdError:
            return f"does not decompress beyond byte {out.tell()} of its contents"
    return ""
