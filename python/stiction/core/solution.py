"""Result of a solve."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .. import _core
from .arrays import NUMPY, STATUS_DTYPE, as_numpy, look, status_bytes, take

#: Names of status codes and solvers by number.
CODES = tuple(_core.code_names())
SOLVERS = tuple(_core.solver_names())
SOLVED = CODES.index("solved")


def solver_name(number):
    """Name of a status record's solver."""
    return _core.solver_name(number)


def to_host(array):
    """An array of device memory, or of the host's, in host memory."""
    return array if isinstance(array, np.ndarray) else array.get() if hasattr(array, "get") \
        else array.cpu() if hasattr(array, "cpu") else array.numpy()


class Answer(NamedTuple):
    """One environment's part of a solution: views of its arrays."""

    lambda_: object
    w: object
    velocities: object
    status: np.void


class Solution:
    """Reactions, residual motion and status of every environment; memory of the batch's framework and device.

    lambda_: reactions [lambda]; w: residual motion (A + diag R) lambda + b [w]. Shape (B, n) where the batch is padded
        (numbers behind an environment's rows are not written), (rows,) where it is flat. For bodies (B, contacts, 3)
        or (contacts, 3): impulses (normal, two tangents) [N s].
    velocities: v_free + M^-1 J' lambda [v], shaped as v_free, in the Jacobian form; twists after the step, shaped as
        twist, for bodies; else None.
    status: NumPy records (B,) of code, flags, iterations, residual (share of the island's scale), residual_abs [w], solver,
        islands (that were solved apart).

    In device memory the arrays are ready in the order of the stream that the solve was given. `status` and its derived
    arrays wait for that stream and copy to the host.
    """

    def __init__(self, batch, lambda_, w, velocities, status, seen=None):
        self._batch = batch
        self._raw = status
        self.lambda_, self.w, self.velocities = lambda_, w, velocities
        self._seen = self._look() if seen is None else seen
        self._wait = None

    def _look(self):
        return {name: look(name, value) for name, value in
                (("lambda_", self.lambda_), ("w", self.w), ("velocities", self.velocities), ("status", self._raw))
                if value is not None}

    def __getstate__(self):
        self.synchronize()
        return {name: value for name, value in self.__dict__.items() if name not in ("_seen", "_wait")}

    def __setstate__(self, state):
        self.__dict__.update(state)
        self._seen, self._wait = self._look(), None

    @classmethod
    def empty(cls, batch) -> Solution:
        """Room for the answer of that batch, zeroed."""
        framework, dtype, device = batch.framework, batch.dtype, batch.device
        rows, velocity = _shapes(batch)
        status = np.zeros(len(batch), STATUS_DTYPE) if framework is NUMPY else \
            framework.zeros((len(batch), STATUS_DTYPE.itemsize), "uint8", device)
        return cls(batch, framework.zeros(rows, dtype, device), framework.zeros(rows, dtype, device),
                   None if velocity is None else framework.zeros(velocity, dtype, device), status)

    @classmethod
    def over(cls, batch, out):
        """The caller's arrays as a place for the answer of that batch: a solution, or a dict of arrays by name."""
        if isinstance(out, Solution):
            if out._batch is batch:
                return out
            out = {"lambda_": out.lambda_, "w": out.w, "velocities": out.velocities, "status": out._raw}
        if not isinstance(out, dict):
            raise TypeError(f"out: expected a Solution or a dict of arrays, got {type(out).__name__}")
        unknown = set(out) - {"lambda_", "w", "velocities", "status"}
        if unknown:
            raise ValueError(f"out: expected lambda_, w, velocities and status, got {sorted(unknown)[0]!r}")
        rows, velocity = _shapes(batch)
        made, seen = {}, {}
        for name, shape, dtype in (("lambda_", rows, batch.dtype), ("w", rows, batch.dtype),
                                   ("velocities", velocity, batch.dtype), ("status", (len(batch), 32), "uint8")):
            value = out.get(name)
            made[name] = value
            if value is None or shape is None:
                continue
            seen[name] = take(f"out[{name!r}]", value, dtype, shape, batch.device, writable=True)
        for name in ("lambda_", "status"):
            if made[name] is None:
                raise ValueError(f"out[{name!r}]: expected an array, got None")
        return cls(batch, made["lambda_"], made["w"], made["velocities"] if velocity is not None else None,
                   made["status"], seen)

    def __len__(self) -> int:
        return len(self._batch)

    def __repr__(self):
        return f"<stiction.Solution of {len(self)} environments>"

    def __getitem__(self, env: int) -> Answer:
        """One environment: views of its reactions, motion, velocities and its record."""
        place = self._batch.rows_of(env)
        return Answer(self.lambda_[place], None if self.w is None else self.w[place],
                      None if self.velocities is None else self.velocities[_velocity_place(self._batch, env)],
                      self.status[env])

    def synchronize(self) -> None:
        """Returns when the answer is there."""
        if self._wait is not None:
            wait, self._wait = self._wait, None
            wait()

    @property
    def status(self) -> np.ndarray:
        """Records (B,): code, flags, iterations, residual [-], residual_abs [w], solver, islands."""
        self.synchronize()
        raw = self._raw
        if self._batch.device != "cpu":
            raw = to_host(raw)
        raw = as_numpy("status", raw)
        return raw if raw.dtype is STATUS_DTYPE or raw.dtype == STATUS_DTYPE else raw.view(STATUS_DTYPE).reshape(-1)

    @property
    def iterations(self) -> np.ndarray:
        """Iterations of the solver that answered, int32 (B,)."""
        return self.status["iterations"]

    @property
    def residual(self) -> np.ndarray:
        """Natural-map residual of the returned lambda / max |b|, float64 (B,) [-]."""
        return self.status["residual"]

    @property
    def solved(self) -> np.ndarray:
        """True for each environment that reached its tolerance, bool (B,)."""
        return self.status["code"] == SOLVED

    def hash(self) -> str:
        """Hash of the bits of all reactions in use, as `stiction solve` prints it. The same on every device."""
        self.synchronize()
        values = self.lambda_
        if self._batch.device != "cpu":
            values = to_host(values)
        values = as_numpy("lambda_", values)
        if self._batch.layout is not None and self._batch.layout.padded:
            values = np.concatenate([values[self._batch.rows_of(env)] for env in range(len(self))] or [values[:0, 0]])
        return f"{_core.hash_bits(_core.Array(np.ascontiguousarray(values.reshape(-1)))):016x}"


def _shapes(batch):
    """Shapes of reactions and of velocities, None where the form has none."""
    if batch.form == "bodies":
        return batch.contact_shape + (3,), batch.body_shape + (6,)
    return batch.layout.row_shape, batch.dof_shape if batch.form == "jacobian" else None


def _velocity_place(batch, env):
    if batch.form == "bodies":
        if len(batch.body_shape) == 2:
            return env
        offsets = as_numpy("body_offsets", batch.body_offsets)
    elif len(batch.dof_shape) == 2:
        return env
    else:
        offsets = as_numpy("dof_offsets", batch.dof_offsets)
    return slice(int(offsets[env]), int(offsets[env + 1]))
