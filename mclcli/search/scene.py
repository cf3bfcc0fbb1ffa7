"""What is searched for and where: a map with its field, and what the robot sees of it."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.geometry import se2
from mclcli.search.branching import NO_SIGHTINGS, Sightings
from mclcli.sensors.endpoints import Anchoring

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mclcli.arrays import BoolArray, FloatArray, IntArray
    from mclcli.search.lattice import Places
    from mclcli.search.parameters import BaseCells
    from mclcli.sensors.beam import BeamModel
    from mclcli.sensors.beams import Beams
    from mclcli.sensors.bearing import BearingModel, Bearings
    from mclcli.sensors.likelihood_field import LikelihoodField
    from mclcli.smooth.odometry import Odometry
    from mclcli.world.occupancy import OccupancyGrid
    from mclcli.world.pyramid import Pyramid


@final
@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """A map made ready: the field's model, its pyramid, the beam model of the same map, and where the base may be.

    ``about`` is a yaw [rad] in map and how far from it the robot's may be; ``stray`` is the mean likelihood of an
    endpoint in any known cell, by r_max: what beams score that have nothing to do with this map.
    """

    model: LikelihoodField
    pyramid: Pyramid
    rays: BeamModel
    places: Places
    known: IntArray
    about: tuple[float, float] = (0.0, math.pi)

    @property
    def anchoring(self) -> Anchoring:
        """How the model's points find their cells."""
        p = self.model.parameters
        return Anchoring(p.field_anchor == "half_cell", p.origin_yaw == "use")

    def to_map(self, cells: FloatArray) -> FloatArray:
        """Poses (N, 3) in map of columns, rows [cells, continuous] and yaws in the field's frame."""
        field, turned = self.model.field, self.model.parameters.origin_yaw == "use"
        shift = 0.5 if self.model.parameters.field_anchor == "half_cell" else 0.0
        origin = np.array([*field.origin[:2], field.origin[2] if turned else 0.0])
        return se2.compose(origin, np.column_stack([(cells[:, :2] - shift) * field.resolution, cells[:, 2]]))

    def log_stray(self, r_max: float) -> float:
        """Log of the mean likelihood of an endpoint in any known cell: what beams score that are not of this map."""
        return float(np.log(self.known @ np.exp(self.model.table(r_max)[:-1]) / self.known.sum()))


@final
@dataclass(frozen=True, slots=True, eq=False)
class Sight:
    """One scan, from its own base: beams with a return, and ``rays``, all beams."""

    beams: Beams
    rays: Beams


@final
@dataclass(frozen=True, slots=True, eq=False)
class Stretch:
    """A few scans that follow each other, joined rigidly as seen from the last of them, scan number ``last``."""

    last: int
    beams: Beams


@final
@dataclass(frozen=True, slots=True, eq=False)
class View:
    """What the robot saw: ``sights`` in order of time, the last one now, and the odometry between them.

    ``beams`` are those with a return of all sights joined rigidly, ``stretches`` shorter pieces of the way. Bearings of
    landmarks are as from now. ``odometry`` is None for a single sight; ``ways`` (n − 1,) [m] is how far the robot moved
    between sights.
    """

    beams: Beams
    sights: tuple[Sight, ...]
    odometry: Odometry | None = None
    ways: FloatArray = field(default_factory=lambda: np.empty(0))
    stretches: tuple[Stretch, ...] = ()
    bearings: tuple[Bearings, ...] = ()
    bearing_model: BearingModel | None = None


def allowed_cells(
    grid: OccupancyGrid,
    policy: BaseCells,
    region: tuple[float, float, float, float] | None = None,
    disc: tuple[float, float, float] | None = None,
) -> BoolArray:
    """Cells (H, W) whose centre may be the base: by ``policy`` (``base_cells``), in a box and a disc of the map.

    ``region`` is x0, y0, x1, y1 [m], ``disc`` x, y and radius [m].
    """
    allowed = {"free": grid.free, "open": ~grid.occupied, "any": np.ones(grid.cells.shape, bool)}[policy]
    if region is None and disc is None:
        return np.asarray(allowed)
    rows, columns = np.nonzero(allowed)
    centres = grid.to_map(np.column_stack([columns + 0.5, rows + 0.5]))
    inside = np.ones(rows.size, bool)
    if region is not None:
        x0, y0, x1, y1 = region
        low, high = np.minimum([x0, y0], [x1, y1]), np.maximum([x0, y0], [x1, y1])
        inside &= ((centres >= low) & (centres <= high)).all(axis=1)
    if disc is not None:
        inside &= np.hypot(*(centres - disc[:2]).T) <= disc[2]
    limited = np.zeros(grid.cells.shape, bool)
    limited[rows[inside], columns[inside]] = True
    return limited


def count_known(grid: OccupancyGrid, scene_model: LikelihoodField) -> IntArray:
    """How many known cells have each level of the field (L,)."""
    field = scene_model.field
    return np.bincount(field.codes[~grid.unknown], minlength=field.levels.size)


def sightings_of(scene: Scene, bearings: Sequence[Bearings], model: BearingModel | None) -> Sightings:
    """Bearings in the field's cells, and the law of the bearing mixture."""
    if model is None or not bearings:
        return NO_SIGHTINGS
    marks = np.ascontiguousarray(np.concatenate([_marks(scene, one) for one in bearings]))
    sigma, eps = model.parameters.sigma_bearing, model.parameters.eps_outlier
    peak = (1.0 - eps) / (sigma * math.sqrt(se2.TAU))
    most = len(marks) * float(model.log_p(np.zeros(1))[0])
    return Sightings(marks, np.array([peak, -0.5 / sigma**2, eps / se2.TAU, 1e-15, most]))


def _marks(scene: Scene, bearings: Bearings) -> FloatArray:
    count, field = bearings.angles.size, scene.model.field
    poses = np.column_stack([bearings.landmarks.reshape(count, 2), np.zeros(count)])
    column, row, _ = scene.anchoring.to_cells(field, poses)
    camera = np.broadcast_to(bearings.origin / field.resolution, (count, 2))
    return np.column_stack([column, row, bearings.angles, camera])


def for_search(model: LikelihoodField) -> LikelihoodField:
    """The model with the choices that a search needs: Σ log p over the cells' own values, no beam left out."""
    p = dataclasses.replace(model.parameters, combination="log", field_lookup="nearest", do_beamskip=False)
    return dataclasses.replace(model, parameters=p)
