"""Batches of the Python package made of environments.Environment, or of systems.System for J and M."""

import numpy as np
import systems
from environments import BOX, FRICTION

import stiction

KIND = {"f32": "f4", "f64": "f8"}


def offsets(counts):
    return np.concatenate(([0], np.cumsum(counts))).astype("i8")


def joined(pieces, kind):
    return np.concatenate(pieces).astype(kind)


def cones(some, law, kind):
    high = joined([np.where(s.row_kinds == BOX, s.row_param, 0) for s in some], kind)
    return dict(offsets=offsets([s.rows for s in some]), law=law, lo=-high, hi=high, R=joined([s.compliance for s in some], kind),
                kinds=joined([s.kinds for s in some], "u1"), dims=joined([s.cone_sizes for s in some], "i8"),
                mu=joined([np.where(s.row_kinds == FRICTION, s.row_param, 0) for s in some], kind))


def matrix_batch(some, precision, law="convex", b=None):
    """A in the stored entries of the environments; b: another right-hand side for each."""
    kind = KIND[precision]
    return stiction.Batch.from_delassus(joined([s.values for s in some], kind),
                                        joined([s.b for s in some] if b is None else b, kind),
                                        indptr=offsets(np.concatenate([np.diff(s.offsets) for s in some])),
                                        indices=joined([s.columns for s in some], "i4"), **cones(some, law, kind))


def jacobian_batch(some, precision, factored, law="convex"):
    """J in stored entries where most are zero; M, or its Cholesky factor, in blocks."""
    kind = KIND[precision]
    block = systems.mass_block(some)
    size = block or len(some[0].M)
    blocks = [s.M[i:i + size, i:i + size] for s in some for i in range(0, len(s.M), size)]
    M = [(np.linalg.cholesky(one) if factored else one).ravel() for one in blocks]
    J, sparse = [s.J.ravel() for s in some], {}
    if np.mean([np.mean(s.J != 0) for s in some]) < 0.25:
        stored = [np.nonzero(s.J) for s in some]
        counts = [np.bincount(rows, minlength=s.rows) for s, (rows, _) in zip(some, stored)]
        J = [s.J[at] for s, at in zip(some, stored)]
        sparse = dict(indptr=offsets(np.concatenate(counts)), indices=joined([columns for _, columns in stored], "i4"))
    return stiction.Batch.from_jacobian(joined(J, kind), joined(M, kind), joined([s.v_free for s in some], kind),
                                        joined([s.target for s in some], kind), dof_offsets=offsets([len(s.M) for s in some]),
                                        mass_block=block, mass_form="factor" if factored else "matrix", **sparse,
                                        **cones(some, law, kind))
