"""Symmetric matrices as six numbers do what NumPy's do."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from mclcli.geometry import symmetric
from mclcli.geometry.symmetric import Symmetric

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray

numbers = st.floats(-3.0, 3.0).map(lambda value: round(value, 3))
matrices = st.tuples(*[numbers] * 6).map(lambda values: Symmetric(*values))


def close(found: Symmetric, wanted: FloatArray) -> None:
    np.testing.assert_allclose(found.matrix(), wanted, rtol=1e-9, atol=1e-9)


@given(matrices, matrices)
def test_sums_and_products(a: Symmetric, b: Symmetric) -> None:
    close(Symmetric.of(a.matrix()), a.matrix())
    close(symmetric.plus(a, b, -2.0), a.matrix() - 2.0 * b.matrix())
    close(symmetric.between(a, b), a.matrix() @ b.matrix() @ a.matrix())


@given(matrices)
def test_an_inverse_undoes_its_matrix(a: Symmetric) -> None:
    regular = symmetric.plus(symmetric.between(a, a), Symmetric(1.0, 0.0, 0.0, 1.0, 0.0, 1.0))
    regular = symmetric.plus(symmetric.between(regular, Symmetric(1.0, 0.0, 0.0, 1.0, 0.0, 1.0)), regular)
    np.testing.assert_allclose(symmetric.inverse(regular).matrix() @ regular.matrix(), np.eye(3), atol=1e-6)


@given(matrices)
def test_the_positive_part_keeps_the_directions_that_are_not_negative(a: Symmetric) -> None:
    values, vectors = np.linalg.eigh(a.matrix())
    close(symmetric.positive(a), (vectors * np.maximum(values, 0.0)) @ vectors.T)
    if values[0] > 1e-6:
        assert symmetric.positive(a) is a


@given(matrices, numbers, numbers)
def test_moving_turns_by_the_error_of_yaw(a: Symmetric, dx: float, dy: float) -> None:
    jacobian = np.array([[1.0, 0.0, -dy], [0.0, 1.0, dx], [0.0, 0.0, 1.0]])
    close(symmetric.moved(a, dx, dy), jacobian @ a.matrix() @ jacobian.T)


@given(matrices)
def test_correlations_are_those_of_the_matrix_scaled(a: Symmetric) -> None:
    covariance = symmetric.plus(
        symmetric.between(a, Symmetric(1.0, 0.0, 0.0, 1.0, 0.0, 1.0)), Symmetric(0.1, 0.0, 0.0, 0.1, 0.0, 0.1)
    )
    deviations = np.sqrt(np.diag(covariance.matrix()))
    wanted = np.linalg.det(covariance.matrix() / np.outer(deviations, deviations))
    np.testing.assert_allclose(symmetric.correlation_determinant(covariance), wanted, rtol=0, atol=1e-9)
    assert symmetric.correlation_determinant(covariance._replace(yy=0.0)) == 0.0
