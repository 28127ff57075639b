"""First guesses of reactions: several candidates, of which the best is taken (docs/howto/warm_start.md).

    guess = stiction.learning.Guess(["zero", "last", "active_set"])
    solution = solver.solve(batch, guess=guess, ids=ids)          # every step of a simulation loop
    guess.chosen                                                  # which candidate each environment started from

`solved` depends only on the residual, so no candidate can spoil an answer.
"""

from __future__ import annotations

import numpy as np

from .. import _core
from ..core.arguments import each_count, whole
from ..core.arrays import NUMPY, as_numpy
from ..core.batch import Batch, check_host_matrices
from ..core.derivative import GRADIENT_DTYPE, REFUSED
from ..core.layout import KINDS, Flat
from ..core.solution import CODES
from .guess_step import Memory, Step, ids_in_use
from .guess_tables import Dense, Ridge

__all__ = ["Dense", "Guess", "Ridge", "Step"]

#: Candidates that need nothing but the step before.
NAMES = ("zero", "last", "active_set")
#: Codes of environments whose reactions are remembered.
_KEPT = [CODES.index(code) for code in ("solved", "max_iterations", "stalled", "rounding", "infeasible")]
#: Compliance that redundant contacts get in the active-set prediction, over the mean diagonal of A.
_YIELD = 1e-8


class Guess:
    """Chooses where solves start from, one simulation loop's memory of its last step.

    candidates: in order. "zero". "last": beta times the last reaction of the same contact, by id. "active_set": its
        derivative if every contact stays open, sticking or sliding, by the derivative's matrix
        (docs/math/derivative.md). A Ridge or a Dense table. A callable that is given the Step and returns reactions
        (rows,), or None.
    Each is projected onto the cones. The one of the least dual energy is taken, under Coulomb's law of the least natural
    residual; of equals the first. Candidates that are not finite are dropped. Each environment chooses for itself.
    beta: of "last", in (0, 1].
    deterministic: a Ridge that is not frozen learns and is not offered, so an environment's start depends on its own
        steps and on nothing else. False: it is offered as soon as it has seen enough.
    threads: of the prediction, 0: all cores.

    Batches of matrices or Jacobians in host memory. One thread at a time may use it.
    """

    def __init__(self, candidates=NAMES, *, beta: float = 1.0, deterministic: bool = True, threads: int = 0):
        self.candidates = (candidates,) if isinstance(candidates, str) else tuple(candidates)
        for place, candidate in enumerate(self.candidates):
            if candidate not in NAMES if isinstance(candidate, str) else not callable(candidate):
                raise ValueError(f"candidates[{place}]: expected one of {', '.join(NAMES)}, a Ridge, a Dense or a "
                                 f"callable, got {candidate!r}")
        if not self.candidates:
            raise ValueError("candidates: expected at least one, got none")
        if not 0 < beta <= 1:
            raise ValueError(f"beta: expected a number in (0, 1], got {beta}")
        self.beta, self.deterministic, self.threads = float(beta), bool(deterministic), whole("threads", threads)
        self._memory = self._step = self.chosen = self.weights = None
        self._taken = np.zeros(len(self.candidates), np.int64)
        self._dropped = np.zeros(len(self.candidates), np.int64)

    @property
    def names(self) -> tuple:
        """Names of the candidates; of several with one name each is followed by its place."""
        names = [c if isinstance(c, str) else getattr(c, "name", getattr(c, "__name__", type(c).__name__))
                 for c in self.candidates]
        return tuple(f"{name}[{i}]" if names.count(name) > 1 else name for i, name in enumerate(names))

    def solve(self, solver, batch, ids, out=None, stream=None):
        """Solver.solve(batch, guess=self, ids=ids)."""
        solution = solver.solve(batch, out=out, warm_start=self.start(batch, ids, law=solver.law), stream=stream)
        self.remember(solution)
        return solution

    def start(self, batch, ids, law=None) -> np.ndarray:
        """Reactions to start from, in a NumPy array shaped and typed as the batch's rows.

        ids: int64 or uint64 contact ids, shaped as the batch's cones, unique within an environment. law: that of the
        solver, None: the batch's.
        """
        self._check(batch)
        law = batch.law if law is None else law
        batch._refresh()
        self._step = step = Step(batch, ids_in_use(batch, ids), self._memory)
        step.last = step.recall(self._memory.lambda_) if self._memory is not None else np.zeros_like(step.b)
        step.last_b = step.recall(self._memory.b) if self._memory is not None else np.zeros_like(step.b)
        offered = np.full((len(self.candidates), len(step.b)), np.nan)
        for place, candidate in enumerate(self.candidates):
            value = self._value(candidate, step, law)
            if value is not None:
                # As it will be given: a number that the batch's type cannot hold is infinite there.
                with np.errstate(over="ignore", invalid="ignore"):
                    offered[place] = step.project(value).astype(batch.dtype)
        weights = step.weigh(law, offered)
        finite = np.isfinite(weights)
        self.weights = np.where(finite, weights, np.inf)
        self.chosen = np.argmin(self.weights, axis=0).astype(np.int32)
        usable = finite.any(axis=0)
        self.chosen[~usable] = -1
        self._dropped += (~finite).sum(axis=1)
        self._taken += np.bincount(self.chosen[usable], minlength=len(self.candidates))
        start = np.zeros(batch.layout.row_shape, batch.dtype)
        if len(step.b):
            best = np.where(usable[step.row_env], offered[self.chosen[step.row_env], np.arange(len(step.b))], 0.0)
            start.reshape(-1)[step.place] = best
        return start

    def remember(self, solution) -> None:
        """Keeps the reactions that the last start() led to, and lets tables learn from them. An environment that ended
        as "numerical", "invalid_input" or "unsupported", or whose reactions are not finite, is forgotten.
        """
        step = self._step
        if step is None or solution._batch is not step.batch:
            raise ValueError("solution: expected that of the batch whose start() came last, got another one's")
        self._step = None
        lambda_ = as_numpy("lambda_", solution.lambda_).reshape(-1)[step.place].astype(np.float64)
        kept = np.isin(solution.status["code"], _KEPT)
        np.logical_and.at(kept, step.row_env, np.isfinite(lambda_) & np.isfinite(step.b))
        self._memory = Memory(step, lambda_, kept)
        for candidate in self.candidates:
            if isinstance(candidate, Ridge):
                candidate.learn(step, lambda_, kept & solution.solved)

    def reset(self, ids=None, mask=None) -> None:
        """Forgets environments that start over: a list of them, or where mask (B,) is not zero, or all."""
        if ids is not None and mask is not None:
            raise ValueError("ids: expected ids or mask, got both")
        if self._memory is None:
            return
        if ids is None and mask is None:
            self._memory = None
            return
        if mask is None:
            chosen = each_count("ids", ids).reshape(-1)
            mask = np.zeros(int(chosen.max(initial=-1)) + 1, bool)
            mask[chosen] = True
        self._memory.forget(np.asarray(mask) != 0)

    def stats(self) -> dict:
        """Counts by candidate's name over all environments so far: taken, and dropped (not offered or not finite)."""
        return {"taken": dict(zip(self.names, self._taken.tolist())),
                "dropped": dict(zip(self.names, self._dropped.tolist()))}

    # -- pieces -------------------------------------------------------------------------------------------------------

    @staticmethod
    def _check(batch):
        check_host_matrices(batch, "guesses are made on the host")

    def _value(self, candidate, step, law):
        if candidate == "zero":
            return np.zeros_like(step.b)
        if candidate == "last":
            return self.beta * step.last
        if candidate == "active_set":
            return self._active_set(step, law)
        if isinstance(candidate, Ridge):
            return candidate.predict(step) if candidate.frozen or not self.deterministic else None
        value = candidate(step)
        if value is None:
            return None
        value = np.asarray(value, np.float64)
        if value.shape != step.b.shape:
            raise ValueError(f"candidates[{self.candidates.index(candidate)}]: expected reactions {step.b.shape}, got "
                             f"{value.shape}")
        return value

    def _active_set(self, step, law):
        """The last reaction solves this step's problem with another b; its derivative takes it to this step's b."""
        if not step.known.any():
            return None
        arrays = dict(step._arrays)
        scale = np.empty(len(step))
        step._packed.mean_diagonal(_core.Array(scale))
        softer = _YIELD * scale[step.row_env]
        motion = step.motion(step.last)
        # A contact that was not there is open: as open as it takes to stay so.
        target = step.recall(self._memory.w)
        opened = ~step.known[step.first[:-1]] & np.isin(step.kind, [KINDS[kind] for kind in ("unilateral", "friction", "box_friction")])
        target[step.first[:-1][opened]] = np.maximum(np.abs(motion[step.first[:-1][opened]]), np.finfo(float).tiny)
        change = motion - target
        arrays["b"], arrays["R"] = step.b - change - softer * step.last, step.R + softer
        finite = np.ones(len(step), bool)
        np.logical_and.at(finite, step.row_env, np.isfinite(change) & np.isfinite(arrays["b"]))
        derivative = _core.Derivative("cpu", law, np.inf, 1e-6, 512, self.threads, 0.0)
        predicted = np.zeros_like(step.b)
        records = np.zeros((len(step), GRADIENT_DTYPE.itemsize), np.uint8)
        derivative.jvp_contacts(_packed_batch(arrays, law)._view(False), _core.Array(step.last), None,
                                {"b": _core.Array(change)}, {"lambda_": _core.Array(predicted)}, _core.Array(records), 1)
        refused = records.view(GRADIENT_DTYPE).reshape(-1)["flags"] & REFUSED != 0
        known = np.zeros(len(step), bool)
        known[step.row_env[step.known]] = True
        return np.where((known & finite & ~refused)[step.row_env], step.last + predicted, np.nan)


def _packed_batch(arrays, law):
    """A batch of packed arrays."""
    batch = Batch("delassus", NUMPY, "float64", "cpu", law)
    batch.layout = Flat(arrays["env_row_offsets"], arrays["cone_kind"], np.diff(arrays["cone_row_offsets"]),
                        arrays["env_cone_offsets"])
    batch._integers(batch.layout.integers)
    for name in ("row_offsets", "column", "A", "b", "R", "mu", "lo", "hi"):
        batch._put(name, name, arrays[name])
    return batch
