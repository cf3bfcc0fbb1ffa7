"""Logs cut off anywhere: every message that was whole before the cut comes out."""

from __future__ import annotations

import io
import struct
from functools import cache, partial
from typing import TYPE_CHECKING

from mcap.records import Chunk
from mcap.stream_reader import StreamReader, breakup_chunk

from tests.battery.bases import Base, base_logs
from tests.battery.damaged import compare, read_all
from tests.battery.harness import LOSS, Case, Verdict
from tests.io.logs import seeded

if TYPE_CHECKING:
    from pathlib import Path

CUTS = 60


def cases(seed: int, share: float) -> list[Case]:
    """Cuts of the base logs that are not compressed as a whole."""
    found = []
    for base in base_logs():
        if not base.name.endswith(".zstd"):
            rng = seeded(f"{seed} {base.name} cut")
            cuts = rng.sample(range(20, len(base.data)), max(1, round(CUTS * share)))
            found += [Case(f"{base.name} cut at byte {cut}", partial(check, base.name, cut)) for cut in cuts]
    return found


def check(name: str, cut: int, folder: Path) -> Verdict:
    """Cut one log and count."""
    base = next(base for base in base_logs() if base.name == name)
    path = folder / name
    path.write_bytes(base.data[:cut])
    found, tally = read_all(path)
    problems, _ = compare(base, found, tally, base.data[:cut])
    if name.endswith(".db3"):
        return Verdict(
            problems, {"of db3, read": len(found), "of db3, by share": len(base.known) * cut // len(base.data)}
        )
    whole = sum(end <= cut for end in message_ends(name))
    if len(found) < whole:
        problems.append((LOSS, f"{len(found)} of {whole} whole messages"))
    return Verdict(problems, {"whole before the cut": whole, "read": len(found)})


@cache
def message_ends(name: str) -> list[int]:
    """Byte at which each message of a base log is complete: its own end, or that of its compressed chunk."""
    base = next(base for base in base_logs() if base.name == name)
    if name in {"plain.mcap", "unchunked.mcap", "plain.bag"}:
        return [base.data.index(known.data) + len(known.data) for known in base.known]
    return _bag_ends(base) if name.endswith(".bag") else _mcap_ends(base)


def _mcap_ends(base: Base) -> list[int]:
    chunks = [r for r in StreamReader(io.BytesIO(base.data), emit_chunks=True).records if isinstance(r, Chunk)]
    ends: list[int] = []
    for chunk in chunks:
        end = base.data.index(chunk.data) + len(chunk.data)
        ends += [end for record in breakup_chunk(chunk) if type(record).__name__ == "Message"]
    return ends


def _bag_ends(base: Base) -> list[int]:
    """By the index: each chunk's place and its count of messages."""
    from rosbags.rosbag1 import Reader

    from tests.battery.scratch import on_disk

    ends: list[int] = []
    with on_disk(base.data, base.name) as path, Reader(path) as reader:
        for info in reader.chunk_infos:
            (header,) = struct.unpack_from("<I", base.data, info.pos)
            (length,) = struct.unpack_from("<I", base.data, info.pos + 4 + header)
            ends += [info.pos + 8 + header + length] * sum(info.connection_counts.values())
    return ends
