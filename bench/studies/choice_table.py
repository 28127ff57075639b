#!/usr/bin/env python3
"""Trains a table that chooses a solver from what choice_measure.py wrote, and holds it to families it has not seen.

    bench/studies/choice_table.py CSV [--json TABLE] [--out RESULTS.csv] [--forest]

The table is a tree of comparisons of features. A leaf names the solver whose costs are the least there, in the
geometric mean, every family with the same weight. A split must leave two families on either side. Families are held
out one by one: the tree and the single best solver are found on all others.

The cost is microseconds of an environment. To that comes, for the share that the judge refuses, ten times the larger
of it and what `auto` takes. So giving up early does not look quick. The oracle takes the least cost of every case.
"""

import argparse
import csv
import json
import pathlib

import numpy as np

EXTENTS, NUMBERS, ALL = 4, 10, 12  # features that extents give, that reading gives, that factorising gives
BOUNDS = 25  # that are tried of a feature
GAIN = 0.005  # the least that a split must win, in the logarithm of the mean cost


class Data:
    def __init__(self, path):
        with open(path, newline="", encoding="utf-8") as file:
            lines = list(csv.DictReader(file))
        names = list(lines[0])
        self.solvers = [name.removesuffix("_us") for name in names if name.endswith("_us")]
        self.features = names[2:names.index(f"{self.solvers[0]}_us")]
        self.family = np.array([line["family"] for line in lines])
        self.x = np.array([[float(line[name]) for name in self.features] for line in lines])
        self.us, self.solved, self.iterations = (
            np.array([[float(line[f"{solver}_{what}"]) for solver in self.solvers] for line in lines])
            for what in ("us", "solved", "iterations"))
        auto = self.us[:, [self.solvers.index("auto")]]
        us = np.where(np.isfinite(self.us), self.us, 0)
        self.cost = us + 10 * (1 - self.solved) * np.maximum(us, auto)
        self.gap = np.log(self.cost / self.cost.min(axis=1, keepdims=True))
        self.x = np.where(np.isfinite(self.x), self.x, 0.0)  # a spectrum that is not known


def weights_of(family):
    """Of lines, so that every family has the same."""
    names, place, counts = np.unique(family, return_inverse=True, return_counts=True)
    return 1 / counts[place] / len(names)


def grow(x, gap, family, levels):
    """A solver's number, or (feature, bound, tree at most the bound, tree above): one split at a time, each the best by
    itself.
    """
    weight = weights_of(family)

    def costs(rows):
        return weight[rows] @ gap[rows]

    def bounds(values):
        values = np.unique(values)
        middle = (values[1:] + values[:-1]) / 2
        return np.unique(np.percentile(middle, np.linspace(0, 100, BOUNDS), method="nearest")) if len(middle) else ()

    def best_split(rows):
        best = (costs(rows).min() - GAIN, None, None)
        for feature in range(x.shape[1]):
            for bound in bounds(x[rows, feature]):
                is_low = x[rows, feature] <= bound
                low, high = rows[is_low], rows[~is_low]
                if min(len(np.unique(family[part])) for part in (low, high)) < 2:
                    continue
                cost = costs(low).min() + costs(high).min()
                if cost < best[0]:
                    best = (cost, feature, float(bound))
        return best[1:]

    def branch(rows, levels):
        feature, bound = best_split(rows) if levels else (None, None)
        if feature is None:
            return int(np.argmin(costs(rows)))
        is_low = x[rows, feature] <= bound
        return feature, bound, branch(rows[is_low], levels - 1), branch(rows[~is_low], levels - 1)

    return branch(np.arange(len(x)), levels)


def choose(tree, x):
    while isinstance(tree, tuple):
        tree = tree[2] if x[tree[0]] <= tree[1] else tree[3]
    return tree


def held_out(data, count, levels):
    """The solver of each line by a tree that has not seen its family."""
    chosen = np.zeros(len(data.x), int)
    for name in np.unique(data.family):
        own = data.family == name
        tree = grow(data.x[~own, :count], data.gap[~own], data.family[~own], levels)
        chosen[own] = [choose(tree, x) for x in data.x[own, :count]]
    return chosen


def by_forest(data, count):
    """The same by scikit-learn's extremely randomised trees, which predict every solver's cost: more than a table."""
    from sklearn.ensemble import ExtraTreesRegressor

    chosen = np.zeros(len(data.x), int)
    for name in np.unique(data.family):
        own = data.family == name
        forest = ExtraTreesRegressor(n_estimators=60, min_samples_leaf=3, random_state=0)
        forest.fit(data.x[~own, :count], data.gap[~own], sample_weight=weights_of(data.family[~own]))
        chosen[own] = forest.predict(data.x[own, :count]).argmin(axis=1)
    return chosen


def described(data, chosen):
    """Over lines: median, 90th percentile; over families: geometric mean; the share of environments that is solved."""
    lines = np.arange(len(data.x))
    gap = data.gap[lines, chosen]
    return {"median": np.exp(np.median(gap)), "p90": np.exp(np.percentile(gap, 90)),
            "mean": np.exp(weights_of(data.family) @ gap), "solved": data.solved[lines, chosen].mean()}


def against_auto(data, chosen):
    """The mean cost over that of auto, families alike, with an interval of families drawn anew."""
    ratio = data.gap[np.arange(len(data.x)), chosen] - data.gap[:, data.solvers.index("auto")]
    each = np.array([ratio[data.family == name].mean() for name in np.unique(data.family)])
    rng = np.random.default_rng(0)
    means = [rng.choice(each, len(each)).mean() for _ in range(4000)]
    return np.exp([each.mean(), *np.percentile(means, (2.5, 97.5))])


def clock_check(data, solver="npgs"):
    """Nanoseconds of a sweep for a stored entry: 10th, 50th and 90th percentile. A clock that counts work is even."""
    k = data.solvers.index(solver)
    entries = 2 ** (data.x[:, data.features.index("log2_rows")] + data.x[:, data.features.index("log2_row_entries")])
    known = (data.solved[:, k] == 1) & (data.iterations[:, k] >= 4) & (entries > 100)
    return np.percentile(data.us[known, k] * 1e3 / (data.iterations[known, k] * entries[known]), (10, 50, 90))


def as_json(data, tree):
    if not isinstance(tree, tuple):
        return data.solvers[tree]
    return {"feature": data.features[tree[0]], "at_most": float(f"{tree[1]:.4g}"), "then": as_json(data, tree[2]),
            "else": as_json(data, tree[3])}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("csv", type=pathlib.Path)
    parser.add_argument("--json", type=pathlib.Path, help="the table that is trained on everything")
    parser.add_argument("--levels", type=int, default=3)
    parser.add_argument("--features", choices=("extents", "numbers", "spectrum"), default="numbers")
    parser.add_argument("--out", type=pathlib.Path)
    parser.add_argument("--forest", action="store_true", help="forests as well, which need scikit-learn")
    arguments = parser.parse_args()
    data = Data(arguments.csv)
    print(f"{len(data.x)} lines, {len(np.unique(data.family))} families; best how often: "
          + ", ".join(f"{s} {int((data.gap.argmin(axis=1) == k).sum())}" for k, s in enumerate(data.solvers)))
    low, middle, high = clock_check(data)
    print(f"npgs took {middle:.2f} ns a stored entry and sweep; 10 % took less than {low:.2f}, 10 % more than "
          f"{high:.2f}")
    ways = {f"always {solver}": np.full(len(data.x), k) for k, solver in enumerate(data.solvers)}
    ways["the single best of the others"] = held_out(data, 0, 0)
    for what, count in (("extents", EXTENTS), ("numbers", NUMBERS), ("spectrum", ALL)):
        for levels in (1, 2, 3, 4):
            ways[f"table, {what}, {levels} levels"] = held_out(data, count, levels)
        if arguments.forest:
            ways[f"forest, {what}"] = by_forest(data, count)
        tree = grow(data.x[:, :count], data.gap, data.family, 3)
        ways[f"table, {what}, 3 levels, on what it has seen"] = np.array([choose(tree, x) for x in data.x[:, :count]])
    rows = []
    for way, chosen in ways.items():
        found, (mean, low, high) = described(data, chosen), against_auto(data, chosen)
        rows.append({"way": way, **{name: f"{value:.3f}" for name, value in found.items()}, "over_auto": f"{mean:.3f}",
                     "low": f"{low:.3f}", "high": f"{high:.3f}"})
        print(f"{way:<46} median {found['median']:6.2f}  p90 {found['p90']:7.2f}  mean {found['mean']:6.2f}  solved "
              f"{100 * found['solved']:5.1f} %  over auto {mean:.2f} [{low:.2f}, {high:.2f}]")
    if arguments.out:
        with open(arguments.out, "w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, fieldnames=list(rows[0]))
            writer.writeheader()
            writer.writerows(rows)
    count = {"extents": EXTENTS, "numbers": NUMBERS, "spectrum": ALL}[arguments.features]
    table = as_json(data, grow(data.x[:, :count], data.gap, data.family, arguments.levels))
    print(json.dumps(table, indent=1))
    if arguments.json:
        arguments.json.write_text(json.dumps(table, indent=1) + "\n")


if __name__ == "__main__":
    main()
