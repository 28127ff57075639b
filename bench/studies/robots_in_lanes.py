#!/usr/bin/env python3
"""Whole steps of Gymnasium's robots by engine="lanes" beside mj_step, contacts on.

    PYTHONPATH=build/python bench/studies/robots_in_lanes.py [--envs 1024] [--steps 8] [--repeats 6] [--integrator Euler]
        [--models Ant g1.xml] [--cones pyramidal elliptic] [--before 200] [-o FILE.csv]

One thread, the processor's time, microseconds per simulation and step, Python included. Simulations have moved at random
for 200 to 800 steps; after 1500 to 2100 (--before 1500) humanoids lie. MuJoCo's Newton has its own defaults. From each of
those states every way takes the same steps. They take turns, A B B A, and the least of the repeats counts.

mj_step: by mujoco.rollout, one simulation after the other in one mjData. f64, f32: by lanes, tolerances 1e-6 and 1e-4.
rows: of a simulation. newton: steps of a solve, the slowest lane's apart. unsolved: simulations whose last solve ended
without its tolerance.
"""

import argparse
import csv
import pathlib
import time

import mujoco
import mujoco_models as models
import numpy as np
from mujoco import rollout

import stiction.mujoco

STATE = mujoco.mjtState.mjSTATE_FULLPHYSICS
PRECISIONS = {"f64": ("float64", 1e-6), "f32": ("float32", 1e-4)}


def first_data(model, envs, rng, before):
    found = [mujoco.MjData(model) for _ in range(envs)]
    for i, data in enumerate(found):
        data.qpos[:], data.qvel[:] = models.start(model, rng)
        data.qvel[:] *= 30
        for _ in range(before + 600 * i // envs):
            data.ctrl[:] += 0.2 * (0.5 * models.noise(model, rng, 1)[0] - data.ctrl)
            mujoco.mj_step(model, data)
    return found


def mujoco_way(model, data, steps):
    states = np.empty((len(data), mujoco.mj_stateSize(model, STATE)))
    for one, state in zip(data, states):
        mujoco.mj_getState(model, one, state, STATE)
    ctrl = np.repeat(np.array([one.ctrl for one in data])[:, None], steps, axis=1)
    warm = np.array([one.qacc_warmstart for one in data])
    runner, own = rollout.Rollout(nthread=0), mujoco.MjData(model)

    def run():
        runner.rollout(model, own, states, ctrl, nstep=steps, initial_warmstart=warm)

    return lambda: None, run


def lanes_way(simulation, steps):
    names = ("qpos", "qvel", "qacc")
    kept = [getattr(simulation, name).copy() for name in names]

    def before():
        for name, array in zip(names, kept):
            getattr(simulation, name)[:] = array

    return before, lambda: simulation.step(nstep=steps)


def measure(ways, repeats):
    least = dict.fromkeys(ways, np.inf)
    for turn in range(repeats):
        for name in list(ways) if turn % 2 == 0 else list(ways)[::-1]:
            before, run = ways[name]
            before()
            start = time.process_time()
            run()
            least[name] = min(least[name], time.process_time() - start)
    return least


def row_of(name, cone, options):
    model = models.load(name, cone)
    model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{options.integrator.upper()}")
    envs, steps = options.envs, options.steps
    data = first_data(model, envs, np.random.default_rng(1), options.before)
    made = {kind: stiction.mujoco.BatchedSimulation(model, data, engine="lanes", threads=1, dtype=dtype, tolerance=tolerance)
            for kind, (dtype, tolerance) in PRECISIONS.items()}
    rows = made["f64"].probe()["rows"].mean()
    ways = {"mj_step": mujoco_way(model, data, steps), **{kind: lanes_way(one, steps) for kind, one in made.items()}}
    us = {kind: seconds / envs / steps * 1e6 for kind, seconds in measure(ways, options.repeats).items()}
    row = {"model": pathlib.Path(name).stem, "cone": cone, "integrator": options.integrator, "envs": envs, "rows": f"{rows:.1f}"}
    row["mj_step"] = f"{us['mj_step']:.2f}"
    for kind, one in made.items():
        row[kind], row[f"ratio {kind}"] = f"{us[kind]:.2f}", f"{us['mj_step'] / us[kind]:.1f}"
        row[f"newton {kind}"] = f"{one.status['iterations'].mean():.1f}"
        row[f"unsolved {kind}"] = int((~one.solved).sum())
    return row


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--envs", type=int, default=1024)
    parser.add_argument("--steps", type=int, default=8)
    parser.add_argument("--repeats", type=int, default=6)
    parser.add_argument("--integrator", default="Euler", choices=["Euler", "RK4"])
    parser.add_argument("--models", nargs="+", default=list(models.MODELS), help="Gymnasium's names, or files that end with .xml")
    parser.add_argument("--cones", nargs="+", default=list(models.CONES))
    parser.add_argument("--before", type=int, default=200, help="steps that simulations have moved, the last 600 more")
    parser.add_argument("-o", "--out")
    options = parser.parse_args()
    rows = []
    for name in options.models:
        for cone in options.cones:
            rows.append(row_of(name, cone, options))
            print(", ".join(f"{key} {value}" for key, value in rows[-1].items()), flush=True)
    if options.out:
        with open(options.out, "w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, rows[0])
            writer.writeheader()
            writer.writerows(rows)


if __name__ == "__main__":
    main()
