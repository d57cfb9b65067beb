"""Sparse factorisation of one symmetric sparsity pattern, ordered once and refactored for every new set of values."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csc_array
from scipy.sparse.linalg import splu

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

SYMMETRIC = {"SymmetricMode": True, "Equil": False}


class SymmetricPattern:
    """Factors symmetric positive definite matrices sharing the lower-triangle entries ``row`` >= ``column``."""

    def __init__(self, row: Indices, column: Indices, size: int) -> None:
        off = row != column
        all_row, all_column = np.concatenate([row, column[off]]), np.concatenate([column, row[off]])
        entry = np.concatenate([np.arange(len(row)), np.flatnonzero(off)])
        laplacian = coo_array((np.where(all_row == all_column, size, -1.0), (all_row, all_column)), shape=(size, size))
        ordering = splu(laplacian.tocsc(), "MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=SYMMETRIC)
        self._place = ordering.perm_c
        numbered = (entry + 1.0, (self._place[all_row], self._place[all_column]))
        self._matrix = csc_array(coo_array(numbered, shape=(size, size)))
        self._matrix.sort_indices()
        self._entry = self._matrix.data.astype(np.intp) - 1

    def factor(self, value: Array) -> SymmetricFactor:
        """Factor the matrix with ``value`` at the pattern's entries; raises ``LinAlgError`` if it is singular."""
        matrix = csc_array((value[self._entry], self._matrix.indices, self._matrix.indptr), shape=self._matrix.shape)
        try:
            return SymmetricFactor(splu(matrix, "NATURAL", diag_pivot_thresh=0.0, options=SYMMETRIC), self._place)
        except RuntimeError as error:
            raise np.linalg.LinAlgError(f"the conduction matrix can't be factored: {error}") from error


class SymmetricFactor:
    """One factorisation, for any number of right-hand sides."""

    def __init__(self, factor: object, place: Indices) -> None:
        self._factor = factor
        self._place = place

    def solve(self, right: Array) -> Array:
        """(N,k) solution for right-hand sides (N,k)."""
        permuted = np.empty_like(right)
        permuted[self._place] = right
        return self._factor.solve(permuted)[self._place]  # type: ignore[attr-defined]
