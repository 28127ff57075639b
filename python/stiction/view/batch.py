"""Drawing of a batch: its cones beside each other, in their own axes, since a batch has no places of contacts."""

import numpy as np

from ..core.arrays import as_numpy
from ..core.layout import KINDS
from .frame import Contacts, islands

_UP = np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])  # frame of every cone: the normal up
_SPACING = 2.0  # between cones; the largest reaction is 1 long


def _largest(values):
    """The largest finite magnitude, 1 where there is none."""
    values = np.abs(values[np.isfinite(values)])
    return float(values.max(initial=0.0)) or 1.0


class BatchSource:
    """Cones, couplings and reactions of a host batch of form "delassus". solution: of that batch."""

    def __init__(self, batch, solution):
        if batch.form != "delassus" or batch.device != "cpu":
            raise TypeError(f"batch: expected one of form 'delassus' on cpu, got {batch.form!r} on {batch.device}: "
                            "log the world or simulation that it comes from")
        self._batch, self._layout = batch, batch.layout
        self._rows = {name: np.asarray(as_numpy(name, value), np.float64).reshape(-1)
                      for name, value in (("lambda_", solution.lambda_), ("w", solution.w), ("b", batch.b))}
        self._mu = np.asarray(as_numpy("mu", batch.mu), np.float64).reshape(-1) if "mu" in batch.arrays else None
        self.env_count, self.status = len(batch), solution.status
        self.slip_scale = 1 / _largest(self._rows["b"])
        extras = getattr(batch, "extras", {})
        self._names = list(extras.get("env_name", ()))
        self.time, self.simulation = np.arange(self.env_count), np.zeros(self.env_count, int)
        self.timeline = "environment"
        if extras.get("step") is not None:
            self.timeline, self.time = "step", np.asarray(extras["step"])
            first = np.r_[0, np.flatnonzero(np.diff(self.time)) + 1]
            self.simulation = np.arange(self.env_count) - np.repeat(first, np.diff(np.r_[first, self.env_count]))

    def name(self, env) -> str:
        """Name of an environment in the file."""
        return self._names[env] if env < len(self._names) else f"environment {env}"

    def cones(self, env):
        """(kinds, first row of each cone, and the last one's end) of an environment."""
        integers = self._layout.integers
        first = int(integers["env_cone_offsets"][env])
        count = int(integers["env_cone_counts"][env]) if self._layout.padded else \
            int(integers["env_cone_offsets"][env + 1]) - first
        return integers["cone_kind"][first:first + count], integers["cone_row_offsets"][first:first + count + 1]

    def width(self) -> float:
        """Width of the largest environment's grid, about."""
        counts = [len(self.cones(env)[0]) for env in range(self.env_count)]
        return _SPACING * float(np.ceil(np.sqrt(max(counts, default=1))))

    def reactions(self, env):
        """Reactions of an environment (rows,)."""
        rows = self.cones(env)[1]
        return self._rows["lambda_"][rows[0]:rows[-1]]

    def scale(self, env) -> float:
        """Length of an arrow by reaction: the largest of the environment is 1 long."""
        return 1 / _largest(self.reactions(env))

    def couplings(self, env):
        """Pairs of cones (m, 2) that A couples, each once."""
        kinds, rows = self.cones(env)
        count, begin, end = len(kinds), int(rows[0]), int(rows[-1])
        cone = np.repeat(np.arange(count), np.diff(rows))
        arrays = self._batch.arrays
        A = as_numpy("A", arrays["A"])
        offsets, columns = arrays.get("row_offsets", arrays.get("indptr")), arrays.get("column", arrays.get("indices"))
        if columns is not None:
            offsets, columns = as_numpy("indptr", offsets), as_numpy("indices", columns)
            part = slice(int(offsets[begin]), int(offsets[end]))
            row, column = np.repeat(np.arange(end - begin), np.diff(offsets[begin:end + 1])), columns[part]
            values = A[part]
        else:
            n = end - begin
            sizes = np.diff(self._layout.integers["env_row_offsets"][:env + 1].astype(np.int64))
            block = A[env, :n, :n] if self._layout.padded else A[(sizes**2).sum():][:n * n].reshape(n, n)
            row, column = np.nonzero(block)
            values = block[row, column]
        pairs = np.stack([cone[row], cone[column]], axis=1)[values != 0]
        return np.unique(pairs[pairs[:, 0] < pairs[:, 1]], axis=0)

    def contacts(self, env) -> Contacts:
        """The cones of an environment as contacts on a grid; cones of one manifold stand behind each other. A cone that
        is no friction cone has its first row's reaction alone."""
        kinds, rows = self.cones(env)
        count = len(kinds)
        force, slip, mu = np.zeros((count, 3)), np.zeros((count, 3)), np.zeros((count, 2))
        for i, (kind, begin, end) in enumerate(zip(kinds, rows[:-1], rows[1:])):
            seen = slice(int(begin), int(min(end, begin + 3)))
            width = seen.stop - seen.start
            force[i, :width] = self._rows["lambda_"][seen]
            if kind in (KINDS["friction"], KINDS["box_friction"]):
                slip[i, :width - 1] = self._rows["w"][seen][1:]  # tangents are x and y here
                mu[i, :width - 1] = self._friction(env, i, seen)[1:]
        return Contacts(self._grid(env, count), np.broadcast_to(_UP, (count, 3, 3)), force, mu, slip,
                        islands(count, self.couplings(env), touched=range(count)))

    def _friction(self, env, cone, rows):
        """Friction of those rows: one number for all, one per cone, or one per row."""
        if self._mu is None or not self._mu.size:
            return np.zeros(rows.stop - rows.start)
        if self._mu.size == len(self._rows["b"]):
            return self._mu[rows]
        if self._mu.size == 1:
            return np.full(rows.stop - rows.start, self._mu[0])
        first = env * self._layout.cone_shape[-1] if self._layout.padded else \
            int(self._layout.integers["env_cone_offsets"][env])
        return np.full(rows.stop - rows.start, self._mu[first + cone])

    def _grid(self, env, count):
        arrays = self._batch.arrays
        groups = arrays.get("cone_group", arrays.get("groups"))
        if groups is None:
            group = np.arange(count)
        else:
            first = env * self._layout.cone_shape[-1] if self._layout.padded else \
                int(self._layout.integers["env_cone_offsets"][env])
            own = as_numpy("groups", groups).reshape(-1)[first:first + count]
            begins = np.r_[True, (own[1:] != own[:-1]) | (own[1:] < 0)][:count]
            group = np.cumsum(begins) - 1
        within = np.arange(count) - np.searchsorted(group, group)
        depth = int(within.max(initial=0)) + 1
        columns = max(1, int(np.ceil(np.sqrt(depth * (group.max(initial=0) + 1)))))
        grid = np.stack([group % columns, group // columns * depth + within, np.zeros(count)], axis=1)
        return _SPACING * (grid - grid.max(axis=0, initial=0.0) / 2)
