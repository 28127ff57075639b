#!/usr/bin/env python3
"""Values and derivatives of stiction.jax.solve by XLA custom call and by host callback, beside the library's own.

    PYTHONPATH=build/python bench/studies/jax_derivatives.py [FILE ...] [--data DATA] [--envs 256,4096] [--repeats 6]

Files are contact batches, by default three robots of DATA/mujoco. JAX has the same cones in all environments: a file
gives those of its most frequent cones. They are repeated, with every b changed by 5 % (normal noise). Single precision,
convex law. A call is a value and its derivatives by A, b, mu, R, lo and hi, from reactions and motion. Microseconds of
the processor per environment. Ways take turns, A B B A, and the least of the repeats counts.

library: stiction.Solver and stiction.Derivative on NumPy's arrays, the Batch made anew. kept: one Batch for all calls.
"""

import argparse
import collections
import pathlib
import sys
import time

import jax
import numpy as np

HERE = pathlib.Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent / "arena")]

from environments import BOX, FRICTION, read_environments  # noqa: E402

import stiction  # noqa: E402
import stiction.jax  # noqa: E402

KINDS = ("free", "unilateral", "box", "friction")
SWEEPS = 10
RELAXED = {"tolerance": 1e-6, "kappa": 1e-3}
UNROLLED = {"solver": "pgs", "tolerance": 0.0, "max_iterations": SWEEPS, "derivative": "unrolled"}


def problems(path, envs):
    """A, b, mu, R, lo, hi and the cones."""
    alike = collections.defaultdict(list)
    for one in read_environments(path):
        alike[tuple((KINDS[kind], int(size)) for kind, size in zip(one.kinds, one.cone_sizes))].append(one)
    cones, found = max(alike.items(), key=lambda item: (len(item[1]), len(item[0])))
    kinds = found[0].row_kinds
    A, R, b, param = (np.stack([part(one) for one in found]) for part in (
        lambda one: one.dense() - np.diag(one.compliance), lambda one: one.compliance, lambda one: one.b,
        lambda one: one.row_param))
    bound = np.where(kinds == BOX, param, 0)
    at = np.arange(envs) % len(found)
    arrays = [part[at] for part in (A, b, np.where(kinds == FRICTION, param, 0), R, -bound, bound)]
    arrays[1] *= 1 + 0.05 * np.random.default_rng(0).normal(size=arrays[1].shape)
    return [np.ascontiguousarray(part, "f4") for part in arrays], cones


def of_the_library(numbers, cones, by, options, kept):
    A, b, mu, R, lo, hi = numbers
    rules = {name: value for name, value in options.items() if name not in ("kappa", "derivative")}
    is_unrolled = "derivative" in options
    solver = stiction.Solver(**rules, **({"stall_window": 0} if is_unrolled else {}))
    derivative, start = stiction.Derivative(kappa=options.get("kappa", 0.0)), np.zeros_like(b)

    def batch():
        return stiction.Batch.from_delassus(A, b, mu=mu, R=R, lo=lo, hi=hi, cones=list(cones))

    one = batch()

    def call():
        own = one if kept else batch()
        solution = solver.solve(own, warm_start=start if is_unrolled else None)
        if is_unrolled:
            return derivative.unrolled_vjp(own, SWEEPS, warm_start=start, lambda_=by[0], w=by[1])
        return derivative.vjp(own, solution, lambda_=by[0], w=by[1])

    return call


def of_jax(numbers, cones, by, options, allow_ffi):
    def pulled(numbers, by):
        answer, pull = jax.vjp(lambda *numbers: stiction.jax.solve(*numbers, cones=cones, allow_ffi=allow_ffi,
                                                                   **options)[:2], *numbers)
        return answer, pull(tuple(by))

    compiled = jax.jit(pulled)
    numbers, by = jax.device_put(numbers), jax.device_put(by)
    return lambda: jax.block_until_ready(compiled(numbers, by))


def turn(call):
    count, begin = 0, time.process_time()
    while count < 3 or time.process_time() - begin < 0.25:
        call()
        count += 1
    return (time.process_time() - begin) / count


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="*")
    parser.add_argument("--data", type=pathlib.Path, default=HERE.parents[1].parent / "shared" / "data")
    parser.add_argument("--envs", default="256,4096")
    parser.add_argument("--repeats", type=int, default=6)
    args = parser.parse_args()
    files = args.files or [args.data / "mujoco" / f"{name}.h5" for name in ("humanoid", "go1", "g1")]
    print("| case | rows | environments | derivatives | library | kept | callback | custom call |\n" + "|---" * 8 + "|")
    for path in map(pathlib.Path, files):
        for envs in map(int, args.envs.split(",")):
            numbers, cones = problems(path, envs)
            by = list(np.random.default_rng(1).normal(size=(2, *numbers[1].shape)).astype("f4"))
            for name, options in (("implicit", {"tolerance": 1e-6}), ("relaxed", RELAXED), ("unrolled", UNROLLED)):
                ways = [of_the_library(numbers, cones, by, options, kept) for kept in (False, True)]
                ways += [of_jax(numbers, cones, by, options, allow_ffi) for allow_ffi in (False, True)]
                least = [turn(way) for way in ways]
                for repeat in range(args.repeats):
                    order = range(len(ways)) if repeat % 2 else reversed(range(len(ways)))
                    for way in order:
                        least[way] = min(least[way], turn(ways[way]))
                times = " | ".join(f"{seconds / envs * 1e6:.3g} µs" for seconds in least)
                print(f"| `{path.stem}` | {numbers[1].shape[1]} | {envs} | {name} | {times} |", flush=True)


if __name__ == "__main__":
    main()
