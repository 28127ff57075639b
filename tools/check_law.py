#!/usr/bin/env python3
"""Judges reactions of a contact-batch file by the law that each contact has to obey (docs/math/residual.md).

    tools/check_law.py BATCH [SOLUTION] [--law convex|coulomb] [--tolerance 1e-6] [--worst N] [--quiet]

Without a solution the batch's own `lambda_ref` is judged. Prints quantiles of the relative error of an environment, and
with --worst the contacts that are furthest off. Exit status 0: every environment is within the tolerance.

It shares no code with a solver nor with `stiction verify`. Other programs use `residuals` or `judge`. Needs numpy and
h5py.
"""

import argparse
import sys
from typing import NamedTuple

import h5py
import numpy as np

FREE, UNILATERAL, BOX, FRICTION, BOX_FRICTION, SEMIDEFINITE = range(6)  # cone_kind of the file
NAMES = ("free", "unilateral", "box", "friction", "box_friction", "semidefinite")
BOUNDLESS = 1e20  # an upper bound of that size is infinite, and a lower one of its negative
IDLE = 1e-4  # share of the largest |b| that an island's scale is at least
Wide = np.longdouble  # squares of doubles are no infinity there


class Judged(NamedTuple):
    """One entry for each environment."""

    relative: np.ndarray  # largest error / scale of its island [-]
    cone: np.ndarray      # whose that is, counted within the environment; -1: none has an error
    error: np.ndarray     # of that cone [w]
    scale: np.ndarray     # of that cone's island [w]
    absolute: np.ndarray  # largest error of a cone [w]


def law_of(batch):
    law = batch.attrs.get("law", "convex")
    return law.decode() if isinstance(law, bytes) else law


def residuals(batch, reaction, law=None):
    """Relative error of each environment of the open file; infinite where anything is not finite."""
    return judge(batch, reaction, law).relative


def judge(batch, reaction, law=None):
    """The open file's environments under the reactions (rows). \\throws ValueError if there is not one for every row."""
    rows_of, cones_of = batch["env_row_ptr"][:], batch["env_cone_ptr"][:]
    x = np.asarray(reaction, float)
    if x.shape != (rows_of[-1],):
        raise ValueError(f"lambda has shape {x.shape}, the batch has {rows_of[-1]} rows")
    law = law or law_of(batch)
    if law not in ("convex", "coulomb"):
        raise ValueError(f"law {law!r}: expected convex or coulomb")
    b = batch["b"][:].astype(float)
    with np.errstate(all="ignore"):
        row, column, value = entries(batch, rows_of)
        compliance = batch["R"][:].astype(float)
        w = np.bincount(row, value * x[column], len(x)) + compliance * x + b
        diagonal = np.maximum(np.bincount(row, value * (row == column), len(x)) + compliance, 0)
        cones = Cones(batch)
        error = cones.errors(x, w, diagonal, law)
        without = cones.errors(np.zeros_like(x), b, diagonal, law)
        island = islands(len(cones.kind), cones.of_row[row[value != 0]], cones.of_row[column[value != 0]])
        scale = np.zeros(len(error))
        np.maximum.at(scale, island[cones.of_row], IDLE * np.abs(b))
        np.maximum.at(scale, island, without)
        scale = scale[island]
        relative = np.where(error == 0, 0.0, np.where(scale > 0, error / scale, np.inf))
        relative[~np.isfinite(error)] = np.inf
        return worst_of(cones_of, relative, error, scale)


def worst_of(cones_of, relative, error, scale):
    count = len(cones_of) - 1
    found = Judged(np.zeros(count), np.full(count, -1), np.zeros(count), np.zeros(count), np.zeros(count))
    for env, (first, last) in enumerate(zip(cones_of[:-1], cones_of[1:])):
        if first == last or not (error[first:last] != 0).any():
            continue
        off = ~np.isfinite(error[first:last])
        worst = int(np.argmax(off)) if off.any() else int(np.argmax(relative[first:last]))
        found.relative[env], found.cone[env] = relative[first + worst], worst
        found.error[env], found.scale[env] = error[first + worst], scale[first + worst]
        found.absolute[env] = error[first:last].max()
    return found


def entries(batch, rows_of):
    """(row, column, value) of A; columns count from the batch's first row."""
    row = np.repeat(np.arange(rows_of[-1]), np.diff(batch["A/ptr"][:]))
    first = np.repeat(rows_of[:-1], np.diff(rows_of))
    return row, batch["A/col"][:] + first[row], batch["A/val"][:].astype(float)


def islands(count, left, right):
    """A number for each of `count` cones, equal where pairs (left, right) join them: the smallest cone reached."""
    label = np.arange(count)
    left, right = left[left != right], right[left != right]
    while len(left):
        least = np.minimum(label[left], label[right])
        before = label.copy()
        for side in (label[left], label[right], left, right):
            np.minimum.at(label, side, least)
        while (label[label] != label).any():
            label = label[label]
        if (label == before).all():
            break
    return label


class Cones:
    def __init__(self, batch):
        self.kind, self.offsets = batch["cone_kind"][:], batch["cone_row_ptr"][:]
        self.sizes = np.diff(self.offsets)
        self.of_row = np.repeat(np.arange(len(self.kind)), self.sizes)
        self.parameter = batch["row_param"][:].astype(float)
        self.low = batch["row_lo"][:].astype(float) if "row_lo" in batch else -self.parameter
        self.high = batch["row_hi"][:].astype(float) if "row_hi" in batch else self.parameter

    def errors(self, reaction, w, diagonal, law):
        """Error of every cone [w]; those of one kind and size are taken together."""
        found = np.zeros(len(self.kind))
        for kind, size in {*zip(self.kind.tolist(), self.sizes.tolist())}:
            own = np.flatnonzero((self.kind == kind) & (self.sizes == size))
            rows = self.offsets[own][:, None] + np.arange(size)
            f, y, d = (values[rows].astype(Wide) for values in (reaction, w, diagonal))
            broken = ~(np.isfinite(f) & np.isfinite(y) & np.isfinite(d)).all(axis=1)
            if kind == FREE:
                error = length(y)
            elif kind == UNILATERAL:
                error = unilateral((d * f)[:, 0], y[:, 0])
            elif kind == BOX:
                error = box(d * f, y, -upper(d, -self.low[rows]), upper(d, self.high[rows]))[:, 0]
            elif kind == SEMIDEFINITE:
                error = semidefinite(f, y, d)
            else:
                mu = self.parameter[rows][:, 1:].astype(Wide)
                broken |= ~np.isfinite(mu).all(axis=1)
                error = friction(f, y, d, mu, None if kind == BOX_FRICTION else law)
            found[own] = np.where(broken | ~np.isfinite(error), np.inf, error)
        return found


def length(*parts):
    """Euclidean norm over the columns of all parts."""
    return np.sqrt(sum(np.square(part if part.ndim == 2 else part[:, None]).sum(axis=1) for part in parts))


def unilateral(x, y):
    return np.minimum(np.hypot(x, np.minimum(y, 0)), np.hypot(y, np.minimum(x, 0)))


def upper(d, bound):
    return np.where(bound >= BOUNDLESS, np.inf, d * bound)


def box(x, y, low, high):
    """At the lower bound, between the two, at the upper one. A bound at infinity is at an infinite distance."""
    between = np.hypot(y, np.maximum(np.maximum(low - x, x - high), 0))
    return np.minimum(between, np.minimum(np.hypot(x - low, np.minimum(y, 0)), np.hypot(x - high, np.maximum(y, 0))))


def friction(f, w, d, mu, law):
    """Friction cones of one size; without a law those of boxed friction. Axes without friction carry nothing."""
    both_move = (d > 0) & (d[:, :1] > 0)
    unit = np.sqrt(np.where(both_move, d[:, :1] / np.where(both_move, d, 1), 1))
    x, y, grips = unit * d * f, unit * w, mu > 0
    carried = length(np.where(grips, 0, x[:, 1:]))
    if law is None:
        bound = (unit * d)[:, 1:] * mu * np.maximum(f[:, :1], 0)
        boxed = np.where(grips, box(x[:, 1:], y[:, 1:], -bound, bound), 0)
        return length(unilateral(x[:, 0], y[:, 0]), boxed, carried)
    m = np.where(grips, mu / unit[:, 1:], 1)
    x[:, 1:], y[:, 1:] = np.where(grips, x[:, 1:], 0), np.where(grips, y[:, 1:], 0)
    grip = np.where(d[:, 1:] > 0, m, 0)  # no reaction is missed in a row that none moves
    return np.hypot(nearest_member(x[:, 0], x[:, 1:], y[:, 0], y[:, 1:], m, grip, law == "convex"), carried)


def nearest_member(xn, xt, yn, yt, m, grip, lifts):
    """Distance of (x, y) from the nearest of a contact's four members: open, sticks, slides by motion or reaction."""
    load, slip = length(xt / m), length(m * yt)
    members = [length(xn, xt, np.minimum(yn - slip if lifts else yn, 0))]
    holds = np.maximum(xn, 0)
    short = np.where(load > holds, 1 - holds / np.where(load > 0, load, 1), 0)
    members.append(length(yn, yt, xn - holds, short[:, None] * xt))
    for direction, size in ((m * yt, slip), (-xt / m, load)):
        way = direction / np.where(size > 0, size, 1)[:, None]
        force = np.column_stack((np.ones(len(xn), Wide), -grip * way))
        moves = np.column_stack((np.full(len(xn), float(lifts), Wide), way / m))
        x, y = np.column_stack((xn, xt)), np.column_stack((yn, yt))
        members.append(np.where(size > 0, length(off_ray(x, force), off_ray(y, moves)), np.inf))
    return np.min([np.where(np.isfinite(one), one, np.inf) for one in members], axis=0)


def off_ray(z, ray):
    """z less its nearest point of the half-line along `ray`."""
    square = (ray * ray).sum(axis=1)
    along = np.maximum((z * ray).sum(axis=1) / np.where(square > 0, square, 1), 0)
    return z - along[:, None] * ray


def semidefinite(f, w, d):
    """sqrt(2) times the distance of x from the nearest matrix to x - y. Rows: upper triangle, columns one by one."""
    a = d.mean(axis=1, keepdims=True)
    x = np.where(a > 0, a, 1) * f
    z = (x - w).astype(float)
    order = 2 if z.shape[1] == 3 else 3
    column, row = np.tril_indices(order)
    factor = np.where(row == column, 1.0, np.sqrt(2.0))
    whole = np.zeros((len(z), order, order))
    whole[:, row, column] = whole[:, column, row] = np.where(np.isfinite(z), z, 0) / factor
    value, vector = np.linalg.eigh(whole)
    kept = (vector * np.maximum(value, 0)[:, None, :]) @ np.swapaxes(vector, 1, 2)
    return np.sqrt(Wide(2)) * length(x - kept[:, row, column] * factor)


def main(words=None):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("batch")
    parser.add_argument("solution", nargs="?")
    parser.add_argument("--law", choices=("convex", "coulomb"))
    parser.add_argument("--tolerance", type=float, default=1e-6)
    parser.add_argument("--worst", type=int, default=0, help="how many environments to name")
    parser.add_argument("--quiet", action="store_true")
    arguments = parser.parse_args(words)
    with h5py.File(arguments.batch) as batch:
        law = arguments.law or law_of(batch)
        if arguments.solution:
            with h5py.File(arguments.solution) as solution:
                reaction = solution["lambda"][:]
        elif "lambda_ref" in batch:
            reaction = batch["lambda_ref"][:]
        else:
            sys.exit(f"{arguments.batch} has no lambda_ref: give a solution file")
        found = judge(batch, reaction, law)
        kinds, cones_of = batch["cone_kind"][:], batch["env_cone_ptr"][:]
    above = int((~(found.relative <= arguments.tolerance)).sum())
    if not arguments.quiet and len(found.relative):
        low, middle, high, most = np.quantile(found.relative, [0, 0.5, 0.9, 1], method="higher")
        print(f"{arguments.solution or arguments.batch}: {len(found.relative)} environments, law {law}, error min {low:.1e} "
              f"median {middle:.1e} p90 {high:.1e} max {most:.1e}, above {arguments.tolerance:g}: {above}")
        for env in np.argsort(-found.relative)[:arguments.worst]:
            if found.cone[env] >= 0:
                print(f"  environment {env}: cone {found.cone[env]} ({NAMES[kinds[cones_of[env] + found.cone[env]]]}), relative "
                      f"{found.relative[env]:.2e}, error {found.error[env]:.2e}, scale {found.scale[env]:.2e}")
    return 1 if above else 0


if __name__ == "__main__":
    sys.exit(main())
