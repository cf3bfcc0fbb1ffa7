"""The search over a map, as ``mcl locate`` and ``mcl run`` use it: its field and pyramid from the cache."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

from mclcli.errors import UsageError
from mclcli.io.maps.field_cache import cached_field
from mclcli.io.maps.pyramid_cache import cached_pyramid
from mclcli.replay import finder
from mclcli.replay.finder import FoundAgain, FoundOnMap
from mclcli.replay.setup import alpha_of, lidar_model
from mclcli.sensors.likelihood_field import LikelihoodField

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mclcli.filter.recovery import Proposal
    from mclcli.filter.start import Start
    from mclcli.io.recording.roles import Roles
    from mclcli.replay.finder import GlobalSearch, Limits
    from mclcli.sensors import Temperature
    from mclcli.settings.profiles import Settings
    from mclcli.world.landmarks import Landmarks
    from mclcli.world.occupancy import OccupancyGrid


def global_search(
    settings: Settings,
    grid: OccupancyGrid,
    landmarks: Landmarks | None,
    alpha: Temperature = "auto",
    limits: Limits | None = None,
) -> GlobalSearch:
    """The search that the settings ask for; whatever the model, a likelihood field finds."""
    settings = dataclasses.replace(settings, model="likelihood_field")
    model = lidar_model(grid, settings, lambda *what, **how: cached_field(*what, **how)[0])
    assert isinstance(model, LikelihoodField)  # noqa: S101 - that is what the model was set to
    return finder.make_global_search(
        grid,
        model,
        settings,
        lambda field: cached_pyramid(field)[0],
        limits=limits,
        landmarks=landmarks,
        alpha=alpha,
    )


def temperature_of(temperature: Mapping[str, Temperature]) -> Temperature:
    """Temperature of a search.

    Raises
    ------
    UsageError
        If it is ``ess``, which needs particles.

    """
    alpha = alpha_of(temperature, "lidar", "auto")
    if alpha == "ess":
        raise UsageError("--temperature: ess keeps a share of a sample, and here is none; give a number or auto")
    return alpha


def search_for(
    settings: Settings,
    grid: OccupancyGrid | None,
    landmarks: Landmarks | None,
    parts: Roles,
    start: Start | None,
    *,
    anywhere: bool,
) -> tuple[Start | None, Proposal | None, Start | None]:
    """Start, proposal, and search after a reset of odometry, each where it is asked for and possible.

    ``start`` is what else says where the run begins; with ``anywhere`` a search says it. Without a lidar or a map
    there is nothing to search.
    """
    again = settings.recovery.recovery == "locate" and settings.recovery.enabled
    if grid is None or not parts.scan or not (anywhere or again):
        return start, None, None
    search = global_search(settings, grid, landmarks)
    found = FoundOnMap(search, grid)
    return found if anywhere else start, FoundAgain(search, grid) if again else None, found
