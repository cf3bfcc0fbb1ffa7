"""Offline Monte Carlo Localization over recorded robot logs.

The names below are the library; each is imported when it is first used, so that ``import mclcli`` costs nothing.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from mclcli.version import __version__

if TYPE_CHECKING:
    from mclcli.evaluate.association import Matching
    from mclcli.evaluate.evaluation import Evaluation, Protocol
    from mclcli.evaluate.evaluation import evaluate as evaluate_track
    from mclcli.evaluate.events import Rule
    from mclcli.evaluate.versus import Comparison
    from mclcli.evaluate.versus import compare as compare_tracks
    from mclcli.filter.start import AlongPoses, Anywhere, AroundPose, AroundSeveral
    from mclcli.geometry.trajectory import Trajectory, track_of
    from mclcli.io.maps.map_yaml import load_map
    from mclcli.io.recording.recorded_poses import read_trajectory
    from mclcli.io.recording.recording import open_recording
    from mclcli.replay.loop import ReplayTally, replay
    from mclcli.replay.setup import prepare
    from mclcli.replay.smoothing import Smoothing
    from mclcli.settings.profiles import build as settings
    from mclcli.settings.robots.reading import load_settings

_HOMES = {
    "AlongPoses": "mclcli.filter.start",
    "Anywhere": "mclcli.filter.start",
    "AroundPose": "mclcli.filter.start",
    "AroundSeveral": "mclcli.filter.start",
    "Comparison": "mclcli.evaluate.versus",
    "Evaluation": "mclcli.evaluate.evaluation",
    "Matching": "mclcli.evaluate.association",
    "Protocol": "mclcli.evaluate.evaluation",
    "ReplayTally": "mclcli.replay.loop",
    "Rule": "mclcli.evaluate.events",
    "Smoothing": "mclcli.replay.smoothing",
    "Trajectory": "mclcli.geometry.trajectory",
    "compare_tracks": "mclcli.evaluate.versus",
    "evaluate_track": "mclcli.evaluate.evaluation",
    "load_map": "mclcli.io.maps.map_yaml",
    "load_settings": "mclcli.settings.robots.reading",
    "open_recording": "mclcli.io.recording.recording",
    "prepare": "mclcli.replay.setup",
    "read_trajectory": "mclcli.io.recording.recorded_poses",
    "replay": "mclcli.replay.loop",
    "settings": "mclcli.settings.profiles",
    "track_of": "mclcli.geometry.trajectory",
}

# where the library's name differs
_FUNCTIONS = {"settings": "build", "evaluate_track": "evaluate", "compare_tracks": "compare"}

__all__ = [
    "AlongPoses",
    "Anywhere",
    "AroundPose",
    "AroundSeveral",
    "Comparison",
    "Evaluation",
    "Matching",
    "Protocol",
    "ReplayTally",
    "Rule",
    "Smoothing",
    "Trajectory",
    "__version__",
    "compare_tracks",
    "evaluate_track",
    "load_map",
    "load_settings",
    "open_recording",
    "prepare",
    "read_trajectory",
    "replay",
    "settings",
    "track_of",
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
