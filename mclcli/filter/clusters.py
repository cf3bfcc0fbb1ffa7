"""Clusters of particles: connected components of occupied bins, as nav2_amcl forms its hypotheses.

Bins are those of ``mclcli.filter.kld``; two are connected if they touch at a face, an edge or a corner (26 neighbours),
and by default also across the half turn, where nav2_amcl cuts a belief that looks backwards in two.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

from mclcli.filter.kld import YAW_BINS, bins, number_bins, pack
from mclcli.geometry import se2
from mclcli.geometry.trigonometry import cos_sin
from mclcli.native.backend import NUMPY, Backend
from mclcli.records import Estimate

if TYPE_CHECKING:
    from types import SimpleNamespace

    from mclcli.arrays import FloatArray, IntArray

_HALF_OF_26 = [offset for offset in itertools.product((-1, 0, 1), repeat=3) if offset > (0, 0, 0)]
_OVER_THE_HALF_TURN = [(dx, dy, 1 - YAW_BINS) for dx, dy in itertools.product((-1, 0, 1), repeat=2)]


@final
@dataclass(frozen=True, slots=True, eq=False)
class Clusters:
    """C clusters of N particles, the heaviest first; of equal ones, the one whose first particle comes first.

    ``labels`` (N,) says which cluster each particle is in; ``weights`` (C,) sum to what the particles' do.
    ``means`` (C, 3) have circular yaw; ``covariances`` (C, 3, 3) are Σ w r rᵀ / Σ w of r = (dx, dy, wrap(dyaw)).
    ``resultants`` (C,) in [0, 1] are the mean resultant lengths R of yaw: nav2_amcl states −2 ln R as its variance (and
    −2 ln(R·weight) for a cluster).
    """

    labels: IntArray
    weights: FloatArray
    means: FloatArray
    covariances: FloatArray
    resultants: FloatArray

    @property
    def heaviest(self) -> Estimate:
        """Mean and covariance of the heaviest cluster."""
        return Estimate(self.means[0], self.covariances[0])


def find(poses: FloatArray, weights: FloatArray, *, wrap_yaw: bool = True, backend: Backend = NUMPY) -> Clusters:
    """Clusters of poses (N, 3) with weights (N,) ≥ 0, N ≥ 1; O(N log N).

    A cluster without weight counts its particles equally. Without ``wrap_yaw`` headings of −π and π are apart.
    """
    index = bins(poses, wrap_yaw=wrap_yaw, backend=backend)
    together = _all_touch(index, backend)
    component = np.zeros(len(index), np.int64) if together else _components(index, backend, wrap_yaw=wrap_yaw)
    labels, total = _heaviest_first(component, weights)
    share = _share(labels, weights, total)
    means, resultants = _means(poses, labels, share, backend)
    return Clusters(labels, total, means, _covariances(poses, means, labels, share, backend), resultants)


def _all_touch(index: IntArray, backend: Backend) -> bool:
    """Whether bins (N, 3) all touch each other, as those of a tracked robot do."""
    kernels = backend.kernels("particles")
    if kernels is None:
        return bool((index.max(axis=0) - index.min(axis=0) <= 1).all())
    widths = np.empty(3, np.int64)
    kernels.widths(index, widths)
    return bool(widths.max() <= 1)


def _components(index: IntArray, backend: Backend, *, wrap_yaw: bool) -> IntArray:
    """Component (N,) of each particle's bin (N, 3), numbered in the order of their first particles."""
    kernels = backend.kernels("particles")
    if kernels is not None:
        return _components_compiled(kernels, index, wrap_yaw=wrap_yaw)
    keys, strides = pack(index)
    occupied, first, bin_of = np.unique(keys, return_index=True, return_inverse=True)
    edges = _edges(occupied, np.arange(occupied.size), np.array(_HALF_OF_26) @ strides)
    if wrap_yaw:  # from the last bin of yaw to the first
        last = np.flatnonzero(index[first, 2] == YAW_BINS // 2 - 1)
        edges = np.concatenate([edges, _edges(occupied, last, np.array(_OVER_THE_HALF_TURN) @ strides)], axis=1)
    root = _roots(occupied.size, edges)[bin_of.reshape(-1)]
    _, first, component = np.unique(root, return_index=True, return_inverse=True)
    return np.argsort(np.argsort(first))[component.reshape(-1)]


def _components_compiled(kernels: SimpleNamespace, index: IntArray, *, wrap_yaw: bool) -> IntArray:
    """The same: bins are numbered as they first appear, so the least number in a component is its first particle's."""
    number, first, table = number_bins(kernels, index)
    root = np.empty(first.size, np.int64)
    kernels.join_neighbours(index, first, table, YAW_BINS if wrap_yaw else 0, root)
    is_root = root == np.arange(root.size)
    return (np.cumsum(is_root) - 1)[root][number]


def _edges(occupied: IntArray, ones: IntArray, steps: IntArray) -> IntArray:
    """Pairs (2, E) of occupied bins: one of ``ones`` (M,), and what is a step (S,) of bin numbers from it."""
    wanted = occupied[ones] + steps[:, np.newaxis]
    at = np.minimum(np.searchsorted(occupied, wanted), occupied.size - 1)
    step, one = np.nonzero(occupied[at] == wanted)
    return np.stack([ones[one], at[step, one]])


def _roots(n: int, edges: IntArray) -> IntArray:
    """Least member (n,) of each node's component: roots take the least root they touch, until none changes."""
    root = np.arange(n)
    while True:
        one, other = root[edges[0]], root[edges[1]]
        if np.array_equal(one, other):
            return root
        least = np.minimum(one, other)
        np.minimum.at(root, one, least)
        np.minimum.at(root, other, least)
        while not np.array_equal(root, root[root]):
            root = root[root]


def _heaviest_first(component: IntArray, weights: FloatArray) -> tuple[IntArray, FloatArray]:
    """Labels (N,) and weights (C,) of the components in falling order of weight."""
    total = np.bincount(component, weights).astype(np.float64)
    if total.size == 1:
        return component, total
    order = np.argsort(-total, kind="stable")
    return np.argsort(order)[component], total[order]


def _share(labels: IntArray, weights: FloatArray, total: FloatArray) -> FloatArray:
    """Weight (N,) of each particle within its cluster."""
    if (total > 0.0).all():
        return weights / total[labels]
    equal = 1.0 / np.bincount(labels)
    return np.divide(weights, total[labels], out=equal[labels], where=total[labels] > 0.0)


def _means(poses: FloatArray, labels: IntArray, share: FloatArray, backend: Backend) -> tuple[FloatArray, FloatArray]:
    """Means (C, 3) and mean resultant lengths (C,)."""
    sums = np.zeros((int(labels.max()) + 1, 4))
    kernels = backend.kernels("particles")
    if kernels is not None:
        kernels.mean_sums_by_label(np.ascontiguousarray(poses), labels, share, sums, np.empty((3, 512)))
    else:
        for i, values in enumerate((poses[:, 0], poses[:, 1], *cos_sin(poses[:, 2]))):
            sums[:, i] = np.bincount(labels, share * values)
    x, y, c, s = sums.T
    return np.stack([x, y, np.arctan2(s, c)], axis=-1), np.minimum(np.hypot(c, s), 1.0)


def _covariances(
    poses: FloatArray, means: FloatArray, labels: IntArray, share: FloatArray, backend: Backend
) -> FloatArray:
    covariances, kernels = np.zeros((means.shape[0], 3, 3)), backend.kernels("particles")
    if kernels is not None:
        kernels.covariance_sums_by_label(np.ascontiguousarray(poses), labels, share, means, covariances)
    else:
        residual = poses - means[labels]
        residual[:, 2] = se2.wrap(residual[:, 2])
        for i in range(3):
            for j in range(i + 1):
                covariances[:, i, j] = np.bincount(labels, share * residual[:, i] * residual[:, j])
    return covariances + np.tril(covariances, -1).transpose(0, 2, 1)
