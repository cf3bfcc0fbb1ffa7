"""Lidar models by name, as ``--model`` has them: a file a model, and a line here.

The file is named as text and imported when the model is asked for, so that ``--help`` can list the names at no cost.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from importlib import import_module
from typing import TYPE_CHECKING, Any, final

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from mclcli.arrays import FloatArray
    from mclcli.native.backend import Backend
    from mclcli.sensors.beams import Beams
    from mclcli.sensors.explain import Explanation
    from mclcli.sensors.instruments import LidarModel
    from mclcli.world.distance_field import DistanceField
    from mclcli.world.occupancy import OccupancyGrid

    FieldMaker = Callable[..., DistanceField]
    Maker = Callable[[OccupancyGrid, Any, FieldMaker, Backend, int], LidarModel]
    Explainer = Callable[[Any, Beams, FloatArray], list[Explanation]]
    Changes = Mapping[str, Mapping[str, float | str]]

LIDAR_MODELS: dict[str, str] = {
    "likelihood_field": "mclcli.sensors.likelihood_field:FIELD",
    "likelihood_field_prob": "mclcli.sensors.likelihood_field:PROB",
    "beam": "mclcli.sensors.beam:BEAM",
}
"""Where the ``Entry`` of each model stands, as ``module:name``."""


@final
@dataclass(frozen=True, slots=True)
class Entry:
    """What there is to know of a lidar model.

    ``group`` names its ``parameters`` among those of ``settings.profiles``, ``source`` is where they come from, and
    ``profiles`` what a profile changes of them, and of all others, for this model alone. ``make`` builds it over a map,
    with a maker of distance fields, the backend of its loops and the threads to share them; ``explain`` gives a row per
    beam at one pose (3,). A model whose loops are ``compiled`` in any case leaves a job no choice.
    """

    group: str
    parameters: type[Any]
    source: str
    make: Maker
    explain: Explainer
    profiles: Changes = field(default_factory=dict)
    compiled: bool = False


def lidar_entry(name: str) -> Entry:
    """Entry of a lidar model of ``LIDAR_MODELS``."""
    module, _, attribute = LIDAR_MODELS[name].partition(":")
    entry: Entry = getattr(import_module(module), attribute)
    return entry
