"""Results as JSON on standard output: one object, in plain numbers, with null for what has no value."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from mclcli.errors import UsageError

if TYPE_CHECKING:
    from collections.abc import Iterable


def keep_stdout_free(outputs: Iterable[str | None], *, as_json: bool) -> None:
    """Refuse an output ``-`` beside --json, which takes standard output."""
    if as_json and "-" in outputs:
        raise UsageError("--json takes standard output, and so does an output -; give that one a name")


def print_json(facts: Mapping[str, Any]) -> None:
    """Write one object; not-a-number and infinities become null, -0 becomes 0."""
    from mclcli.io.traces.output import open_output

    with open_output("-", binary=False) as output:
        output.write(json.dumps(plain(facts), indent=2, allow_nan=False) + "\n")


def plain(value: Any) -> Any:
    """A value as JSON can hold it."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, float):
        return float(value) + 0.0 if math.isfinite(value) else None
    return value


def seconds(stamp_ns: int) -> float:
    """Absolute seconds of a stamp, as near as a double comes."""
    return float(f"{int(stamp_ns)}e-9")


def pose(values: Iterable[float]) -> dict[str, float]:
    """A pose by the names of its parts."""
    return dict(zip(("x", "y", "yaw"), map(float, values), strict=True))
