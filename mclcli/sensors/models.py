"""Lidar models by name, as ``--model`` and nav2's ``laser_model_type`` have them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final, final

from mclcli.sensors.beam import BeamModel
from mclcli.sensors.beam_forms import BeamParameters
from mclcli.sensors.explain import explain_beams, explain_field
from mclcli.sensors.likelihood_field import LikelihoodField, LikelihoodFieldParameters
from mclcli.world.raycast import make_caster

if TYPE_CHECKING:
    from collections.abc import Callable

    from mclcli.arrays import FloatArray
    from mclcli.sensors.beams import Beams
    from mclcli.sensors.explain import Explanation
    from mclcli.sensors.instruments import LidarModel
    from mclcli.world.distance_field import DistanceField
    from mclcli.world.occupancy import OccupancyGrid

    FieldMaker = Callable[..., DistanceField]
    Maker = Callable[[OccupancyGrid, Any, FieldMaker, float, int], LidarModel]
    Explainer = Callable[[Any, Beams, FloatArray], list[Explanation]]


@final
@dataclass(frozen=True, slots=True)
class Entry:
    """A lidar model in the registry.

    ``group`` names its ``parameters`` among those of ``settings.profiles``. ``make`` builds it over a map, with a
    maker of distance fields, the number of pose·beam pairs to come and the threads to share them; ``explain`` gives a
    row per beam at one pose (3,).
    """

    group: str
    parameters: type[Any]
    make: Maker
    explain: Explainer


def make_field_model(
    grid: OccupancyGrid,
    parameters: LikelihoodFieldParameters,
    make_field: FieldMaker,
    job_size: float = 0.0,
    threads: int = 1,
) -> LikelihoodField:
    """Likelihood field over a map; ``make_field`` computes, or finds, the distance field."""
    field = make_field(
        grid,
        parameters.field_method,
        parameters.laser_likelihood_max_dist,
        boundary_only=parameters.obstacles == "boundary",
        mark_unknown=parameters.field_unknown == "uniform",
    )
    return LikelihoodField(field, parameters, job_size, threads)


def make_beam_model(
    grid: OccupancyGrid,
    parameters: BeamParameters,
    make_field: FieldMaker | None = None,
    job_size: float = 0.0,
    threads: int = 1,
) -> BeamModel:
    """Beam mixture over a map; it needs no distance field, whatever the size of the job."""
    del make_field, job_size
    caster = make_caster(grid, method=parameters.raycast, ray_unknown=parameters.ray_unknown)
    return BeamModel(caster, parameters, threads)


_FIELD: Final = Entry("likelihood_field", LikelihoodFieldParameters, make_field_model, explain_field)
LIDAR_MODELS: Final[dict[str, Entry]] = {
    "likelihood_field": _FIELD,
    "likelihood_field_prob": _FIELD,
    "beam": Entry("beam", BeamParameters, make_beam_model, explain_beams),
}
