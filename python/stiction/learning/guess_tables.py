"""Tables that guess reactions: ridge regression by topology, and dense layers."""

from __future__ import annotations

import os

import numpy as np

from ..core.arguments import whole

#: Version of files of tables.
_VERSION = 1


class Ridge:
    """A linear guess for every topology, the set of contacts, by their ids. Reactions follow from b, the last b and
    the last reactions of the environment, by least squares with a penalty.

        ridge = stiction.learning.Ridge()
        guess = stiction.learning.Guess(["zero", "last", "active_set", ridge])
        ...                                         # steps to learn from
        ridge.freeze(); ridge.save("table.npz")     # from now on it is offered, and learns no more
        ridge = stiction.learning.Ridge.load("table.npz")

    regularisation: penalty, over the mean square of the features [-]. samples: how many a topology needs, times its
    numbers of features. max_rows: larger environments are left alone. max_topologies: the first ones are learned.

    Fitting calls LAPACK, whose last bits differ between machines. A frozen table is numbers in float32, and its
    predictions have the same bits everywhere.
    """

    name = "ridge"

    def __init__(self, *, regularisation: float = 1e-6, samples: float = 10.0, max_rows: int = 96,
                 max_topologies: int = 64):
        if not regularisation > 0:
            raise ValueError(f"regularisation: expected a number > 0, got {regularisation}")
        self.regularisation, self.samples = float(regularisation), float(samples)
        self.max_rows, self.max_topologies = whole("max_rows", max_rows), whole("max_topologies", max_topologies)
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
        """Fits tables with enough samples, and learns no more."""
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

    layers: (weights (out, in), biases (out,)) each. The first takes b, the last b and the last reactions of n rows in
    the order of contact ids: in = 3 n. The last gives the reactions: out = n. Environments
    of another size get no guess. Its numbers are kept in float32; its predictions have the same bits everywhere.
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
        raise ValueError(f"{name}: expected a table that stiction.learning wrote, got a file that cannot be read "
                         f"({error})") from None
    if str(arrays.get("kind")) != kind or int(arrays.get("version", 0)) != _VERSION:
        raise ValueError(f"{name}: expected a table of kind {kind!r}, version {_VERSION}, got {arrays.get('kind')}, "
                         f"version {arrays.get('version')}")
    return arrays
