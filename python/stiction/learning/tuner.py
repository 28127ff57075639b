"""A choice of solver that learns from the clock over a training run: opt-in, with a log and a kill switch.

    tuner = stiction.learning.Tuner([{"solver": "auto"}, {"solver": "npgs"}, {"solver": "newton"}], log="tuner.jsonl")
    solver = stiction.learning.TunedSolver(tuner, tolerance=1e-4)
    solution = solver.solve(batch)                          # every step
    tuner.save("tuner.json")                                # Tuner.load("tuner.json") is frozen

The learned choice decides which solver answers, and so the bits. A tuner that learns reads a clock: its run cannot be
repeated bit for bit. A frozen one chooses by the batch alone, and its runs can. Quality is no matter of trust: every
environment's status has its residual (docs/math/tuner.md).
"""

from __future__ import annotations

import collections
import json
import math
import os
import time

import numpy as np

from ..core.arguments import not_negative
from ..core.batch import Batch
from ..core.solver import Solver

__all__ = ["TunedSolver", "Tuner", "features"]

#: Names of a context's numbers, in order.
FEATURES = ("one", "log2 rows of an environment", "log2 environments", "log2 numbers of a row", "coulomb", "float64",
            "minus log10 tolerance")
_FORMAT = "stiction-tuner"


def features(batch: Batch, tolerance: float) -> np.ndarray:
    """Features of a batch for the choice: seven numbers of FEATURES, from its extents alone. No array is read, so
    memory of a device is not waited for.
    """
    tolerance = not_negative("tolerance", tolerance)
    environments, rows = max(len(batch), 1), max(batch.rows, 1)
    stored = sum(math.prod(np.shape(array)) for array in batch.arrays.values())
    return np.array([1.0, math.log2(rows / environments + 1), math.log2(environments), math.log2(stored / rows + 1),
                     batch.law == "coulomb", batch.dtype == "float64", -math.log10(max(tolerance, 1e-16))])


class Tuner:
    """Which of several choices costs least in a context: LinUCB with a model of each choice (Li, Chu, Langford,
    Schapire, WWW 2010, algorithm 1). The reward is minus the logarithm of the cost.

    choices: dicts of options, or anything that JSON can hold. The first is the default, which the others must beat.
    exploration: alpha of LinUCB, >= 0: how much an uncertain choice is favoured.
    patience, margin: the kill switch. The mean logarithm of the last `patience` costs is compared with the default's
        predicted cost there. Beyond log(margin) the tuner stops for good: from then on it takes the default. stop()
        does the same at once, and so does the environment variable STICTION_TUNER=off.
    control: of so many decisions one takes the default whatever is known, so that its cost stays known. 0: none.
    log: a file that gets a line of JSON for each decision that was learned from.

    Attributes: `frozen`, `stopped` (a sentence that says why, or None), `decisions`, `regret`. The regret is the sum over
    decisions of log(cost) over the least that any choice was predicted to cost. One thread at a time may use it.
    """

    def __init__(self, choices, *, exploration: float = 0.5, patience: int = 200, margin: float = 1.05,
                 control: int = 20, log: str | os.PathLike | None = None):
        self.choices = [_plain(f"choices[{place}]", choice) for place, choice in enumerate(choices)]
        if not self.choices:
            raise ValueError("choices: expected at least one, got none")
        for name, value, least in (("exploration", exploration, 0), ("patience", patience, 1), ("margin", margin, 1),
                                   ("control", control, 0)):
            if not value >= least or not math.isfinite(value):
                raise ValueError(f"{name}: expected a finite number of at least {least}, got {value!r}")
        self.exploration, self.patience = float(exploration), int(patience)
        self.margin, self.control = float(margin), int(control)
        self.frozen, self.decisions, self.regret, self._models = False, 0, 0.0, None
        self.stopped = "STICTION_TUNER=off" if os.environ.get("STICTION_TUNER") == "off" else None
        self._excess = collections.deque(maxlen=self.patience)
        self._log = None if log is None else open(log, "a", encoding="utf-8")  # noqa: SIM115 - open for a run

    def __repr__(self):
        state = f"stopped: {self.stopped}" if self.stopped else "frozen" if self.frozen else "learning"
        return f"<stiction.learning.Tuner of {len(self.choices)} choices, {self.decisions} decisions, {state}>"

    def choose(self, context) -> int:
        """The number of the choice for a context: a vector of finite numbers, as long in every call."""
        x = self._context(context)
        if self.stopped:
            return 0
        if not self.frozen and self.control and self.decisions % self.control == self.control - 1:
            return 0
        width = 0.0 if self.frozen else self.exploration
        return int(np.argmax([model.reward(x) + width * model.doubt(x) for model in self._models]))

    def learn(self, context, choice: int, cost: float) -> None:
        """Records the cost of a choice in a context: a positive number, in whatever unit. Costs that are not finite
        are refused. A tuner that is frozen or stopped learns nothing.
        """
        x = self._context(context)
        if not 0 <= choice < len(self.choices):
            raise ValueError(f"choice: expected 0 to {len(self.choices) - 1}, got {choice!r}")
        if not (math.isfinite(cost) and cost > 0):
            raise ValueError(f"cost: expected a finite number above 0, got {cost!r}")
        if self.frozen or self.stopped:
            return
        predicted = [-model.reward(x) for model in self._models]
        is_known = all(model.count >= len(x) for model in self._models)
        self._models[choice].learn(x, -math.log(cost))
        self.decisions += 1
        if is_known:
            self.regret += max(0.0, math.log(cost) - min(predicted))
            self._excess.append(math.log(cost) - predicted[0])
        if self._log:
            self._log.write(json.dumps({"decision": self.decisions, "context": x.tolist(), "choice": choice, "cost": cost,
                                        "predicted": predicted, "regret": self.regret}) + "\n")
            self._log.flush()
        if len(self._excess) == self.patience and np.mean(self._excess) > math.log(self.margin):
            self.stop(f"the last {self.patience} decisions cost {math.exp(np.mean(self._excess)):.2f} times what the "
                      f"default is predicted to have cost")

    def stop(self, reason: str = "by hand") -> None:
        """From now on the default is taken, and nothing is learned."""
        self.stopped = self.stopped or reason

    def freeze(self) -> Tuner:
        """From now on the choice depends on the context alone. Returns the tuner."""
        self.frozen = True
        return self

    def save(self, path: str | os.PathLike) -> None:
        """Writes the learned numbers as JSON: beside the file first, so that a reader never sees half of it."""
        models = None if self._models is None else [model.state() for model in self._models]
        text = json.dumps({"format": _FORMAT, "version": 1, "choices": self.choices, "exploration": self.exploration,
                           "decisions": self.decisions, "stopped": self.stopped, "models": models})
        part = f"{os.fspath(path)}.{os.getpid()}.part"
        with open(part, "w", encoding="utf-8") as file:
            file.write(text + "\n")
        os.replace(part, path)

    @classmethod
    def load(cls, path: str | os.PathLike, **options) -> Tuner:
        """A frozen tuner that chooses as the saved one would. options: of the constructor; then freeze() is undone by
        setting `frozen` to False.
        """
        with open(path, encoding="utf-8") as file:
            try:
                saved = json.load(file)
                if saved["format"] != _FORMAT or saved["version"] != 1:
                    raise ValueError(f"format {saved['format']!r}, version {saved['version']!r}")
                tuner = cls(saved["choices"], **{"exploration": saved["exploration"]} | options)
                tuner.decisions, tuner.stopped = int(saved["decisions"]), tuner.stopped or saved["stopped"]
                if saved["models"] is not None:
                    tuner._models = [_Model.of(state) for state in saved["models"]]
            except (KeyError, TypeError, ValueError) as error:
                raise ValueError(f"{path}: expected a file of Tuner.save, got another one: {error}") from None
        return tuner.freeze()

    def _context(self, context):
        x = np.asarray(context, np.float64)
        if x.ndim != 1 or not x.size or not np.isfinite(x).all():
            raise ValueError(f"context: expected a vector of finite numbers, got {context!r}")
        if self._models is None:
            self._models = [_Model(len(x)) for _ in self.choices]
        if len(x) != len(self._models[0].sum):
            raise ValueError(f"context: expected {len(self._models[0].sum)} numbers as before, got {len(x)}")
        return x


class _Model:
    """Ridge regression of the rewards of one choice, and how little is known in a direction."""

    def __init__(self, size):
        self.matrix, self.sum, self.count = np.eye(size), np.zeros(size), 0

    def learn(self, x, reward):
        self.matrix += np.outer(x, x)
        self.sum += reward * x
        self.count += 1

    def reward(self, x):
        return float(x @ np.linalg.solve(self.matrix, self.sum))

    def doubt(self, x):
        return math.sqrt(max(float(x @ np.linalg.solve(self.matrix, x)), 0.0))

    def state(self):
        return {"matrix": self.matrix.tolist(), "sum": self.sum.tolist(), "count": self.count}

    @classmethod
    def of(cls, state):
        model = cls(len(state["sum"]))
        model.matrix, model.sum = np.array(state["matrix"], float), np.array(state["sum"], float)
        model.count = int(state["count"])
        if model.matrix.shape != (len(model.sum),) * 2 or not np.isfinite(model.matrix).all():
            raise ValueError("a model that is no square matrix of finite numbers")
        return model


class TunedSolver:
    """Solves batches by its tuner's choice, and tells it the cost.

    The cost is the seconds of the solve, ten times as much for the share of environments that were not solved (PAR10).
    device, tolerance and options: of every stiction.Solver, which the options of a choice override. A batch in device
    memory is waited for while the tuner learns.

    Attribute `choice`: the number of the last choice.
    """

    def __init__(self, tuner: Tuner, device: str = "cpu", tolerance: float = 1e-4, **options):
        if not isinstance(tuner, Tuner):
            raise TypeError(f"tuner: expected a stiction.learning.Tuner, got {type(tuner).__name__}")
        self.tuner, self.tolerance, self.choice = tuner, float(tolerance), None
        self.solvers = []
        for place, choice in enumerate(tuner.choices):
            if not isinstance(choice, dict):
                raise TypeError(f"choices[{place}]: expected a dict of options of stiction.Solver, got {choice!r}")
            self.solvers.append(Solver(device, **{"tolerance": tolerance} | options | choice))

    def solve(self, batch: Batch, *arguments, **named):
        """As Solver.solve."""
        context = features(batch, self.tolerance)
        self.choice = self.tuner.choose(context)
        start = time.perf_counter()
        solution = self.solvers[self.choice].solve(batch, *arguments, **named)
        if not (self.tuner.frozen or self.tuner.stopped):
            solved = solution.solved  # waits
            seconds = time.perf_counter() - start
            missed = 1 - float(np.mean(solved)) if len(solved) else 0.0
            self.tuner.learn(context, self.choice, seconds * (1 + 9 * missed))
        return solution


def _plain(name, value):
    """The value as it comes back from a file."""
    try:
        return json.loads(json.dumps(value))
    except (TypeError, ValueError) as error:
        raise TypeError(f"{name}: expected something that JSON can hold, got {value!r}: {error}") from None
