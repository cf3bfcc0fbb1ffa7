"""An ordinary call of every kernel, by name: what poison is then put into.

Shapes fit together, as callers see to; blocks of 256 and of four beams are crossed.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Make = Callable[[np.random.Generator], list[Any]]

H, W, N, B = 7, 9, 300, 7
_FRAME = (-1.0, 2.0, 0.8, 0.6, 0.6435011087932844, 0.5, 0.5)


def _poses(rng: np.random.Generator, n: int = N) -> NDArray[np.float64]:
    return np.column_stack([rng.uniform(-4.0, 6.0, n), rng.uniform(-1.0, 8.0, n), rng.uniform(-4.0, 4.0, n)])


def _codes(rng: np.random.Generator, kind: str, *shape: int) -> NDArray[Any]:
    return rng.integers(0, 30, shape).astype(kind)


def _field(kind: str, last: Callable[[np.random.Generator], tuple[Any, Any]]) -> Make:
    def make(rng: np.random.Generator) -> list[Any]:
        between, out = last(rng)
        scratch = [np.zeros((5, 256)), np.zeros((4, 256), np.int32)]
        ends = rng.uniform(-6.0, 6.0, 2 * B) * rng.choice([0.2, 1.0])
        return [_codes(rng, kind, H * W), H, W, between, *_FRAME, _poses(rng), ends, out, *scratch]

    return make


def _interpolated(kind: str) -> Make:
    def make(rng: np.random.Generator) -> list[Any]:
        law = np.array([-2.0, 0.5, 0.05, 0.1, 1.0, 2.0, 1e-12])
        scratch = [np.zeros((12, 256)), np.zeros((4, 256), np.int32)]
        ends, cubes = rng.uniform(-3.0, 3.0, 2 * B), bool(rng.integers(2))
        about = [_codes(rng, kind, H * W), H, W, rng.random(30), *_FRAME, _poses(rng), ends]
        return [*about, law, int(rng.choice([0, 1, 16])), cubes, np.zeros(N), *scratch]

    return make


def _mixture(rng: np.random.Generator) -> list[Any]:
    beams = rng.uniform(0.0, 5.0, (5, 2 * B))
    numbers = [5.0, 0.02, 0.2, float(rng.choice([0.0, 0.1])), 0.7, 0.1, 0.1]
    return [beams, np.array([1, 8]), *numbers, rng.uniform(0.0, 6.0, 5 * B), np.zeros((2, 2 * B))]


def _bearing(rng: np.random.Generator) -> list[Any]:
    law = [-2.0, 0.5, 0.05, 1e-15, int(rng.choice([0, 1, 16]))]
    return [_poses(rng), rng.uniform(-1.0, 1.0, (4, 19)), 0.1, 0.2, *law, np.zeros(N), np.zeros((5, 256))]


def _clouds(rng: np.random.Generator) -> list[Any]:
    tables = np.zeros((N, 7)), np.zeros((N, 8)), np.zeros((3, 512))
    return [_poses(rng), rng.random(N), 2.0**20, 2.0**24, *tables]


def _squares(rng: np.random.Generator) -> NDArray[np.uint8]:
    squares = np.zeros((4, H + 2, W + 2), np.uint8)
    squares[:, 1:-1, 1:-1] = rng.integers(0, 2, (4, H, W))
    return squares


def _rays(rng: np.random.Generator) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    yaw, angle = rng.uniform(-4.0, 4.0, 40), rng.uniform(-4.0, 4.0, B)
    poses = np.column_stack([rng.uniform(-2.0, W + 2.0, 40), rng.uniform(-2.0, H + 2.0, 40), np.cos(yaw), np.sin(yaw)])
    return poses, np.column_stack([rng.uniform(-1.0, 1.0, (B, 2)), np.cos(angle), np.sin(angle)])


def _exact(rng: np.random.Generator) -> list[Any]:
    return [_squares(rng), *_rays(rng), 12.0, np.zeros((40, B))]


def _bresenham(rng: np.random.Generator) -> list[Any]:
    return [rng.random((H, W)) < 0.1, *_rays(rng), 12.0, bool(rng.integers(2)), np.zeros((40, B))]


def _approximate(rng: np.random.Generator) -> list[Any]:
    poses, rays = _rays(rng)
    scratch = np.zeros(15 * 128), np.zeros(129)
    return [_squares(rng).ravel(), H, W, poses, np.ascontiguousarray(rays.T), 12.0, np.zeros(40 * B), *scratch]


def _bins(rng: np.random.Generator) -> NDArray[np.int64]:
    return rng.integers(-3, 4, (N, 3))


def _numbering(rng: np.random.Generator) -> list[Any]:
    return [_bins(rng), np.zeros(N, np.int64), np.zeros(N, np.int64), np.zeros(1, np.int64), np.zeros(1024, np.int64)]


def _joining(rng: np.random.Generator) -> list[Any]:
    """Bins that are all different, each in a place of the table of its own."""
    index = np.column_stack([np.arange(N), np.zeros(N), np.zeros(N)]).astype(np.int64)
    table = np.full(1024, -1)
    table[rng.permutation(1024)[:N]] = np.arange(N)
    return [index, np.arange(N), table, 36, np.zeros(N, np.int64)]


def _spread(kind: str) -> Make:
    return lambda rng: [
        _codes(rng, kind, H, W), rng.integers(0, 99, 31).astype(np.uint8), -3, -2, np.zeros((14, 15), np.uint8),
    ]  # fmt: skip


def _shape() -> NDArray[np.int64]:
    return np.array([5, H, W, 0, 2])


def _look(kind: str) -> Make:
    def make(rng: np.random.Generator) -> list[Any]:
        height = width = 16
        stride, angles = 40, 3
        starts = rng.integers(0, 200, (angles, B)).astype(np.int32)
        cells = rng.integers(0, 20, 200 + 23 * stride + 40).astype(np.uint8)
        pool, table = rng.integers(0, 256, 5 + H * W).astype(np.uint8), -rng.random(256)
        ends, counts = rng.integers(-5, 6, (angles, B, 2)).astype(np.int32), np.ones((height, width), np.int32)
        plane = [cells, stride, starts, 0.0, 0.05, pool, _shape(), table]
        marks, law = rng.uniform(-3.0, 3.0, (2, 5)), np.array([0.9, -2.0, 0.1, 1e-15, 0.5])
        world = [_codes(rng, kind, height, width), ends, counts, -rng.random(31), marks, law, np.arange(3.0)]
        nodes = np.array([[a, r, c] for a in range(angles) for r in range(2) for c in range(2)], np.int32)
        room = int(rng.choice([4, 4000]))
        alpha = float(rng.choice([0.0, 0.5]))
        task = [nodes, np.sort(rng.integers(0, 90, len(nodes))).astype(np.int32), 3.0, alpha, rng.random(60)]
        found = [np.zeros(room, np.int64), np.zeros(room), np.array([2**62, 0]), np.array([-9.0, 0.0])]
        return [*plane, *world, *task, *found, np.zeros(64, np.uint16)]

    return make


def _sweep(rng: np.random.Generator) -> list[Any]:
    return make_sweep(rng, room=int(rng.choice([2048, 6000])))


def make_sweep(rng: np.random.Generator, *, room: int) -> list[Any]:
    """Two rows of 40 coarse nodes, six of 158 fine ones, two groups of angles of which the second has one."""
    coarse_width, fine_width = 70, 170
    coarse = rng.integers(0, 9, 8 * coarse_width + 64 + 50).astype(np.uint8)
    fine = rng.integers(0, 9, 8 * 5 * fine_width + 160 + 32 + 50).astype(np.uint8)
    coarse_starts = rng.integers(0, 50, (2, B)).astype(np.int32)
    fine_starts = rng.integers(0, 50, (5, B)).astype(np.int32)
    counts = [rng.integers(0, 2, shape).astype(np.int32) for shape in ((2, 40), (6, 158))]
    planes = [coarse, coarse_width, coarse_starts, counts[0], fine, fine_width, fine_starts, counts[1]]
    out = [np.zeros((room, 3), np.int32), np.zeros(room, np.int32), np.zeros(4, np.int64), np.zeros(1)]
    return [*planes, 20, 24, rng.random(25), *out, np.zeros(32, np.uint16), np.zeros(32, np.uint16)]


def _near(rng: np.random.Generator) -> list[Any]:
    return [
        rng.integers(0, 12, (H, 600)).astype(np.uint8),
        121,
        np.zeros((H, 600), np.uint16),
        np.zeros(628, np.uint16),
    ]


def _envelopes(columns: str, out: str) -> Make:
    return lambda rng: [
        rng.integers(0, 40, (H, W)).astype(columns), 900, np.zeros((H, W), out), np.zeros((2, W), np.int64),
    ]  # fmt: skip


def _labelled(rng: np.random.Generator) -> list[Any]:
    return [_poses(rng), rng.integers(0, 3, N), rng.random(N)]


def _rows(rng: np.random.Generator) -> list[Any]:
    rows, prefix = np.column_stack([_poses(rng, 40), rng.random(40)]), np.frombuffer(b"12,0.5,", np.uint8)
    return [rows, 0, prefix, np.zeros(40 * (prefix.size + 32 * 5), np.uint8), np.zeros(2, np.int64)]


_BOTH: Final = ("u2", "u4")
CASES: Final[dict[str, tuple[Make, ...]]] = {
    "beam_mixture.textbook": (_mixture,),
    "beam_mixture.sum_log": (lambda rng: [rng.random((40, 19)), 1e-12, np.zeros(40)],),
    "bearing.sum_log_p": (_bearing,),
    "brushfire.two_pass_chamfer": (lambda rng: [np.where(rng.random((H, W)) < 0.1, 0.0, np.inf)],),
    "clouds.rounded_rows": (_clouds,),
    "interpolated_field.sum_interpolated": tuple(_interpolated(kind) for kind in _BOTH),
    "leaves.look": tuple(_look(kind) for kind in _BOTH),
    "leaves.spread": tuple(_spread(kind) for kind in _BOTH),
    "likelihood_field.sum_log_p": tuple(_field(k, lambda rng: (rng.random(31), np.zeros(N))) for k in _BOTH),
    "likelihood_field.look_up": (
        _field("u2", lambda _: (30, np.zeros((B, N), "u2"))),
        _field("u4", lambda _: (30, np.zeros((B, N), "u4"))),
    ),
    "likelihood_field.sum_looked_up": (
        lambda rng: [_codes(rng, "u2", B, N), rng.random(30), np.zeros(N)],
        lambda rng: [_codes(rng, "u4", B, N), rng.random(30), np.zeros(N)],
    ),
    "likelihood_field.count_below": (
        lambda rng: [_codes(rng, "u2", B, N), 9, np.zeros(B, np.int64)],
        lambda rng: [_codes(rng, "u4", B, N), 9, np.zeros(B, np.int64)],
    ),
    "moments.mean_and_covariance": (
        lambda rng: [_poses(rng), rng.random(N), np.zeros(3), np.zeros((3, 3)), np.zeros((6, 128)), np.zeros((65, 6))],
    ),
    "moments.count_near": (lambda rng: [_poses(rng), 0.0, 1.0, 2.0, np.zeros(1, np.int64)],),
    "moments.lagged_sums": (lambda rng: [rng.random(N), np.zeros(20), np.zeros(128), np.zeros((65, 1))],),
    "particles.ancestors": (
        lambda rng: [np.sort(rng.random(N)), np.sort(rng.random(2 * N)), np.zeros(2 * N, np.int64)],
    ),
    "particles.turn_move_turn": (
        lambda rng: [
            _poses(rng), rng.normal(size=(N, 3)), rng.random(3), rng.random(3), np.zeros((N, 3)), np.zeros((3, 512)),
        ],
    ),
    "particles.bins": (lambda rng: [_poses(rng), 0.5, 0.17, int(rng.choice([0, 36])), np.zeros((N, 3), np.int64)],),
    "particles.widths": (lambda rng: [_bins(rng), np.zeros(3, np.int64)],),
    "particles.number_bins": (_numbering,),
    "particles.join_neighbours": (_joining,),
    "particles.mean_sums_by_label": (lambda rng: [*_labelled(rng), np.zeros((3, 4)), np.zeros((3, 512))],),
    "particles.covariance_sums_by_label": (lambda rng: [*_labelled(rng), rng.random((3, 3)), np.zeros((3, 3, 3))],),
    "raycast.fill_squares": (lambda rng: [rng.random((H, W)) < 0.1, np.zeros((4, H + 2, W + 2), np.uint8)],),
    "raycast.exact": (_exact,),
    "raycast.bresenham": (_bresenham,),
    "raycast.in_metres": (lambda rng: [rng.uniform(0.0, 12.0, N), 12.0, 0.05, 0.6, 0.6],),
    "raycast_in_step.approximate": (_approximate,),
    "squared_distance.lower_envelopes": (_envelopes("u2", "u2"), _envelopes("u2", "u4"), _envelopes("u4", "u4")),
    "squared_distance.near": (_near,),
    "sweep.deal": (
        lambda rng: [
            rng.integers(0, 256, 5 + H * W).astype(np.uint8), _shape(), rng.integers(0, 99, 256).astype(np.uint8),
            -3, -2, np.zeros((8, 12, 3), np.uint8),
        ],
    ),
    "sweep.sweep": (_sweep,),
    "text.put_rows": (_rows,),
    "trigonometry.cos_sin": (lambda rng: [rng.uniform(-9.0, 9.0, N), np.zeros(N), np.zeros(N)],),
}  # fmt: skip
