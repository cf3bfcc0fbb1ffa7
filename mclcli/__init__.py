"""Offline Monte Carlo Localization over recorded robot logs.

The names below are the library; each is imported when it is first used, so that ``import mclcli`` costs nothing.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from mclcli.version import __version__

if TYPE_CHECKING:
    from mclcli.assemble import prepare
    from mclcli.filter.start import AlongPoses, Anywhere, AroundPose, AroundSeveral
    from mclcli.io.map_yaml import load_map
    from mclcli.io.recording import open_recording
    from mclcli.parameter_files.reading import load_settings
    from mclcli.profiles import build as settings
    from mclcli.replay import ReplayTally, replay

_HOMES = {
    "AlongPoses": "mclcli.filter.start",
    "Anywhere": "mclcli.filter.start",
    "AroundPose": "mclcli.filter.start",
    "AroundSeveral": "mclcli.filter.start",
    "ReplayTally": "mclcli.replay",
    "load_map": "mclcli.io.map_yaml",
    "load_settings": "mclcli.parameter_files.reading",
    "open_recording": "mclcli.io.recording",
    "prepare": "mclcli.assemble",
    "replay": "mclcli.replay",
    "settings": "mclcli.profiles",
}

_FUNCTIONS = {"settings": "build"}  # where the library's name differs

__all__ = [
    "AlongPoses",
    "Anywhere",
    "AroundPose",
    "AroundSeveral",
    "ReplayTally",
    "__version__",
    "load_map",
    "load_settings",
    "open_recording",
    "prepare",
    "replay",
    "settings",
]


def __getattr__(name: str) -> Any:  # noqa: ANN401 - whatever stands there
    if name not in _HOMES:
        raise AttributeError(f"module 'mclcli' has no attribute '{name}'")
    _bind()
    return globals()[name]


def _bind() -> None:
    """Import the library's names all at once: ``replay`` is also a module, which importing others would leave here."""
    import importlib

    modules = {name: importlib.import_module(home) for name, home in _HOMES.items()}
    globals().update({name: getattr(module, _FUNCTIONS.get(name, name)) for name, module in modules.items()})
