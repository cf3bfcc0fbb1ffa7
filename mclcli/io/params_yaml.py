"""Parameters as YAML: plain names and values."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mclcli.errors import UsageError
from mclcli.io.yaml_text import scalar

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path


def read_params(path: Path) -> dict[str, object]:
    """Name → value of a YAML mapping, as ``mcl params`` prints it.

    Raises
    ------
    UsageError
        If there is no such file, or it is not a mapping of names to numbers and words.

    """
    from mclcli.io.safe_yaml import load_yaml_file

    values = load_yaml_file(path)
    if not isinstance(values, dict):
        raise UsageError(f"{path}: not a mapping of parameter names to values; `mcl params` prints one to start from")
    for name, value in values.items():
        if not isinstance(value, int | float | str):
            raise UsageError(
                f"{path}: '{name}' is not a number or a word; write NAME: VALUE lines as `mcl params` does"
            )
    return {str(name): value for name, value in values.items()}


def format_params(values: Mapping[str, float | str], comments: Mapping[str, str] | None = None) -> str:
    """YAML mapping, a line per parameter, each with its comment."""
    lines = []
    for name, value in values.items():
        text = f"{name}: {scalar(value)}"
        comment = (comments or {}).get(name, "")
        lines.append(f"{text:<40} # {comment}" if comment else text)
    return "\n".join(lines) + "\n"
