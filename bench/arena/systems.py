"""Environments of contact-batch files that hold the parts of A: J, M, free motion, target."""

import dataclasses

import h5py
import numpy as np
from environments import read_environments


@dataclasses.dataclass
class System:
    """One environment, dense. A = J M^-1 J', b = J v_free - target."""

    problem: object  # environments.Environment
    J: np.ndarray  # (rows, dofs)
    M: np.ndarray  # (dofs, dofs)
    v_free: np.ndarray  # (dofs)
    target: np.ndarray  # (rows)

    def __getattr__(self, name):
        return getattr(self.__dict__["problem"], name)


def dense(file, name, row_offsets, column_offsets):
    """The dense matrices of a group of CSR arrays."""
    pointer, column, value = (file[f"{name}/{part}"][:] for part in ("ptr", "col", "val"))
    for first, last, width in zip(row_offsets, row_offsets[1:], np.diff(column_offsets)):
        matrix = np.zeros((last - first, width))
        rows = np.repeat(np.arange(last - first), np.diff(pointer[first:last + 1]))
        matrix[rows, column[pointer[first]:pointer[last]]] = value[pointer[first]:pointer[last]]
        yield matrix


def read(path):
    """The environments of a file as systems."""
    with h5py.File(path) as file:
        rows, dofs = file["env_row_ptr"][:], file["env_dof_ptr"][:]
        pieces = zip(read_environments(path), dense(file, "J", rows, dofs), dense(file, "M", dofs, dofs),
                     np.split(file["v_free"][:], dofs[1:-1]), np.split(file["row_target"][:], rows[1:-1]))
        return [System(*piece) for piece in pieces]


def mass_block(systems):
    """Rows of the smallest equal blocks on the diagonals of all M; 0: one block."""
    dofs = len(systems[0].M)
    coupled = np.any([s.M != 0 for s in systems], axis=0)
    for size in range(1, dofs):
        if dofs % size == 0:
            here = np.arange(dofs) // size
            if not coupled[here[:, None] != here[None, :]].any():
                return size
    return 0

