#!/usr/bin/env python3
"""stiction inside MuJoCo against MuJoCo's own Newton, on Gymnasium's models.

    PYTHONPATH=build/python bench/studies/mujoco_agreement.py [--steps 1000] [--tolerance 1e-10] [-o FOLDER]

Each model is driven by noise over the whole range of its actuators, from a disturbed start, all from one seed. At the
state of every step MuJoCo's Newton and stiction give accelerations. (Newton has tolerance 1e-15 and is restarted from
its own answer until that no longer changes.) The table has the largest difference, divided by max(1, |qacc|). Then
come trajectories: the simulation with stiction, one with MuJoCo's Newton, and one with MuJoCo's Newton whose start is
disturbed by 1e-12. The table has the step in which positions first differ by more than 1e-9, 1e-6 and 1e-3. Writes
FOLDER/mujoco_agreement.csv.
"""

import argparse
import csv
import itertools
import pathlib

import mujoco
import mujoco_models as models
import numpy as np

from stiction.monitor import Progress
from stiction.mujoco import BatchedSimulation

LIMITS = (1e-9, 1e-6, 1e-3)
RESTARTS = 5


def tight(model):
    """Options of a reference: as tight as it goes."""
    model.opt.tolerance, model.opt.ls_tolerance = 1e-15, 1e-10
    model.opt.iterations = model.opt.ls_iterations = 100
    return model


def reference(model, data, like):
    """MuJoCo's accelerations at the state of `like`."""
    data.qpos[:], data.qvel[:], data.ctrl[:], data.time = like.qpos, like.qvel, like.ctrl, like.time
    data.qacc_warmstart[:] = like.qacc
    for _ in range(RESTARTS):
        mujoco.mj_forward(model, data)
        if np.array_equal(data.qacc, data.qacc_warmstart):
            break
        data.qacc_warmstart[:] = data.qacc
    return data.qacc


def at_equal_state(name, cone, steps, tolerance):
    """Differences of accelerations in every step of a simulation with stiction, and what its solves did."""
    model = tight(models.load(name, cone))
    rng = np.random.default_rng(1)
    simulation = BatchedSimulation(model, 1, tolerance=tolerance, threads=1)
    data, peer = simulation.data[0], mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = models.start(model, rng)
    differences, rows, residuals, unsolved = [], [], [], 0
    for _ in range(steps):
        data.ctrl[:] = models.noise(model, rng, 1)[0]
        simulation.forward()
        status = simulation.status[0]
        unsolved += int(status["code"] != 0)
        residuals.append(float(status["residual"]))
        rows.append(data.nefc)
        ours = data.qacc.copy()
        theirs = reference(model, peer, data)
        differences.append(float(np.abs(ours - theirs).max() / max(1.0, np.abs(theirs).max())))
        simulation.step()
    return {"rows_mean": np.mean(rows), "rows_max": np.max(rows), "unsolved": unsolved,
            "residual_max": np.max(residuals), "qacc_median": np.median(differences), "qacc_max": np.max(differences)}


def parting(name, cone, steps, tolerance):
    """The first step in which positions differ from MuJoCo's by more than each limit; stiction's, then MuJoCo's own
    from a start disturbed by 1e-12."""
    model = tight(models.load(name, cone))
    rng = np.random.default_rng(1)
    ours = BatchedSimulation(model, 1, tolerance=tolerance, threads=1)
    plain, disturbed = mujoco.MjData(model), mujoco.MjData(model)
    qpos, qvel = models.start(model, rng)
    for data in (ours.data[0], plain, disturbed):
        data.qpos[:], data.qvel[:] = qpos, qvel
    disturbed.qpos[:] += 1e-12
    found = {}
    for step in range(1, steps + 1):
        ctrl = models.noise(model, rng, 1)
        ours.step(ctrl)
        for data in (plain, disturbed):
            data.ctrl[:] = ctrl[0]
            mujoco.mj_step(model, data)
        for who, data in (("stiction", ours.data[0]), ("disturbed", disturbed)):
            apart = np.abs(data.qpos - plain.qpos).max()
            for limit in LIMITS:
                if apart > limit:
                    found.setdefault(f"{who}_{limit:.0e}", step)
    return {f"{who}_{limit:.0e}": found.get(f"{who}_{limit:.0e}", "") for who in ("stiction", "disturbed")
            for limit in LIMITS}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--steps", type=int, default=1000)
    parser.add_argument("--tolerance", type=float, default=1e-10)
    parser.add_argument("-o", "--output", type=pathlib.Path, help="folder for mujoco_agreement.csv")
    options = parser.parse_args()
    rows, bar = [], Progress(list(itertools.product(models.MODELS, models.CONES)), title="agreement", unit="model")
    for name, cone in bar:
        row = {"model": name, "cone": cone, "steps": options.steps, "tolerance": options.tolerance}
        row |= at_equal_state(name, cone, options.steps, options.tolerance)
        row |= parting(name, cone, options.steps, options.tolerance)
        rows.append({key: f"{value:.3g}" if isinstance(value, float) else value for key, value in row.items()})
        bar.print(" ".join(f"{key}={value}" for key, value in rows[-1].items()))
    if options.output:
        with open(options.output / "mujoco_agreement.csv", "w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, rows[0])
            writer.writeheader()
            writer.writerows(rows)


if __name__ == "__main__":
    main()
