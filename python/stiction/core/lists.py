"""Environments of lists, one entry each, copied one after another."""

import numpy as np

from .arrays import FLOATS, as_numpy
from .layout import cone_list, dense_rows, offsets_of, tiles


class _Joined:
    """Environments of lists, one after another."""


def _vectors(name, values, sizes, dtype):
    """A list of vectors, one per environment, as one; None stays None."""
    if values is None or np.isscalar(values):
        return values
    if len(values) != len(sizes):
        raise ValueError(f"{name}: expected one entry per environment ({len(sizes)}), got {len(values)}")
    parts = []
    for env, (value, size) in enumerate(zip(values, sizes)):
        if np.isscalar(value):
            value = np.full(size, value, dtype)
        part = _host(f"{name}[{env}]", value, dtype)
        if part.shape != (size,):
            raise ValueError(f"{name}[{env}]: expected ({size},), got {part.shape}")
        parts.append(part)
    return np.concatenate(parts) if parts else np.zeros(0, dtype)


def _host(name, value, dtype):
    """A list's entry as NumPy's; a list of numbers takes the batch's dtype, an array has to have it."""
    if isinstance(value, (list, tuple)):
        return np.array(value, dtype)
    array = as_numpy(name, value)
    if array.dtype != dtype:
        raise TypeError(f"{name}: expected {dtype}, got {array.dtype}")
    return array


def _friction_list(mu, rows, dims, dtype):
    """mu of lists: numbers, or vectors per row or per cone, as one number per row."""
    if mu is None or np.isscalar(mu):
        return mu
    if len(mu) != len(rows):
        raise ValueError(f"mu: expected one entry per environment ({len(rows)}), got {len(mu)}")
    spread = []
    for env, value in enumerate(mu):
        part = value if np.isscalar(value) else _host(f"mu[{env}]", value, dtype)
        if not np.isscalar(part) and part.shape == (len(dims[env]),) != (rows[env],):
            part = np.repeat(part, dims[env])
        spread.append(part)
    return _vectors("mu", spread, rows, dtype)


def _cone_lists(cones, rows):
    """(kinds, dims) of every environment; cones may be one list for all, or one per environment."""
    per_env = isinstance(cones, (list, tuple)) and len(cones) == len(rows) and \
        all(isinstance(entry, (list, str)) for entry in cones) and any(isinstance(entry, list) for entry in cones)
    made = []
    for env, n in enumerate(rows):
        kinds, dims = cone_list("cones", ("friction" if cones is None else cones[env] if per_env else cones), n)
        tiles(f"cones[env {env}]", dims, n)
        made.append((kinds, dims))
    return made


def _join(parts, dtype):
    return np.concatenate(parts) if parts else np.zeros(0, dtype)


def join_matrices(A, b, cones, mu, R, lo, hi, groups):
    out = _Joined()
    first = A[0].data if A and hasattr(A[0], "indptr") else as_numpy("A[0]", A[0]) if A else np.zeros(0)
    out.dtype = str(first.dtype)
    if out.dtype not in FLOATS:
        raise TypeError(f"A[0]: expected float32 or float64, got {out.dtype}")
    values, columns, row_sizes, rows = [], [], [], []
    for env, matrix in enumerate(A):
        sparse = hasattr(matrix, "indptr")
        dense = None if sparse else _host(f"A[{env}]", matrix, out.dtype)
        shape = matrix.shape if sparse else dense.shape
        if len(shape) != 2 or shape[0] != shape[1]:
            raise ValueError(f"A[{env}]: expected a square matrix, got {shape}")
        rows.append(shape[0])
        if sparse:
            values.append(_host(f"A[{env}].data", matrix.data, out.dtype))
            columns.append(matrix.indices.astype(np.int32))
            row_sizes.append(np.diff(matrix.indptr).astype(np.int64))
        else:
            values.append(dense.reshape(-1))
            columns.append(None)
            row_sizes.append(np.full(shape[0], shape[0], np.int64))
    out.A = _join(values, out.dtype)
    if any(column is not None for column in columns):
        columns = [np.tile(np.arange(n, dtype=np.int32), n) if c is None else c for c, n in zip(columns, rows)]
        out.structure = {"row_offsets": offsets_of(_join(row_sizes, np.int64)), "column": _join(columns, np.int32)}
    else:
        out.structure = dense_rows(np.array(rows, np.int64))
    if len(b) != len(A):
        raise ValueError(f"b: expected one entry per environment ({len(A)}), got {len(b)}")
    out.b = _vectors("b", b, rows, out.dtype)
    _join_rows(out, rows, cones, mu, R, lo, hi, groups)
    return out


def _join_rows(out, rows, cones, mu, R, lo, hi, groups):
    made = _cone_lists(cones, rows)
    out.offsets = offsets_of(np.array(rows, np.int64))
    out.kinds = _join([kinds for kinds, _ in made], np.uint8)
    out.dims = _join([dims for _, dims in made], np.int64)
    out.mu = _friction_list(mu, rows, [dims for _, dims in made], out.dtype)
    out.R, out.lo, out.hi = (_spread(name, value, rows, out.dtype) for name, value in zip(("R", "lo", "hi"), (R, lo, hi)))
    out.groups = _vectors("groups", groups, [len(kinds) for kinds, _ in made], "int32")


def _spread(name, value, rows, dtype):
    return np.full(sum(rows), value, dtype) if np.isscalar(value) else _vectors(name, value, rows, dtype)


def join_jacobians(J, M, v_free, target, mass_block, cones, mu, R, lo, hi, groups):
    out = _Joined()
    out.dtype = str(as_numpy("J[0]", J[0]).dtype) if J else "float64"
    parts = [_host(f"J[{env}]", matrix, out.dtype) for env, matrix in enumerate(J)]
    for env, part in enumerate(parts):
        if part.ndim != 2:
            raise ValueError(f"J[{env}]: expected (rows, dofs), got {part.shape}")
    rows, dofs = [part.shape[0] for part in parts], [part.shape[1] for part in parts]
    _join_rows(out, rows, cones, mu, R, lo, hi, groups)
    masses = []
    if len(M) != len(J):
        raise ValueError(f"M: expected one entry per environment ({len(J)}), got {len(M)}")
    for env, (mass, nv) in enumerate(zip(M, dofs)):
        mass = _host(f"M[{env}]", mass, out.dtype)
        block = mass_block if mass_block is not None else 1 if mass.ndim == 1 else 0
        if env > 0 and block != out.block:
            raise ValueError(f"M[{env}]: expected the form of M[0], got {mass.shape}")
        out.block = block
        if mass.size != nv * (block or nv):
            raise ValueError(f"M[{env}]: expected ({nv}, {nv}) or ({nv},), got {mass.shape}")
        masses.append(mass.reshape(-1))
    return (_join([part.reshape(-1) for part in parts], out.dtype), _join(masses, out.dtype),
            _vectors("v_free", v_free, dofs, out.dtype), _vectors("target", target, rows, out.dtype), out.offsets,
            offsets_of(np.array(dofs, np.int64)), out.block if J else 0, out.kinds, out.dims, out.mu, out.R, out.lo,
            out.hi, out.groups)
