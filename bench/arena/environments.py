"""Environments of contact-batch files, one at a time, and batches made of them (docs/reference/file_formats.md)."""

import dataclasses

import h5py
import numpy as np

FREE, UNILATERAL, BOX, FRICTION, BOX_FRICTION = range(5)


@dataclasses.dataclass
class Environment:
    offsets: np.ndarray  # of A's rows  (rows + 1)
    columns: np.ndarray  # (entries)
    values: np.ndarray  # (entries)
    b: np.ndarray  # [w]  (rows)
    compliance: np.ndarray  # R  (rows)
    kinds: np.ndarray  # (cones)
    cone_offsets: np.ndarray  # first row of each cone  (cones + 1)
    row_param: np.ndarray  # mu or bound  (rows)
    name: str = ""

    @property
    def rows(self):
        return len(self.b)

    @property
    def cone_sizes(self):
        return np.diff(self.cone_offsets)

    @property
    def row_kinds(self):
        return np.repeat(self.kinds, self.cone_sizes)

    def with_compliance(self):
        """A + diag R as (offsets, columns, values) with R in separate entries."""
        starts = self.offsets[:-1]
        return (self.offsets + np.arange(self.rows + 1), np.insert(self.columns, starts, np.arange(self.rows)),
                np.insert(self.values, starts, self.compliance))

    def dense(self):
        """A + diag R."""
        offsets, columns, values = self.with_compliance()
        matrix = np.zeros((self.rows,) * 2)
        np.add.at(matrix, (np.repeat(np.arange(self.rows), np.diff(offsets)), columns), values)
        return matrix


def read_environments(path):
    with h5py.File(path) as batch:
        rows, cones, cone_rows = (batch[name][:] for name in ("env_row_ptr", "env_cone_ptr", "cone_row_ptr"))
        offsets, columns, values = (batch["A"][name][:] for name in ("ptr", "col", "val"))
        b, compliance, kinds, row_param = (batch[name][:] for name in ("b", "R", "cone_kind", "row_param"))
        names = [name.decode() for name in batch["env_name"][:]] if "env_name" in batch else [""] * (len(rows) - 1)
    found = []
    for e, name in enumerate(names):
        own, own_cones = slice(rows[e], rows[e + 1]), slice(cones[e], cones[e + 1])
        first, last = offsets[rows[e]], offsets[rows[e + 1]]
        found.append(Environment(offsets[rows[e]:rows[e + 1] + 1] - first, columns[first:last], values[first:last], b[own],
                                 compliance[own], kinds[own_cones], cone_rows[cones[e]:cones[e + 1] + 1] - rows[e],
                                 row_param[own], name))
    return found


def write_batch(path, environments, law, source):
    def joined(field, kind):
        return np.concatenate([np.asarray(getattr(e, field)) for e in environments]).astype(kind)

    def offsets(counts):
        return np.concatenate(([0], np.cumsum(counts))).astype("i8")

    with h5py.File(path, "w") as batch:
        batch.attrs.update(format="contact-batch", version=1, law=law, source=source)
        batch["env_row_ptr"] = offsets([e.rows for e in environments])
        batch["env_cone_ptr"] = offsets([len(e.kinds) for e in environments])
        batch["cone_kind"] = joined("kinds", "u1")
        batch["cone_row_ptr"] = offsets(np.concatenate([e.cone_sizes for e in environments]))
        batch["A/ptr"] = offsets(np.concatenate([np.diff(e.offsets) for e in environments]))
        batch["A/col"] = joined("columns", "i4")
        for name, field in (("A/val", "values"), ("b", "b"), ("R", "compliance"), ("row_param", "row_param")):
            batch[name] = joined(field, "f8")
        batch["env_name"] = [e.name for e in environments]
