"""How ROS 2 tells the type of a scalar in a parameter file, as rcl_yaml_param_parser does it."""

from __future__ import annotations

_TRUE = ["Y", "y", "yes", "Yes", "YES", "true", "True", "TRUE", "on", "On", "ON"]
_FALSE = ["N", "n", "no", "No", "NO", "false", "False", "FALSE", "off", "Off", "OFF"]


def typed(text: str) -> bool | int | float | str:
    """A scalar as written, quotes included: words for truth, then what strtol takes whole, then strtod, else text."""
    if text[0] == text[-1] == '"':
        return _unescaped(text[1:-1])
    if text in _TRUE:
        return True
    if text in _FALSE:
        return False
    if text.removeprefix("-").isdecimal():
        return int(text)
    try:
        return float(text)
    except ValueError:
        return text


def _unescaped(text: str) -> str:
    shown, at = "", 0
    while at < len(text):
        digits = {"x": 2, "u": 4}.get(text[at + 1 : at + 2], 0) if text[at] == "\\" else 0
        if digits:
            shown, at = shown + chr(int(text[at + 2 : at + 2 + digits], 16)), at + 2 + digits
        elif text[at] == "\\":
            shown, at = shown + text[at + 1], at + 2
        else:
            shown, at = shown + text[at], at + 1
    return shown
