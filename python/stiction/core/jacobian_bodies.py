"""Rigid bodies that are given as rows of J and M."""

import numpy as np

from .. import _core


class JacobianBodies:
    """Result of `Batch.as_bodies`. `batch` is of form "bodies". Its step is 1, so that its velocities are those of the
    batch of J and M, and its cfm is R.
    """

    def __init__(self, batch):
        self._found = _core.JacobianBodies(batch._view(False))
        self._dtype = batch.dtype
        arrays = self._found.arrays()
        for name, width in (("inv_inertia", 6), ("twist", 6), ("twist_change", 6), ("arm_a", 3), ("arm_b", 3),
                            ("normal", 3)):
            arrays[name] = arrays[name].reshape(-1, width)
        dt, erp, cfm = self._found.stepping
        self.batch = type(batch).from_bodies(**arrays, law=batch.law, dt=dt, erp=erp, cfm=cfm)

    def to_rows(self, by_contact) -> np.ndarray:
        """Impulses or motions of contacts, (contacts, 3), in the rows of J, (rows,)."""
        return self._turn(self._found.to_rows, by_contact, (-1,))

    def to_contacts(self, by_row) -> np.ndarray:
        """Rows of J, (rows,), as impulses or motions of contacts, (contacts, 3): the inverse of `to_rows`."""
        return self._turn(self._found.to_contacts, by_row, (-1, 3))

    def _turn(self, turn, values, shape):
        values = np.ascontiguousarray(values, self._dtype)
        out = np.empty(values.size, self._dtype)
        turn(_core.Array(values), _core.Array(out))
        return out.reshape(shape)
