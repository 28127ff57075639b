"""Contact systems in NumPy: their residual, and the contact-batch file that holds many of them (docs/reference/file_formats.md).

Needs numpy and h5py (tools/requirements.txt).
"""
from dataclasses import dataclass

import h5py
import numpy as np

FREE, UNILATERAL, BOX, FRICTION = range(4)  # cone_kind of the file format


@dataclass
class System:
    """One environment: n rows in cones over nv degrees of freedom; w is an acceleration, lambda a force."""

    cone_kind: np.ndarray   # (cones)
    cone_rows: np.ndarray   # (cones) rows of each cone
    row_param: np.ndarray   # (n) mu of the axis, or the box bound, else 0
    A: np.ndarray           # (n, n) J M^-1 J', without R
    b: np.ndarray           # (n) J v_free - row_target
    R: np.ndarray           # (n) efc_R
    J: np.ndarray           # (n, nv)
    M: np.ndarray           # (nv, nv)
    v_free: np.ndarray      # (nv) qacc_smooth: the acceleration without constraint forces
    row_target: np.ndarray  # (n) efc_aref: the acceleration each row asks for
    lambda_ref: np.ndarray  # (n) efc_force
    v_ref: np.ndarray       # (nv) qacc

    def stored_bytes(self):
        """Size of this environment in the file before compression, pointers included."""
        entries = sum(np.count_nonzero(m) for m in (self.A, self.J, self.M))
        n, nv = self.J.shape
        return 12 * entries + 9 * len(self.cone_kind) + 8 * (7 * n + 3 * nv) + 24


def pointers(sizes):
    return np.concatenate(([0], np.cumsum(sizes, dtype=np.int64)))


def csr(matrices):
    """The matrices below one another as ptr, col, val; columns count from each matrix's own first."""
    places = [np.nonzero(m) for m in matrices]
    counts = np.concatenate([np.count_nonzero(m, axis=1) for m in matrices])
    return {"ptr": pointers(counts), "col": np.concatenate([p[1] for p in places]).astype(np.int32),
            "val": np.concatenate([m[p] for m, p in zip(matrices, places)])}


def write(path, systems, source, extra=None):
    """Writes the contact-batch file; deflate, because the pointers and Jacobians compress well."""
    arrays = {"env_row_ptr": pointers([len(s.b) for s in systems]),
              "env_cone_ptr": pointers([len(s.cone_kind) for s in systems]),
              "env_dof_ptr": pointers([len(s.v_free) for s in systems]),
              "cone_row_ptr": pointers(np.concatenate([s.cone_rows for s in systems]))}
    for name in ("cone_kind", "row_param", "b", "R", "v_free", "row_target", "lambda_ref", "v_ref"):
        arrays[name] = np.concatenate([getattr(s, name) for s in systems])
    for name in ("A", "J", "M"):
        for part, values in csr([getattr(s, name) for s in systems]).items():
            arrays[f"{name}/{part}"] = values
    arrays |= extra or {}
    with h5py.File(path, "w") as file:
        file.attrs.update({"format": "contact-batch", "version": 1, "source": source, "law": "convex"})
        for name, values in arrays.items():
            if name == "env_name":
                values = np.array(values, h5py.string_dtype())
            packed = {"compression": "gzip", "compression_opts": 9, "shuffle": True} if values.size else {}
            file.create_dataset(name, data=values, track_times=False, **packed)
