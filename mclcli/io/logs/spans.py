"""When each of several logs was recorded, and which of them follow one another."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, final

if TYPE_CHECKING:
    from collections.abc import Iterable

    from mclcli.io.logs.base import Span

APART_NS = 3600 * 10**9
"""A log that begins so long after the one before does not follow it."""


@final
@dataclass(slots=True)
class Strand:
    """Logs that follow one another; ``why`` tells that they do not follow those before, empty for the first."""

    spans: list[Span]
    why: str = ""

    @property
    def arguments(self) -> set[int]:
        """What the user named of it, by number."""
        return {span.argument for span in self.spans}


def strands(spans: Iterable[Span]) -> list[Strand]:
    """Sort logs into those that follow one another, in order of time; one without scans and odometry fits anywhere."""
    found: list[Strand] = []
    moving = sorted((span for span in spans if span.topics), key=lambda span: (span.first_ns, span.argument))
    for span in moving:
        fitting = [strand for strand in found if not _obstacle(strand, span)]
        if fitting:
            max(fitting, key=lambda strand: span.argument - 1 in strand.arguments).spans.append(span)
        else:
            found.append(Strand([span], _obstacle(found[-1], span) if found else ""))
    return found


def _obstacle(strand: Strand, span: Span) -> str:
    """Why a log does not follow others, empty if it does."""
    if span.argument in strand.arguments:
        return ""
    last = max(strand.spans, key=lambda other: other.last_ns)
    for other in strand.spans:
        if shared := other.together(span):
            return f"{other.name} and {span.name} hold {', '.join(sorted(shared))} at the same time"
    apart_s = (span.first_ns - last.last_ns) // 10**9
    if apart_s * 10**9 <= APART_NS:
        return ""
    apart = f"{apart_s / 86_400:.0f} days" if apart_s > 2 * 86_400 else f"{apart_s / 3600:.1f} hours"
    return f"{span.name} begins {apart} after the end of {last.name}"
