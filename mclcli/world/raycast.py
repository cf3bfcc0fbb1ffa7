"""Expected ranges: how far a beam goes from a pose before it meets an obstacle.

Four ways to cast a ray, by the name of the parameter ``raycast``:

- ``exact``: r at which the ray enters the first blocked cell, 0 if it starts in one. A ray through a corner between two
  blocked cells stops there; touching the corner of one cell, or a border, is not entering it.
- ``approximate``: as exact, but blind to pieces shorter than ε = 1/256 cell that a ray cuts from an obstacle's corner.
  With [a, b) the first piece at least ε long, what it returns is at most a, and at least the exact range less ε; where
  the very first piece is that long, both agree within ε. Walls are never passed, not even those whose cells hold
  together by their corners only.
- ``bresenham_nav2``, ``bresenham_beluga``: cell by cell as nav2_amcl and Beluga do, between centres of cells.

Leaving the map meets nothing; a ray from outside may enter it (the last two say 0 and the limit outside).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Literal, final, get_args

import numpy as np

from mclcli.native import backend

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mclcli.arrays import BoolArray, FloatArray
    from mclcli.world.occupancy import OccupancyGrid

CastMethod = Literal["exact", "approximate", "bresenham_nav2", "bresenham_beluga"]
RayUnknown = Literal["occupied", "free"]

_LANES: Final = 128  # rays that the approximate kernel casts together


@final
@dataclass(frozen=True, slots=True, eq=False)
class RayCaster:
    """Rays over one map, made by ``make_caster``.

    ``table`` is what the method looks up: blocked cells (H, W) bool, or open squares (4, H + 2, W + 2) uint8.
    ``resolution`` [m] and ``origin`` (3,) (x, y, yaw) place its cells in the map.
    """

    method: CastMethod
    table: NDArray[np.bool_ | np.uint8]
    resolution: float
    origin: FloatArray

    def ranges(
        self,
        poses: FloatArray,
        origins: FloatArray,
        directions: FloatArray,
        max_range: float,
    ) -> FloatArray:
        """Expected ranges (N, B) [m] along the beams, ``max_range`` where they meet nothing; NaN for poses not finite.

        They are at most ``max_range``, but for ``bresenham_nav2``, which may see a cell further.

        Parameters
        ----------
        poses
            (N, 3) of the base in map.
        origins, directions
            (B, 2) in the base frame. A direction shorter than 1 belongs to a tilted beam, which goes that much less far
            over the ground than its range.
        max_range
            Beyond this nothing is seen [m].

        Raises
        ------
        ValueError
            If a direction is longer than 1, a beam is not finite, or ``max_range`` is not a finite length above 0.

        """
        if not (np.isfinite(max_range) and max_range > 0.0):
            raise ValueError(f"max_range: expected a finite length above 0, got {max_range}")
        if not (np.isfinite(origins).all() and (np.linalg.norm(directions, axis=1) <= 1.0 + 1e-9).all()):
            raise ValueError("origins and directions: expected finite beams whose directions are at most 1 long")
        out = np.empty((poses.shape[0], origins.shape[0]))
        rays = np.column_stack([origins / self.resolution, directions])
        limit = max_range / self.resolution
        self._cast(self._to_cells(poses), rays, limit, out)
        most = np.inf if self.method == "bresenham_nav2" else max_range
        backend.load("raycast").in_metres(out.reshape(-1), limit, self.resolution, max_range, most)
        return out

    def _cast(self, poses: FloatArray, rays: FloatArray, limit: float, out: FloatArray) -> None:
        if self.method == "exact":
            backend.load("raycast").exact(self.table, poses, rays, limit, out)
        elif self.method == "approximate":
            height, width = (side - 2 for side in self.table.shape[1:])
            scratch = np.empty(15 * _LANES), np.empty(_LANES + 1)
            columns = np.ascontiguousarray(rays.T)
            approximate = backend.load("raycast_in_step").approximate
            approximate(self.table.ravel(), height, width, poses, columns, limit, out.reshape(-1), *scratch)
        else:
            bresenham = backend.load("raycast").bresenham
            bresenham(self.table, poses, rays, limit, self.method == "bresenham_nav2", out)

    def _to_cells(self, poses: FloatArray) -> FloatArray:
        """Column, row [cells, continuous], cosine and sine of the yaw (N, 4), in the frame of the map's cells."""
        if self.method == "bresenham_nav2":  # cells are counted from the middle, centred half a cell off, and level
            half = np.array(self.table.shape[::-1]) // 2
            cells = (poses[:, :2] - (self.origin[:2] + half * self.resolution)) / self.resolution + 0.5 + half
            return np.column_stack([cells, np.cos(poses[:, 2]), np.sin(poses[:, 2])])
        offset, yaw = poses[:, :2] - self.origin[:2], poses[:, 2] - self.origin[2]
        c, s = np.cos(self.origin[2]), np.sin(self.origin[2])
        cells = np.column_stack([c * offset[:, 0] + s * offset[:, 1], c * offset[:, 1] - s * offset[:, 0]])
        return np.column_stack([cells / self.resolution, np.cos(yaw), np.sin(yaw)])


def make_caster(
    grid: OccupancyGrid, *, method: CastMethod = "exact", ray_unknown: RayUnknown = "occupied"
) -> RayCaster:
    """Caster over a map. Occupied cells stop a ray; others that are not free stop it if unknown is ``occupied``.

    Raises
    ------
    ValueError
        If there is no such ``method`` or ``ray_unknown``.

    """
    if method not in get_args(CastMethod) or ray_unknown not in get_args(RayUnknown):
        raise ValueError(f"no such way to cast rays: method {method}, ray_unknown {ray_unknown}")
    blocked = grid.occupied if ray_unknown == "free" else ~grid.free
    table = blocked if method.startswith("bresenham") else _open_squares(blocked)
    table.flags.writeable = False
    return RayCaster(method, table, grid.resolution, grid.origin)


def _open_squares(blocked: BoolArray) -> NDArray[np.uint8]:
    squares = np.empty((4, blocked.shape[0] + 2, blocked.shape[1] + 2), np.uint8)
    backend.load("raycast").fill_squares(blocked, squares)
    return squares
