"""First guesses of reactions: several candidates, of which the best is taken (docs/warm_start.md).

    guess = stiction.guess.Guess(["zero", "last", "active_set"])
    solution = solver.solve(batch, guess=guess, ids=ids)          # every step of a simulation loop
    guess.chosen                                                  # which candidate each environment started from

A guess is only a guess: what is called solved is the residual's business, and no candidate can spoil an answer.
"""

from __future__ import annotations

import hashlib
import os

import numpy as np

from . import _core
from ._arrays import NUMPY, as_numpy, look, take
from ._batch import Batch
from ._derivative import _REFUSED, GRADIENT_DTYPE
from ._layout import KINDS, Flat
from ._solution import CODES

__all__ = ["Dense", "Guess", "Ridge", "Step"]

#: Candidates that need nothing but the step before.
NAMES = ("zero", "last", "active_set")
#: Codes of environments whose reactions are remembered.
_KEPT = [CODES.index(code) for code in ("solved", "max_iterations", "stalled")]
#: Compliance that redundant contacts get in the active-set prediction, over the mean diagonal of A.
_YIELD = 1e-8
#: Version of files of tables.
_VERSION = 1


class Step:
    """One step's problem and what is known of it from the step before, rows in use of all environments one behind the
    other, in float64 NumPy arrays.

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
        """What each of `candidates` (K, rows) is worth in each environment, the less the better. float64 (K, B): the
        dual energy 1/2 c'(A + R)c + b'c under the convex law, the natural residual [w] under Coulomb's.
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
        return out

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
        """What a table is given of rows (environments, n): b, last_b and last, each in that order."""
        return np.concatenate([self.b[rows], self.last_b[rows], self.last[rows]], axis=1)


def _by_size(first, dims, kinds):
    """(kind, first rows, rows each) of cones that are projected alike."""
    return [(kind, first[:-1][(kinds == kind) & (dims == dim)], dim)
            for kind, dim in sorted({(int(kind), int(dim)) for kind, dim in zip(kinds, dims)})]


class _Memory:
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
        """The row here of each row of a step, -1 where its contact was not there. Of several with one id the first is
        remembered and served.
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


class Guess:
    """Chooses where solves start from, one simulation loop's memory of its last step.

    candidates: in this order, of
        "zero";
        "last": beta times the last reaction of the same contact, by id;
        "active_set": what the last reaction becomes if every contact stays open, sticking or sliding, by the matrix of
            the derivative (docs/math/derivative.md);
        a Ridge or a Dense table;
        a callable that is given the Step and returns reactions (rows,), or None.
    Each is projected onto the cones. The one of the least dual energy (convex law) or natural residual (Coulomb's) is
    taken, of equals the first; candidates that are not finite are dropped. Each environment chooses for itself.
    beta: of "last", in (0, 1].
    deterministic: a Ridge that is not frozen learns and is not offered, so an environment's start depends on its own
        steps and on nothing else. False: it is offered as soon as it has seen enough.
    threads: of the prediction, 0: all cores.

    Batches of matrices or Jacobians in host memory. One thread at a time may use it.
    """

    def __init__(self, candidates=NAMES, *, beta: float = 1.0, deterministic: bool = True, threads: int = 0):
        self.candidates = tuple(candidates)
        for place, candidate in enumerate(self.candidates):
            if candidate not in NAMES if isinstance(candidate, str) else not callable(candidate):
                raise ValueError(f"candidates[{place}]: expected one of {', '.join(NAMES)}, a Ridge, a Dense or a "
                                 f"callable, got {candidate!r}")
        if not self.candidates:
            raise ValueError("candidates: expected at least one, got none")
        if not 0 < beta <= 1:
            raise ValueError(f"beta: expected a number in (0, 1], got {beta}")
        self.beta, self.deterministic, self.threads = float(beta), bool(deterministic), int(threads)
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
        self._step = step = Step(batch, _ids_in_use(batch, ids), self._memory)
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
        self._memory = _Memory(step, lambda_, kept)
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
            chosen = np.asarray(ids, np.int64).reshape(-1)
            if (chosen < 0).any():
                raise ValueError(f"ids: expected environments from 0 on, got {int(chosen.min())}")
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
        if not isinstance(batch, Batch):
            raise TypeError(f"batch: expected a stiction.Batch, got {type(batch).__name__}")
        if batch.form == "bodies":
            raise ValueError("batch: expected a batch of form 'delassus' or 'jacobian', got 'bodies'")
        if batch.device != "cpu":
            raise ValueError(f"batch: expected a batch on cpu, got one on {batch.device}: guesses are made on the host")

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
        opened = ~step.known[step.first[:-1]] & np.isin(step.kind, [KINDS["unilateral"], KINDS["friction"]])
        target[step.first[:-1][opened]] = np.maximum(np.abs(motion[step.first[:-1][opened]]), np.finfo(float).tiny)
        change = motion - target
        arrays["b"], arrays["R"] = step.b - change - softer * step.last, step.R + softer
        finite = np.ones(len(step), bool)
        np.logical_and.at(finite, step.row_env, np.isfinite(change) & np.isfinite(arrays["b"]))
        derivative = _core.Derivative("cpu", law, np.inf, 1e-6, 512, self.threads)
        predicted = np.zeros_like(step.b)
        records = np.zeros((len(step), GRADIENT_DTYPE.itemsize), np.uint8)
        derivative.jvp_contacts(_packed_batch(arrays, law)._view(False), _core.Array(step.last), None,
                                {"b": _core.Array(change)}, {"lambda_": _core.Array(predicted)}, _core.Array(records), 1)
        refused = records.view(GRADIENT_DTYPE).reshape(-1)["flags"] & _REFUSED != 0
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


def _ids_in_use(batch, ids):
    """Ids of cones in use, uint64, one environment behind the other."""
    dtype = look("ids", ids).dtype
    take("ids", ids, dtype if dtype in ("int64", "uint64") else "uint64", batch.layout.cone_shape, "cpu")
    ids = as_numpy("ids", ids).view(np.uint64)
    if not batch.layout.padded:
        return ids.copy()
    counts = batch.layout.integers["env_cone_counts"]
    return ids[np.arange(ids.shape[1]) < counts[:, None]]


class Ridge:
    """A linear guess for every topology (which contacts there are, by their ids): reactions from b, the last b and the
    last reactions of the environment, by least squares with a penalty.

        ridge = stiction.guess.Ridge()
        guess = stiction.guess.Guess(["zero", "last", "active_set", ridge])
        ...                                         # steps to learn from
        ridge.freeze(); ridge.save("table.npz")     # from now on it is offered, and learns no more
        ridge = stiction.guess.Ridge.load("table.npz")

    regularisation: penalty, over the mean square of the features [-]. samples: how many a topology needs, times its
    numbers of features. max_rows: larger environments are left alone. max_topologies: the first ones are learned.

    Fitting calls LAPACK, whose last bits differ between machines. A frozen table is numbers in float32, and what it
    predicts has the same bits everywhere.
    """

    name = "ridge"

    def __init__(self, *, regularisation: float = 1e-6, samples: float = 10.0, max_rows: int = 96,
                 max_topologies: int = 64):
        if not regularisation > 0:
            raise ValueError(f"regularisation: expected a number > 0, got {regularisation}")
        self.regularisation, self.samples = float(regularisation), float(samples)
        self.max_rows, self.max_topologies = int(max_rows), int(max_topologies)
        self.frozen = False
        self._tables = {}  # topology -> float32 (rows, features)
        self._sums = {}    # topology -> [samples, features' products, features with reactions, samples of the table]

    def __call__(self, step):
        return self.predict(step)

    def __len__(self) -> int:
        """Topologies that have a table."""
        return len(self._tables)

    def learn(self, step, lambda_, chosen) -> None:
        """Takes the reactions of chosen environments (bool (B,)) as samples, unless it is frozen."""
        if self.frozen:
            return
        for key, envs, rows in step.groups():
            use = chosen[envs]
            if rows.shape[1] > self.max_rows or not use.any():
                continue
            if key not in self._sums:
                if len(self._sums) >= self.max_topologies:
                    continue
                size = 3 * rows.shape[1] + 1
                self._sums[key] = [0, np.zeros((size, size)), np.zeros((size, rows.shape[1])), 0]
            features = _with_one(step.features(rows[use]))
            sums = self._sums[key]
            sums[0] += len(features)
            sums[1] += features.T @ features
            sums[2] += features.T @ lambda_[rows[use]]
            if sums[0] >= self.samples * len(sums[1]) and sums[0] >= 1.2 * sums[3]:
                self._fit(key)

    def freeze(self) -> Ridge:
        """Fits what has enough samples, and learns no more."""
        if not self.frozen:
            for key, sums in self._sums.items():
                if sums[0] >= self.samples * len(sums[1]):
                    self._fit(key)
            self._sums, self.frozen = {}, True
        return self

    def predict(self, step):
        """Reactions (rows,), NaN where there is no table."""
        out = np.full_like(step.b, np.nan)
        for key, _, rows in step.groups():
            table = self._tables.get(key)
            if table is not None:
                out[rows] = _apply(table, _with_one(step.features(rows)))
        return out

    def save(self, path: str | os.PathLike) -> None:
        """Writes the tables of a frozen one as an .npz file."""
        if not self.frozen:
            raise ValueError("save: expected a frozen Ridge, got one that still learns: call freeze() first")
        keys = sorted(self._tables)
        _save(path, "ridge", {"topology": np.array(keys, "U24")} | {f"table_{i}": self._tables[key]
                                                                  for i, key in enumerate(keys)})

    @classmethod
    def load(cls, path: str | os.PathLike) -> Ridge:
        """The frozen tables of a file that save() wrote."""
        arrays = _load(path, "ridge")
        self = cls()
        for i, key in enumerate(arrays.get("topology", [])):
            table = arrays.get(f"table_{i}")
            if table is None or table.dtype != np.float32 or table.ndim != 2 or \
                    table.shape[1] != 3 * table.shape[0] + 1 or not np.isfinite(table).all():
                raise ValueError(f"{os.fspath(path)}: expected finite float32 tables (n, 3 n + 1), got another one for "
                                 f"topology {key}")
            self._tables[str(key)] = table
        self.frozen = True
        return self

    def _fit(self, key):
        count, products, targets, _ = self._sums[key]
        size = np.sqrt(np.maximum(np.diag(products) / count, np.finfo(float).tiny))
        scaled = products / count / size / size[:, None] + self.regularisation * np.eye(len(size))
        weights = np.linalg.solve(scaled, targets / count / size[:, None]) / size[:, None]
        if np.isfinite(weights).all() and np.abs(weights).max() < np.finfo(np.float32).max:
            self._tables[key] = np.ascontiguousarray(weights.T.astype(np.float32))
        self._sums[key][3] = count


class Dense:
    """A guess by dense layers with max(0, x) between them, the same numbers for every environment of its size.

    layers: (weights (out, in), biases (out,)) each. The first takes b, the last b and the last reactions of an
    environment of n rows, in the order of contact ids (in = 3 n), the last gives its reactions (out = n). Environments
    of another size get no guess. Its numbers are kept in float32; what it predicts has the same bits everywhere.
    """

    name = "dense"

    def __init__(self, layers):
        self.layers = []
        for place, (weights, biases) in enumerate(layers):
            weights, biases = (np.ascontiguousarray(value, np.float32) for value in (weights, biases))
            width = self.layers[-1][0].shape[0] if self.layers else None
            if weights.ndim != 2 or biases.shape != weights.shape[:1] or width not in (None, weights.shape[1]):
                raise ValueError(f"layers[{place}]: expected weights (out, {width or 'in'}) and biases (out,), got "
                                 f"{weights.shape} and {biases.shape}")
            if not (np.isfinite(weights).all() and np.isfinite(biases).all()):
                raise ValueError(f"layers[{place}]: expected finite numbers, got some that are not")
            self.layers.append((weights, biases))
        if not self.layers or self.layers[0][0].shape[1] != 3 * self.layers[-1][0].shape[0]:
            raise ValueError("layers: expected layers from 3 n numbers to n, got "
                             + (" to ".join(str(n) for n in (self.layers[0][0].shape[1], self.layers[-1][0].shape[0]))
                                if self.layers else "none"))

    def __call__(self, step):
        out, rows_of_one = np.full_like(step.b, np.nan), self.layers[-1][0].shape[0]
        for _, _, rows in step.groups():
            if rows.shape[1] != rows_of_one:
                continue
            values = step.features(rows)
            for place, (weights, biases) in enumerate(self.layers):
                values = _apply(np.column_stack([weights, biases]), _with_one(values))
                if place + 1 < len(self.layers):
                    values = np.maximum(values, 0.0)
            out[rows] = values
        return out

    def save(self, path: str | os.PathLike) -> None:
        """Writes the layers as an .npz file."""
        _save(path, "dense", {f"{name}_{i}": array for i, layer in enumerate(self.layers)
                              for name, array in zip(("weights", "biases"), layer)})

    @classmethod
    def load(cls, path: str | os.PathLike) -> Dense:
        """The layers of a file that save() wrote."""
        arrays, layers = _load(path, "dense"), []
        while f"weights_{len(layers)}" in arrays:
            layers.append((arrays[f"weights_{len(layers)}"], arrays.get(f"biases_{len(layers)}", np.zeros(0))))
        return cls(layers)


def _with_one(features):
    return np.concatenate([features, np.ones((len(features), 1))], axis=1)


def _apply(table, features):
    """features (E, in) times table (out, in), added up in the order of `in`, as every machine does it."""
    out = np.zeros((len(features), len(table)))
    for k in range(table.shape[1]):
        out += features[:, k:k + 1] * table[:, k].astype(np.float64)
    return out


def _save(path, kind, arrays):
    with open(path, "wb") as file:
        np.savez(file, kind=np.array(kind), version=np.array(_VERSION), **arrays)


def _load(path, kind):
    name = os.fspath(path)
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = {key: file[key] for key in file.files}
    except FileNotFoundError:
        raise
    except Exception as error:  # whatever a broken archive makes of NumPy's reader
        raise ValueError(f"{name}: expected a table that stiction.guess wrote, got a file that cannot be read "
                         f"({error})") from None
    if str(arrays.get("kind")) != kind or int(arrays.get("version", 0)) != _VERSION:
        raise ValueError(f"{name}: expected a table of kind {kind!r}, version {_VERSION}, got {arrays.get('kind')}, "
                         f"version {arrays.get('version')}")
    return arrays
