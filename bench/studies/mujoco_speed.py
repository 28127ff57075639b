#!/usr/bin/env python3
"""Microseconds per environment of the solve stage: stiction's batched solve, assembly included, and MuJoCo's Newton.

    PYTHONPATH=build/python bench/studies/mujoco_speed.py [--envs 128] [--steps 10] [--solvers auto newton] [-o FOLDER]

Gymnasium's models under noise, one thread, the processor's time. In every stage of every step both solve the same
systems, one after the other. MuJoCo solves them by mj_fwdConstraint, called without the interpreter for all
simulations. It is warm started from its last accelerations, with the default tolerance and others. stiction gathers
rows, solves and writes back, warm started from its last reactions. `stiction.verify` judges
both answers. The table has, for each accuracy of stiction, the cheapest setting of MuJoCo whose residuals are as
small: their 95th percentile is not above stiction's. Writes FOLDER/mujoco_speed.csv.
"""

import argparse
import csv
import itertools
import pathlib
import time

import mujoco
import mujoco_models as models
import numpy as np

import stiction
from stiction.monitor import Progress
from stiction.mujoco import BatchedSimulation

TOLERANCES = (1e-4, 1e-6, 1e-8)
THEIR_TOLERANCES = (1e-2, 1e-4, 1e-6, 1e-8, 1e-12)
WARM_UP = 0.6  # seconds of simulation before the race: the robots lie or stand on the ground


class Race(BatchedSimulation):
    """Solves every stage by MuJoCo too, at several tolerances, and goes on with stiction's answer."""

    def start(self, steps):
        self.turn, self.judged = 0, steps
        self.times = {tolerance: [] for tolerance in ("ours",) + THEIR_TOLERANCES}
        self.residuals = {tolerance: [] for tolerance in self.times}
        self.rows = []

    def _run_solves(self, key, stages, count=1):
        if not hasattr(self, "times"):
            return super()._run_solves(key, stages, count)
        for before, after in stages():
            self._run(*before)
            self._race()
            self._run(*after)

    def _race(self):
        self.turn += 1
        forces = {}
        for tolerance in np.roll(THEIR_TOLERANCES, self.turn):
            self.model.opt.tolerance = tolerance
            start = time.thread_time()
            self._run("mj_fwdConstraint")
            self.times[tolerance].append(time.thread_time() - start)
            forces[tolerance] = np.concatenate([one.efc_force.copy() for one in self.data])
        start = time.thread_time()
        super()._run_solves("solve", lambda: (((), ()),))
        self.times["ours"].append(time.thread_time() - start)
        self.rows.append(sum(one.nefc for one in self.data))
        if self.turn % self.judged == 0:
            batch = self.batch()
            forces["ours"] = batch.extras["lambda_"]
            for tolerance, lambda_ in forces.items():
                self.residuals[tolerance].append(stiction.verify(batch, lambda_)[:, 0])


def race(name, cone, tolerance, envs, steps, solver):
    model = models.load(name, cone)
    rng = np.random.default_rng(2)
    simulation = Race(model, envs, solver=solver, tolerance=tolerance, threads=1)
    for data in simulation.data:
        data.qpos[:], data.qvel[:] = models.start(model, rng)
        data.ctrl[:] = models.noise(model, rng, 1)[0]
        mujoco.mj_step(model, data, nstep=round(WARM_UP / model.opt.timestep))
    simulation.step(models.noise(model, rng, envs))
    simulation.start(steps)
    for _ in range(steps):
        simulation.step(models.noise(model, rng, envs))
    cost = {key: 1e6 * float(np.median(values)) / envs for key, values in simulation.times.items()}
    error = {key: float(np.quantile(np.concatenate(values), 0.95)) for key, values in simulation.residuals.items()}
    as_small = [key for key in THEIR_TOLERANCES if error[key] <= error["ours"]]
    theirs = min(as_small, key=lambda key: cost[key]) if as_small else THEIR_TOLERANCES[-1]
    return {"model": name, "cone": cone, "solver": solver, "envs": envs, "rows": np.mean(simulation.rows) / envs,
            "tolerance": tolerance, "residual_p95": error["ours"], "us": cost["ours"], "mujoco_tolerance": theirs,
            "mujoco_residual_p95": error[theirs], "mujoco_us": cost[theirs], "ratio": cost[theirs] / cost["ours"],
            "mujoco_reaches_it": bool(as_small), "mujoco_default_us": cost[1e-8],
            "mujoco_default_residual_p95": error[1e-8]}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--envs", type=int, default=128)
    parser.add_argument("--steps", type=int, default=10)
    parser.add_argument("--solvers", nargs="+", default=["auto", "newton"])
    parser.add_argument("--tolerances", nargs="+", type=float, default=TOLERANCES)
    parser.add_argument("-o", "--output", type=pathlib.Path, help="folder for mujoco_speed.csv")
    options = parser.parse_args()
    races = list(itertools.product(models.MODELS, models.CONES, options.solvers, options.tolerances))
    rows, bar = [], Progress(races, title="speed", unit="race")
    for name, cone, solver, tolerance in bar:
        row = race(name, cone, tolerance, options.envs, options.steps, solver)
        rows.append({key: f"{value:.3g}" if isinstance(value, float) else value for key, value in row.items()})
        bar.print(" ".join(f"{key}={value}" for key, value in rows[-1].items()))
    if options.output:
        with open(options.output / "mujoco_speed.csv", "w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, rows[0])
            writer.writeheader()
            writer.writerows(rows)


if __name__ == "__main__":
    main()
