"""How a lidar is judged: its temperature, and what tells how well a scan fits where its likelihood cannot."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from mclcli.sensors.beams import BeamSelection
from mclcli.sensors.instruments import Check
from mclcli.sensors.likelihood_field import LikelihoodFieldParameters, make_field_model
from mclcli.sensors.models import lidar_entry

if TYPE_CHECKING:
    from mclcli.sensors import Temperature
    from mclcli.sensors.models import FieldMaker
    from mclcli.settings.profiles import Settings
    from mclcli.world.occupancy import OccupancyGrid

_TEMPERATURE: Final = "auto"  # measured, see docs/decisions/0013
# Parameters of the likelihood field that decide what a share of explained beams makes of its logarithm.
_SCALE_OF_FIT: Final = (
    "z_hit",
    "z_rand",
    "sigma_hit",
    "combination",
    "hit_normalised",
    "off_map",
    "field_unknown",
    "do_beamskip",
)


def make_check(grid: OccupancyGrid, settings: Settings, make_field: FieldMaker) -> Check | None:
    """The textbook's likelihood field, to judge fits; None where the model's own likelihood is that one."""
    own, textbook = settings.lidars[lidar_entry(settings.model).group], LikelihoodFieldParameters()
    if isinstance(own, LikelihoodFieldParameters) and all(
        getattr(own, name) == getattr(textbook, name) for name in _SCALE_OF_FIT
    ):
        return None
    p = settings.beams
    selection = BeamSelection(p.max_beams, p.laser_min_range, p.laser_max_range)
    return Check(make_field_model(grid, textbook, make_field), selection)


def lidar_temperature(settings: Settings) -> Temperature:
    """Temperature of a lidar that no option names: robots have none."""
    return _TEMPERATURE if settings.profile == "textbook" else 1.0
