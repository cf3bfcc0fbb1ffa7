"""Clusters and published poses of nav2_amcl.

It does not wrap yaw, so it is compared without; its variance of yaw is −2 ln R, R not divided by a cluster's weight.
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from mclcli.filter import clusters, estimate, kld
from mclcli.geometry import se2
from tests.data import golden

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray
    from tests.golden.conftest import Note

SETS = [
    "unimodal",
    "bimodal_60_40",
    "bimodal_nonuniform_weights_40_60",
    "around_pi_wrapped",
    "around_pi_unwrapped",
    "uniform_12m",
]
each = pytest.mark.parametrize("name", SETS)


def case(name: str) -> tuple[dict[str, Any], FloatArray, FloatArray]:
    """One set: what nav2 says of it, its particles and their weights."""
    data = json.loads(golden("clusters.json").read_text())["sets"]
    assert sorted(data) == sorted(SETS)
    one = data[name]
    poses = np.array(one["particles"])
    weights = np.array(one["weights"]) if one["weight_value"] is None else np.full(len(poses), one["weight_value"])
    return one, poses, weights


@each
def test_the_partition_and_each_clusters_statistics(note: Note, name: str) -> None:
    theirs, poses, weights = case(name)
    ours = clusters.find(poses, weights, wrap_yaw=False)
    pairs = sorted(set(zip(theirs["cluster_label"], ours.labels.tolist(), strict=True)))
    assert len(pairs) == len(theirs["clusters"]) == ours.weights.size
    assert np.unique(kld.bins(poses, wrap_yaw=False), axis=0).shape[0] == theirs["n_bins"]
    for label, at in pairs:
        expected, covariance, weight = theirs["clusters"][label], ours.covariances[at], ours.weights[at]
        found = [weight, *ours.means[at]]
        wanted = [expected["weight"], *expected["mean"]]
        found += [covariance[0, 0], covariance[0, 1], covariance[1, 1], -2.0 * np.log(ours.resultants[at] * weight)]
        wanted += [expected[key] for key in ("cov_xx", "cov_xy", "cov_yy", "cov_yaw")]
        worst = float(np.abs(np.subtract(found, wanted)).max())
        assert note("clusters.json", "clusters' weights, means, covariances", worst, len(found)) <= 1e-9


@pytest.mark.parametrize("name", [name for name in SETS if name != "uniform_12m"])  # there two tie for the heaviest
def test_the_published_pose_is_the_heaviest_clusters(note: Note, name: str) -> None:
    theirs, poses, weights = case(name)
    ours = clusters.find(poses, weights, wrap_yaw=False)
    members = np.array(theirs["cluster_label"]) == theirs["heaviest_cluster"]
    np.testing.assert_array_equal(ours.labels == 0, members)
    worst = float(np.abs(ours.heaviest.pose - theirs["published_pose"]).max())
    assert note("clusters.json", "published poses", worst, 3) <= 1e-9


@each
def test_the_published_covariance_is_the_whole_sets(name: str) -> None:
    theirs, poses, weights = case(name)
    whole = estimate.weighted_mean(poses, weights / weights.sum())
    published = np.array(theirs["published_covariance_6x6_row_major"]).reshape(6, 6)
    np.testing.assert_allclose(whole.covariance[:2, :2], published[:2, :2], rtol=0, atol=1e-9)
    np.testing.assert_allclose(whole.pose, theirs["set"]["mean"], rtol=0, atol=1e-9)
    resultant = np.abs(np.sum(weights * np.exp(1j * poses[:, 2])) / weights.sum())
    assert -2.0 * np.log(resultant) == pytest.approx(published[5, 5], abs=1e-9)


def test_looking_backwards_is_one_cluster_here_and_two_there() -> None:
    theirs, poses, weights = case("around_pi_wrapped")
    ours = clusters.find(poses, weights)
    assert len(theirs["clusters"]) == 2
    assert ours.weights.size == 1
    assert theirs["published_pose"][2] == pytest.approx(-3.006, abs=1e-3)
    np.testing.assert_allclose(ours.heaviest.pose, theirs["set"]["mean"], rtol=0, atol=1e-9)
    assert -2.0 * np.log(ours.resultants[0]) == pytest.approx(theirs["set"]["cov_yaw"], abs=1e-9)


def test_whole_turns_do_not_matter_here() -> None:
    _, poses, weights = case("around_pi_unwrapped")
    turned = poses.copy()
    turned[:, 2] = se2.wrap(poses[:, 2])
    one, other = clusters.find(poses, weights), clusters.find(turned, weights)
    np.testing.assert_array_equal(one.labels, other.labels)
    np.testing.assert_allclose(one.means, other.means, rtol=0, atol=1e-12)
