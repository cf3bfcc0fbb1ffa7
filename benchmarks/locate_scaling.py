"""How long a search takes on large maps: ``python -m benchmarks.locate_scaling``; processor time, one core.

Floors like that of samples/office, side by side until the map is as large as asked for, each with other rooms.
"""

from __future__ import annotations

import time

import numpy as np

from mclcli.records import LaserScan
from mclcli.replay.finder import GlobalSearch, make_global_search
from mclcli.search import branching, lattice
from mclcli.sensors.likelihood_field import LikelihoodField
from mclcli.sensors.observation import Observation
from mclcli.settings import profiles
from mclcli.world import distance_field, pyramid
from mclcli.world.occupancy import OccupancyGrid
from mclcli.world.raycast import make_caster
from samples.sim.layouts import office_floor


def tiled(size: int) -> OccupancyGrid:
    """Floors side by side on a map of ``size`` × ``size`` cells of 5 cm."""
    floors = [office_floor(seed).grid for seed in range(6)]
    height, width = floors[0].shape
    cells = np.full((size, size), -1, np.int8)
    number = 0
    for row in range(0, size, height):
        for column in range(0, size, width):
            floor = floors[number % len(floors)][: size - row, : size - column]
            cells[row : row + floor.shape[0], column : column + floor.shape[1]] = floor
            number += 1
    return OccupancyGrid(cells, 0.05, np.zeros(3))


def scan_of(grid: OccupancyGrid, pose: np.ndarray, beams: int) -> LaserScan:
    """A scan with 2 cm of noise."""
    angles = np.arange(beams) * 2.0 * np.pi / beams - np.pi
    directions = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    exact = make_caster(grid).ranges(pose[np.newaxis], np.zeros((beams, 2)), directions, 20.0)[0]
    noisy = exact + np.random.default_rng(1).normal(0.0, 0.02, beams)
    return LaserScan(0, "laser", -np.pi, 2.0 * np.pi / beams, 0.05, 20.0, noisy)


def main() -> None:
    """Measure and print."""
    print("| map | beams | preparing the map | proof | places and shares |\n|---|---|---|---|---|")
    for size in (1000, 2000, 4000):
        grid = tiled(size)
        began = time.process_time()
        model = LikelihoodField(
            distance_field.compute(grid, "exact", 2.0), profiles.build({}).lidars["likelihood_field"]
        )
        search = make_global_search(grid, model, profiles.build({}), pyramid.build)
        prepared = time.process_time() - began
        for beams in (90, 180, 720):
            settings = profiles.build({"locate_beams": beams})
            view = [Observation("/scan", scan_of(grid, np.array([12.0, 5.9, 0.4]), beams), np.zeros(3), np.eye(4))]
            search = GlobalSearch(search.scene, settings)
            seen, scene = search.view(view), search.scene
            assert seen is not None  # noqa: S101 - there is a scan
            began = time.process_time()
            grid_of = lattice.build(seen.beams.endpoints / 0.05, scene.places)
            branching.prepare(model.field, scene.pyramid, grid_of, scene.model.table(20.0)).maximum()
            proof = time.process_time() - began
            search.find(view, 5)  # so that all code is there
            began = time.process_time()
            search.find(view, 5)
            print(
                f"| {size} × {size} | {beams} | {prepared:.2f} s | {1e3 * proof:.0f} ms | "
                f"{1e3 * (time.process_time() - began):.0f} ms |",
                flush=True,
            )


if __name__ == "__main__":
    main()
