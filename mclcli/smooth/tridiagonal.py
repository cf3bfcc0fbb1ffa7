"""Block-tridiagonal systems of 3×3 blocks: solutions, determinants, and the diagonal blocks of the inverse.

A chain of n poses has n diagonal blocks A_k and n − 1 blocks U_k above them, between poses k and k + 1. The chains of
a batch stand one after the other in one banded matrix with nothing between them, so that one Cholesky factorisation
serves all; each gets the bits that it would get alone. Source: Golub and Van Loan 2013, *Matrix Computations*,
section 4.3.5.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

if TYPE_CHECKING:
    from mclcli.arrays import FloatArray

_BAND = 6  # diagonals of a lower triangle whose blocks reach to the next pose


@final
@dataclass(frozen=True, slots=True, eq=False)
class Factor:
    """Cholesky factor L of a batch of systems, as LAPACK's band: ``band`` (6, 3·m·n) for m chains of n poses."""

    band: FloatArray
    chains: int

    def solve(self, right: FloatArray) -> FloatArray:
        """x (m, n, 3) of A x = ``right`` (m, n, 3)."""
        from scipy.linalg import cho_solve_banded

        found = cho_solve_banded((self.band, True), right.ravel(), check_finite=False)
        return np.asarray(found, dtype=np.float64).reshape(right.shape)

    def log_determinants(self) -> FloatArray:
        """Logarithms (m,) of the determinants of the systems."""
        return np.asarray(2.0 * np.log(self.band[0]).reshape(self.chains, -1).sum(axis=1))

    def marginals(self) -> FloatArray:
        """Diagonal blocks (m, n, 3, 3) of the inverses: the covariance of every pose of every chain.

        Backwards from the last pose, C_k = S_k⁻¹ + K_k C_{k+1} K_kᵀ with S_k = L_kk L_kkᵀ and K_k = L_kk⁻ᵀ L_{k+1,k}ᵀ.
        Source: Rauch, Tung and Striebel 1965, in terms of information.
        """
        own, gains = self._blocks()
        found = own.copy()
        for k in range(own.shape[1] - 2, -1, -1):
            gain = gains[:, k]
            found[:, k] += gain @ found[:, k + 1] @ gain.transpose(0, 2, 1)
        return 0.5 * (found + found.transpose(0, 1, 3, 2))

    def _blocks(self) -> tuple[FloatArray, FloatArray]:
        """S_k⁻¹ (m, n, 3, 3) and K_k (m, n − 1, 3, 3)."""
        columns = self.band.reshape(_BAND, self.chains, -1, 3)  # diagonal, chain, pose, column
        own = np.zeros((self.chains, columns.shape[2], 3, 3))
        below = np.zeros_like(own)
        for column in range(3):
            for row in range(column, 3):
                own[:, :, row, column] = columns[row - column, :, :, column]
            for row in range(3):
                below[:, :, row, column] = columns[row + 3 - column, :, :, column]
        inverse = np.linalg.inv(own)
        turned = inverse.transpose(0, 1, 3, 2)
        return turned @ inverse, turned[:, :-1] @ below[:, :-1].transpose(0, 1, 3, 2)


def factorise(diagonal: FloatArray, above: FloatArray) -> Factor:
    """Cholesky factor of systems with blocks ``diagonal`` (m, n, 3, 3), symmetric, and ``above`` (m, n − 1, 3, 3).

    Raises
    ------
    numpy.linalg.LinAlgError
        A system is not positive definite.

    """
    from scipy.linalg import cholesky_banded

    chains, poses = diagonal.shape[:2]
    band = np.zeros((_BAND, chains, poses, 3))
    for column in range(3):
        for row in range(column, 3):
            band[row - column, :, :, column] = diagonal[:, :, row, column]
        for row in range(3):
            band[row + 3 - column, :, :-1, column] = above[:, :, column, row]  # that of the transposed block below
    lower = cholesky_banded(band.reshape(_BAND, -1), lower=True, check_finite=False)
    return Factor(np.asarray(lower, dtype=np.float64), chains)
