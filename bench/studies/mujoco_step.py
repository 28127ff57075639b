#!/usr/bin/env python3
"""Measures the parts of a step inside MuJoCo, and the gain from a solver that takes no time.

    PYTHONPATH=build/python bench/studies/mujoco_step.py [--envs 128] [--steps 10] [--repeats 12] [--robots FOLDER]
        [--cones pyramidal elliptic] [-o FILE.csv]

One thread, the processor's time, microseconds per simulation and step. Simulations begin lying or standing on the
ground, and mj_step takes them through some steps. From each of those states one step is taken in every way below, in
turns. The least of the repeats counts, for every step and every call of a part. Time above it belongs to other work of
the machine.

mj_step: MuJoCo's own, called for one simulation after the other without Python.
stages: the same by MuJoCo's functions. unsolved: without mj_fwdConstraint, on the accelerations that were there.
bound: mj_step over unsolved. A solver that takes no time would make a step that much faster.
step: BatchedSimulation.step, Python included. ratio: mj_step over it.
before, gather, solve, after: the calls of which that consists. `before` ends with the solve's rows counted, `after`
begins with its answers written back.

--robots: the folder gymnasium_robotics of that package, for the Fetch arm and the Shadow hand.
"""

import argparse
import csv
import pathlib
import time

import mujoco
import mujoco_models as models
import numpy as np

import stiction.mujoco

STATE = mujoco.mjtState.mjSTATE_INTEGRATION
WARM_UP = 0.6  # seconds of simulation before anything is measured


def at_states(model, simulation, states):
    for one, state in zip(simulation.data, states):
        mujoco.mj_setState(model, one, state, STATE)


def first_states(model, envs, rng):
    states = np.empty((envs, mujoco.mj_stateSize(model, STATE)))
    data = mujoco.MjData(model)
    for state in states:
        mujoco.mj_resetData(model, data)
        data.qpos[:], data.qvel[:] = models.start(model, rng)
        data.ctrl[:] = models.noise(model, rng, 1)[0]
        mujoco.mj_step(model, data, nstep=round(WARM_UP / model.opt.timestep))
        mujoco.mj_getState(model, data, state, STATE)
    return states


def best_of(repeats, runs):
    """runs: functions that return dicts of arrays, seconds of pieces of work. They take turns, and of every piece the least
    counts. Returns the sums."""
    best = {}
    for turn in range(repeats):
        for k in np.roll(np.arange(len(runs)), turn):
            for name, seconds in runs[k]().items():
                best[name] = np.minimum(seconds, best.get(name, np.inf))
    return {name: float(np.sum(seconds)) for name, seconds in best.items()}


class Bench:
    """A model at the states of some steps, and ways to take one step from each."""

    def __init__(self, model, envs, steps, tolerance):
        self.model = model
        rng = np.random.default_rng(2)
        options = {"tolerance": tolerance, "threads": 1}
        self.ours = stiction.mujoco.BatchedSimulation(model, envs, **options)
        self.data = list(self.ours.data)
        size = self.ours._core.chunk_size()
        self.chunks = [stiction.mujoco.BatchedSimulation(model, self.data[i:i + size], **options)
                       for i in range(0, envs, size)]
        self.controls = [models.noise(model, rng, envs) for _ in range(steps)]
        self.states = [first_states(model, envs, rng)]
        for ctrl in self.controls:
            at_states(model, self.ours, self.states[-1])
            self.ours._write_ctrl(ctrl)
            self.ours.run("mj_step")
            self.states.append(np.empty_like(self.states[0]))
            for one, state in zip(self.data, self.states[-1]):
                mujoco.mj_getState(model, one, state, STATE)
        self.stages = self.ours._step_stages()

    def each_step(self, take):
        """Seconds that take(controls) takes, step by step."""
        seconds = []
        for ctrl, state in zip(self.controls, self.states):
            at_states(self.model, self.ours, state)
            self.ours._write_ctrl(ctrl)
            start = time.thread_time()
            take(ctrl)
            seconds.append(time.thread_time() - start)
        return np.array(seconds)

    def mj_step(self):
        stage = self.ours._stages_at(["mj_step"])
        return {"mj_step": self.each_step(lambda ctrl: self.ours._core.run(stage))}

    def one_pass(self, *constraint):
        """MuJoCo's stages of a step, one simulation after the other, with this in place of the solve."""
        names = [name for before, after in self.stages for name in (*before, *constraint, *after)]
        stages = self.ours._stages_at(names)
        return self.each_step(lambda ctrl: self.ours._core.run(stages))

    def theirs(self):
        return {"stages": self.one_pass("mj_fwdConstraint"), "unsolved": self.one_pass()}

    def step(self):
        return {"step": self.each_step(self.ours.step)}

    def parts(self):
        """The calls of which a step of a chunk consists."""
        found = []
        calls = [(self.ours._stages_at((*before, "count")), self.ours._stages_at(("write_back", *after)))
                 for before, after in self.stages]

        def take(ctrl):
            for chunk in self.chunks:
                core = chunk._core
                for before, after in calls:
                    times = [time.thread_time()]
                    for call in (lambda: core.run(before), core.gather, core.solve, lambda: core.run(after)):
                        call()
                        times.append(time.thread_time())
                    found.append(np.diff(times))
                core.take_records()

        self.each_step(take)
        return dict(zip(("before", "gather", "solve", "after"), np.array(found).T))


def measure(name, cone, options):
    model = models.load(name, cone, options.robots)
    bench = Bench(model, options.envs, options.steps, options.tolerance)
    found = best_of(options.repeats, [bench.mj_step, bench.theirs, bench.step, bench.parts])
    scale = 1e6 / (options.envs * options.steps)
    found = {key: scale * value for key, value in found.items()}
    rows = np.mean([one.nefc for one in bench.data])
    integrator = mujoco.mjtIntegrator(model.opt.integrator).name[6:]
    return {"model": name, "cone": cone, "integrator": integrator, "nv": model.nv, "rows": rows,
            "bound": found["mj_step"] / found["unsolved"], "ratio": found["mj_step"] / found["step"], **found}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--envs", type=int, default=64)
    parser.add_argument("--steps", type=int, default=10)
    parser.add_argument("--repeats", type=int, default=12)
    parser.add_argument("--tolerance", type=float, default=1e-8)
    parser.add_argument("--robots", type=pathlib.Path)
    parser.add_argument("--models", nargs="+")
    parser.add_argument("--cones", nargs="+", default=["pyramidal", "elliptic"])
    parser.add_argument("-o", "--output", type=pathlib.Path)
    options = parser.parse_args()
    names = options.models or [*models.MODELS, "Swimmer", *(models.ROBOTS if options.robots else ())]
    rows = []
    for name in names:
        for cone in options.cones:
            row = measure(name, cone, options)
            rows.append({key: f"{value:.3g}" if isinstance(value, float) else value for key, value in row.items()})
            print(" ".join(f"{key}={value}" for key, value in rows[-1].items()), flush=True)
    if options.output:
        with open(options.output, "w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, list(dict.fromkeys(key for row in rows for key in row)), restval="")
            writer.writeheader()
            writer.writerows(rows)


if __name__ == "__main__":
    main()
