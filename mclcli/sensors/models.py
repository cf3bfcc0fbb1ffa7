"""Lidar models by name, as ``--model`` and nav2's ``laser_model_type`` have them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final, final

from mclcli.native.backend import NUMPY, Backend
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
    Maker = Callable[[OccupancyGrid, Any, FieldMaker, Backend, int], LidarModel]
    Explainer = Callable[[Any, Beams, FloatArray], list[Explanation]]


@final
@dataclass(frozen=True, slots=True)
class Entry:
    """A lidar model in the registry.

    ``group`` names its ``parameters`` among those of ``settings.profiles``. ``make`` builds it over a map, with a
    maker of distance fields, the backend of its loops and the threads to share them; ``explain`` gives a row per beam
    at one pose (3,). A model whose loops are ``compiled`` in any case leaves a job no choice.
    """

    group: str
    parameters: type[Any]
    make: Maker
    explain: Explainer
    compiled: bool = False


def make_field_model(
    grid: OccupancyGrid,
    parameters: LikelihoodFieldParameters,
    make_field: FieldMaker,
    backend: Backend = NUMPY,
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
    return LikelihoodField(field, parameters, backend, threads)


def make_beam_model(
    grid: OccupancyGrid,
    parameters: BeamParameters,
    make_field: FieldMaker | None = None,
    backend: Backend = NUMPY,
    threads: int = 1,
) -> BeamModel:
    """Beam mixture over a map; it needs no distance field, and has no loops in NumPy."""
    del make_field, backend
    caster = make_caster(grid, method=parameters.raycast, ray_unknown=parameters.ray_unknown)
    return BeamModel(caster, parameters, threads)


_FIELD: Final = Entry("likelihood_field", LikelihoodFieldParameters, make_field_model, explain_field)
LIDAR_MODELS: Final[dict[str, Entry]] = {
    "likelihood_field": _FIELD,
    "likelihood_field_prob": _FIELD,
    "beam": Entry("beam", BeamParameters, make_beam_model, explain_beams, compiled=True),
}
