"""Compiled loops over particles against the NumPy beside them: the same bits."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from mclcli.filter import clusters, estimate, kld, resampling
from mclcli.filter.temperature import Correlation, correlate
from mclcli.motion.differential import DifferentialMotion, DifferentialParameters
from mclcli.native.backend import COMPILED
from mclcli.records import Estimate
from tests.kernels.guarded import guarded_arrays
from tests.reference.filter import mean_and_covariance
from tests.support import BACKENDS

if TYPE_CHECKING:
    from collections.abc import Callable

    from mclcli.native.backend import Backend

GENERATOR = np.random.default_rng(7)
CLOUDS = {
    "tight": np.column_stack([GENERATOR.normal(5, 0.1, (3000, 2)), GENERATOR.normal(math.pi, 0.2, 3000)]),
    "all over": np.column_stack([GENERATOR.uniform(-8, 8, (3000, 2)), GENERATOR.uniform(-9, 9, 3000)]),
    "one": np.array([[1.0, -2.0, math.pi]]),
}
WEIGHTS = {name: GENERATOR.dirichlet(np.full(len(poses), 0.3)) for name, poses in CLOUDS.items()}


def by_both(task: Callable[[Backend], Any]) -> list[Any]:
    """What a task returns without and with compiled code."""
    return [task(backend) for backend in BACKENDS]


@pytest.mark.parametrize("scheme", sorted(resampling.RESAMPLERS))
@pytest.mark.parametrize("name", sorted(CLOUDS))
def test_ancestors_are_the_same(scheme: str, name: str) -> None:
    resampler = resampling.RESAMPLERS[scheme]
    for n in (1, 100, 5000):
        one, other = (resampler(WEIGHTS[name], n, np.random.default_rng(3), backend) for backend in BACKENDS)
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("increment", [(0.0, 0.0, 0.0), (0.3, 0.01, 0.2), (-0.3, 0.2, 3.1)])
def test_motion_has_the_same_bits(increment: tuple[float, ...]) -> None:
    parameters, poses = DifferentialParameters(), CLOUDS["all over"]
    normals = np.random.default_rng(1).standard_normal(poses.shape)
    one, other = by_both(
        lambda b: DifferentialMotion(parameters, b).sample(poses, np.array(increment), normals).tobytes()
    )
    assert one == other


@pytest.mark.parametrize("wrap_yaw", [False, True])
@pytest.mark.parametrize("name", sorted(CLOUDS))
def test_clusters_have_the_same_bits(name: str, *, wrap_yaw: bool) -> None:
    one, other = by_both(lambda b: clusters.find(CLOUDS[name], WEIGHTS[name], wrap_yaw=wrap_yaw, backend=b))
    assert isinstance(one, clusters.Clusters)
    assert isinstance(other, clusters.Clusters)
    for field in ("labels", "weights", "means", "covariances", "resultants"):
        assert getattr(one, field).tobytes() == getattr(other, field).tobytes(), field


@pytest.mark.parametrize("name", sorted(CLOUDS))
def test_kld_asks_for_the_same_number(name: str) -> None:
    sizes = []
    for error in (0.001, 0.01, 0.1, 0.8, 1.5):
        wanted = kld.KldParameters(min(20, len(CLOUDS[name])), len(CLOUDS[name]), error)
        one, other = (kld.kld_size(CLOUDS[name], wanted, np.random.default_rng(2), backend) for backend in BACKENDS)
        assert one == other
        sizes.append(one)
    assert sizes == sorted(sizes, reverse=True)
    assert len(set(sizes)) > 2 or name == "one", sizes


SIZES = (1, 2, 7, 8, 9, 127, 128, 129, 136, 255, 257, 1000, 2001, 20_003)  # around NumPy's eights and its halves


@pytest.mark.parametrize("size", SIZES)
def test_mean_and_covariance_have_the_same_bits(size: int) -> None:
    generator = np.random.default_rng(size)
    poses = generator.normal([1.0, -2.0, 3.0], [1.0, 0.5, 0.9], (size, 3))
    weights = generator.dirichlet(np.full(size, 0.3))
    one, other = by_both(lambda b: estimate.weighted_mean(poses, weights, b))
    assert isinstance(one, Estimate)
    assert isinstance(other, Estimate)
    assert one.pose.tobytes() == other.pose.tobytes()
    assert one.covariance.tobytes() == other.covariance.tobytes()
    near, as_near = by_both(lambda b: estimate.count_near(poses, 1.0, -2.0, b))
    assert near == as_near
    assert size < 9 or 0 < as_near < size


@pytest.mark.parametrize("size", [2, 7, 30, 60, 61, 128, 129, 720])
def test_correlations_have_the_same_bits(size: int) -> None:
    each = np.random.default_rng(size).normal(size=(2, size))
    one, other = by_both(lambda b: correlate(each[1], correlate(each[0], backend=b), b))
    assert isinstance(one, Correlation)
    assert isinstance(other, Correlation)
    assert one.covariances.tobytes() == other.covariances.tobytes()


def test_kernels_have_all_the_room_that_they_use(monkeypatch: pytest.MonkeyPatch) -> None:
    """A kernel writes into scratch arrays that its caller measures, and would write beside ones that are too small."""
    poses, weights = CLOUDS["all over"], WEIGHTS["all over"]
    wanted = kld.KldParameters(min_particles=1, max_particles=len(poses))

    def everything() -> list[Any]:
        found = [clusters.find(poses, weights, wrap_yaw=wrap, backend=COMPILED) for wrap in (False, True)]
        return [
            *[one.labels.tolist() for one in found],
            kld.kld_size(poses, wanted, np.random.default_rng(2), COMPILED),
            estimate.weighted_mean(poses, weights, COMPILED).covariance.tolist(),
            estimate.count_near(poses, 1.0, -2.0, COMPILED),
            correlate(weights[:720], correlate(weights[720:1440], backend=COMPILED), COMPILED).covariances.tolist(),
            *[draw(weights, 5000, np.random.default_rng(3), COMPILED).tolist() for draw in resamplers],
        ]

    resamplers = resampling.RESAMPLERS.values()
    expected = everything()  # and the kernels are loaded, whose loader makes arrays as well
    with guarded_arrays(monkeypatch) as given:
        found = everything()
    assert found == expected
    assert len(given) > 20
    assert all(one.is_intact() for one in given)


def test_the_mean_of_many_is_that_of_the_equation() -> None:
    poses, weights = CLOUDS["tight"], WEIGHTS["tight"]
    mean, covariance = mean_and_covariance(poses.tolist(), weights.tolist())
    for found in by_both(lambda b: estimate.weighted_mean(poses, weights, b)):
        assert isinstance(found, Estimate)
        np.testing.assert_allclose(found.pose, mean, rtol=0, atol=1e-12)
        np.testing.assert_allclose(found.covariance, covariance, rtol=0, atol=1e-14)
        assert (found.covariance == found.covariance.T).all()
