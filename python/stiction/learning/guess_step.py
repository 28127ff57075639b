"""A step as first guesses see it: its rows by environment and contact id, and the step before."""

import hashlib

import numpy as np

from .. import _core
from ..core.arrays import as_numpy, look, take
from ..core.layout import KINDS
from ..core.semidefinite import semidefinite_matrix, semidefinite_vector


class Step:
    """One step's problem and its known state from the step before, in float64 NumPy arrays. They hold the rows in use
    of all environments, one after another.

    row_offsets, cone_offsets (B + 1): where rows and cones of each environment begin. kind, first (cones): kind, and
    the row after which the cone ends begins the next (cones + 1). ids: uint64 (cones,). b, R, mu, lo, hi (rows,).
    last, last_b (rows,): reactions and b of the same contact in the step before, by id; 0 where it was not there.
    known: bool (rows,), whether it was.
    """

    def __init__(self, batch, ids, memory):
        self._packed = _core.PackedBatch(batch._view(False))
        self._arrays = arrays = self._packed.arrays()
        self.batch, self.ids = batch, ids
        self.place = arrays["place"]
        self.row_offsets, self.cone_offsets = arrays["env_row_offsets"], arrays["env_cone_offsets"]
        self.kind, self.first = arrays["cone_kind"], arrays["cone_row_offsets"]
        self.b, self.R, self.mu, self.lo, self.hi = (arrays[name] for name in ("b", "R", "mu", "lo", "hi"))
        self.dims = np.diff(self.first)
        self.cone_env = np.repeat(np.arange(len(self)), np.diff(self.cone_offsets))
        self.row_env = np.repeat(np.arange(len(self)), np.diff(self.row_offsets))
        self._rows = _by_size(self.first, self.dims, self.kind)
        self._from = None if memory is None else memory.rows_of(self)
        found = -1 if self._from is None else self._from
        self.known = np.broadcast_to(found, self.b.shape) >= 0

    def __len__(self):
        return len(self.row_offsets) - 1

    def recall(self, values):
        """Values of the step before's rows at this step's; 0 where the contact was not there."""
        out = np.zeros_like(self.b)
        if self._from is not None:
            out[self.known] = values[self._from[self.known]]
        return out

    def motion(self, lambda_):
        """(A + diag R) lambda_ + b, float64 (rows,)."""
        w = np.empty_like(self.b)
        self._packed.motion(_core.Array(np.ascontiguousarray(lambda_)), _core.Array(w))
        return w

    def weigh(self, law, candidates):
        """Worth of each of `candidates` (K, rows) in each environment, the less the better. float64 (K, B): the dual
        energy 1/2 c'(A + R)c + b'c under the convex law, the natural residual [w] under Coulomb's.
        """
        weights = np.empty((len(candidates), len(self)))
        self._packed.weigh(law, _core.Array(np.ascontiguousarray(candidates)), len(candidates), _core.Array(weights))
        return weights

    def project(self, lambda_):
        """The nearest reactions within the cones, friction cones in the coordinates in which they are circular."""
        out = np.array(lambda_, np.float64)
        for kind, first, dim in self._rows:
            if kind == KINDS["unilateral"]:
                out[first] = np.maximum(out[first], 0.0)
            elif kind == KINDS["box"]:
                out[first] = np.minimum(np.maximum(out[first], self.lo[first]), self.hi[first])
            elif kind == KINDS["friction"]:
                self._project_friction(out, first, dim)
            elif kind == KINDS["semidefinite"]:
                self._project_matrices(out, first, dim)
            elif kind == KINDS["box_friction"]:
                out[first] = np.maximum(out[first], 0.0)
                for rows in (first + k for k in range(1, dim)):
                    bound = self.mu[rows] * out[first]
                    out[rows] = np.minimum(np.maximum(out[rows], -bound), bound)
        return out

    def _project_matrices(self, out, first, dim):
        rows = first[:, None] + np.arange(dim)
        rows = rows[np.isfinite(out[rows]).all(axis=1)]  # of others LAPACK finds no eigenvalues, and raises
        value, vector = np.linalg.eigh(semidefinite_matrix(out[rows]))
        out[rows] = semidefinite_vector(np.einsum("...ik,...k,...jk->...ij", vector, np.maximum(value, 0.0), vector))

    def _project_friction(self, out, first, dim):
        tangential = [first + k for k in range(1, dim)]
        scaled, square = [], 0.0
        for rows in tangential:
            mu = self.mu[rows]
            x = np.where(mu > 0, out[rows] / np.where(mu > 0, mu, 1.0), 0.0)
            scaled.append(x)
            square = square + x * x
        length, normal = np.sqrt(square), out[first]
        inside, gone = length <= normal, length <= -normal
        on_cone = 0.5 * (normal + length)
        shrink = np.where(inside, 1.0, np.where(gone, 0.0, on_cone / np.where(length > 0, length, 1.0)))
        out[first] = np.where(inside, normal, np.where(gone, 0.0, on_cone))
        for rows, x in zip(tangential, scaled):
            out[rows] = self.mu[rows] * (x * shrink)

    def groups(self):
        """(topology, environments, rows) for every topology: environments with the same contacts, and their rows
        (environments, n) in the order of ids. Environments without rows are left out.
        """
        order = np.lexsort((self.ids, self.cone_env))
        start, found = self.cone_offsets, {}
        for env in np.flatnonzero(np.diff(start)):
            cones = order[start[env]:start[env + 1]]
            key = hashlib.blake2b(self.ids[cones].tobytes() + self.kind[cones].tobytes()
                                  + self.dims[cones].tobytes(), digest_size=12).hexdigest()
            found.setdefault(key, []).append((env, cones))
        for key, members in found.items():
            rows = [np.concatenate([np.arange(self.first[c], self.first[c + 1]) for c in cones]) for _, cones in members]
            yield key, np.array([env for env, _ in members]), np.array(rows)

    def features(self, rows):
        """Input of a table for rows (environments, n): b, last_b and last, each in that order."""
        return np.concatenate([self.b[rows], self.last_b[rows], self.last[rows]], axis=1)


def _by_size(first, dims, kinds):
    """(kind, first rows, rows each) of cones that are projected alike."""
    alike = np.stack([kinds.astype(np.int64), dims])
    return [(int(kind), first[:-1][(kinds == kind) & (dims == dim)], int(dim))
            for kind, dim in np.unique(alike, axis=1).T]


class Memory:
    """Reactions, motion and b of a step's contacts, by environment and id."""

    def __init__(self, step, lambda_, kept):
        self.ids, self.first, self.dims, self.kind = step.ids, step.first, step.dims, step.kind
        self.cone_env = np.where(kept[step.cone_env], step.cone_env, -1)
        self.lambda_, self.w, self.b = lambda_, step.motion(lambda_), np.array(step.b)

    def forget(self, mask):
        """Drops environments."""
        known = (self.cone_env >= 0) & (self.cone_env < len(mask))
        self.cone_env = np.where(known & mask[np.where(known, self.cone_env, 0)], -1, self.cone_env)

    def rows_of(self, step):
        """The row here of each row of a step, -1 where its contact was not there. Among several with one id the first
        is remembered and served.
        """
        names, number = np.unique(np.concatenate([self.ids, step.ids]), return_inverse=True)
        key = np.concatenate([self.cone_env, step.cone_env]) * len(names) + number.reshape(-1)
        mine, theirs = np.where(self.cone_env >= 0, key[:len(self.ids)], -1), key[len(self.ids):]
        order = np.argsort(mine, kind="stable")
        place = np.searchsorted(mine[order], theirs, side="left")
        source = order[np.minimum(place, len(order) - 1)] if len(order) else np.zeros(len(theirs), np.int64)
        hit = np.zeros(len(theirs), bool)
        if len(order):
            hit = (mine[source] == theirs) & (self.dims[source] == step.dims) & (self.kind[source] == step.kind)
        first = np.zeros(len(theirs), bool)
        first[np.unique(theirs, return_index=True)[1]] = True
        begin = np.where(hit & first, self.first[source] if len(order) else 0, -1)
        spread = np.repeat(begin, step.dims)
        within = np.arange(len(step.b)) - np.repeat(step.first[:-1], step.dims)
        return np.where(spread >= 0, spread + within, -1)


def ids_in_use(batch, ids):
    """Ids of cones in use, uint64, one environment after another."""
    dtype = look("ids", ids).dtype
    take("ids", ids, dtype if dtype in ("int64", "uint64") else "uint64", batch.layout.cone_shape, "cpu")
    ids = as_numpy("ids", ids).view(np.uint64)
    if not batch.layout.padded:
        return ids.copy()
    counts = batch.layout.integers["env_cone_counts"]
    return ids[np.arange(ids.shape[1]) < counts[:, None]]
