"""Nested plain values as text."""

from __future__ import annotations

import io
import json
from typing import Any


def format_plain(value: dict[str, Any], form: str) -> str:
    """Text of nested dicts, lists, numbers and words, as ``yaml`` or ``json``, ending in a newline."""
    if form == "json":
        return json.dumps(value, indent=2) + "\n"
    from ruamel.yaml import YAML

    yaml = YAML(typ="safe", pure=True)
    yaml.default_flow_style = None
    yaml.width = 2**16
    yaml.sort_base_mapping_type_on_output = False  # type: ignore[assignment]
    text = io.StringIO()
    yaml.dump(value, text)
    return text.getvalue()
