"""Symmetric matrices of order 2 and 3 as the rows of a cone of kind "semidefinite", and back."""

import numpy as np


def _places(order):
    """Rows and columns of the upper triangle, column by column, and the factor of each entry."""
    column, row = np.tril_indices(order)
    return row, column, np.where(row == column, 1.0, np.sqrt(2.0))


def semidefinite_vector(S):
    """Rows of symmetric matrices S (..., 2, 2) or (..., 3, 3): float64 (..., 3) or (..., 6).

    They are the upper triangle column by column, off-diagonals times sqrt(2): (a11, s a12, a22, s a13, s a23, a33).
    The inner product of rows is hence that of matrices, the trace of their product. Only upper triangles are read.
    """
    S = np.asarray(S, np.float64)
    if S.ndim < 2 or S.shape[-2:] not in ((2, 2), (3, 3)):
        raise ValueError(f"S: expected matrices (..., 2, 2) or (..., 3, 3), got {S.shape}")
    row, column, factor = _places(S.shape[-1])
    return S[..., row, column] * factor


def semidefinite_matrix(rows):
    """The symmetric matrices (..., 2, 2) or (..., 3, 3) whose semidefinite_vector() is `rows` (..., 3) or (..., 6)."""
    rows = np.asarray(rows, np.float64)
    if rows.ndim < 1 or rows.shape[-1] not in (3, 6):
        raise ValueError(f"rows: expected (..., 3) or (..., 6), got {rows.shape}")
    order = 2 if rows.shape[-1] == 3 else 3
    row, column, factor = _places(order)
    S = np.empty((*rows.shape[:-1], order, order))
    S[..., row, column] = S[..., column, row] = rows / factor
    return S
