#!/usr/bin/env python3
"""Control steps a second of 64 environments by engine="lanes" beside Gymnasium's own vector environments.

    PYTHONPATH=build/python bench/studies/vector_envs.py [--tasks Ant Humanoid go1] [--envs 64] [--bare]

By the wall's clock, on all cores, and by the processor's time of this process, which the workers of async are not in. All
ways take the same actions, drawn beforehand, from the same states. Each has two turns, in either order. Lanes solve to 1e-6
in f64 and 1e-4 in f32; Gymnasium's Ants are stepped by mj_step. Bare ways step simulations alone, without rewards, contact
forces and ends of episodes. Beside lanes these are MuJoCo 4's mujoco.batch and PyPI's mjbatch, where installed. The task go1
is examples/python/14_quadruped.py's, in lanes in f32 and in mujoco.batch.
"""

import argparse
import importlib
import pathlib
import runpy
import time

import gymnasium
import mujoco
import numpy as np

from stiction.envs import MujocoVectorEnv
from stiction.mujoco import BatchedSimulation


class Bare:
    """Simulations of a task's model on all cores, which start as the task does and are never reset."""

    def __init__(self, task, count, make):
        own = gymnasium.make(f"{task}-v5").unwrapped
        self.action_space, self.num_envs, self.frames = gymnasium.spaces.Box(-1, 1, (count, own.model.nu)), count, own.frame_skip
        self.limit = own.model.actuator_ctrlrange[:, 1]
        self.simulation, self.qpos, self.qvel, self.ctrl = make(own.model, count)
        self.model = own.model

    def reset(self, seed):
        data, rng = mujoco.MjData(self.model), np.random.default_rng(seed)
        self.qpos[:] = data.qpos + rng.uniform(-0.1, 0.1, self.qpos.shape)
        self.qvel[:] = 0.1 * rng.standard_normal(self.qvel.shape)

    def step(self, action):
        self.ctrl[:] = action * self.limit
        self.simulation.step(nstep=self.frames)
        return np.concatenate([self.qpos[:, 2:], self.qvel], axis=1)

    def close(self):
        pass


def in_lanes(model, count, **options):
    simulation = BatchedSimulation(model, count, engine="lanes", **options)
    return simulation, simulation.qpos, simulation.qvel, simulation.ctrl


def in_batch(module):
    def make(model, count):
        batch = module.Batch(model, count)
        return batch, batch.bind("qpos"), batch.bind("qvel"), batch.bind("ctrl")
    return make


def bare_ways(task, count):
    """Lanes, and the batches that are installed."""
    ways = {"bare lanes f64": lambda model, n: in_lanes(model, n, tolerance=1e-6),
            "bare lanes f32": lambda model, n: in_lanes(model, n, tolerance=1e-4, dtype="float32")}
    for name in ("mujoco.batch", "mjbatch"):
        try:
            ways[f"bare {name}"] = in_batch(importlib.import_module(name))
        except ImportError:
            print(f"{name}: not installed", flush=True)
    return {name: lambda make=make: Bare(task, count, make) for name, make in ways.items()}


def go1_ways(count):
    example = runpy.run_path(str(pathlib.Path(__file__).parents[2] / "examples" / "python" / "14_quadruped.py"))
    robot = example["robot_of"]("go1")
    return {f"envs {engine}": lambda engine=engine: example["Quadrupeds"](robot, count, engine=engine)
            for engine in ("lanes", "mujoco")}


def ways_of(task, count):
    if task == "go1":
        return go1_ways(count)
    ways = {"lanes f64": lambda: MujocoVectorEnv(task, count, engine="lanes", tolerance=1e-6),
            "lanes f32": lambda: MujocoVectorEnv(task, count, engine="lanes", tolerance=1e-4, dtype="float32")}
    for mode in ("sync", "async"):
        ways[f"gymnasium {mode}"] = lambda mode=mode: gymnasium.make_vec(f"{task}-v5", count, vectorization_mode=mode)
    return {**ways, **bare_ways(task, count)}


def measure(envs, steps=100):
    """Control steps a second by the clock, and microseconds of the processor for each."""
    envs.reset(seed=1)
    rng = np.random.default_rng(0)
    actions = rng.uniform(-1, 1, (steps, *envs.action_space.shape)).astype(np.float32)
    for action in actions[:5]:
        envs.step(action)
    begin, busy = time.perf_counter(), time.process_time()
    for action in actions:
        envs.step(action)
    count = steps * envs.num_envs
    return count / (time.perf_counter() - begin), (time.process_time() - busy) / count * 1e6


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tasks", nargs="+", default=["Ant", "Humanoid"])
    parser.add_argument("--envs", type=int, default=64)
    parser.add_argument("--bare", action="store_true", help="bare ways alone")
    options = parser.parse_args()
    for task in options.tasks:
        ways = bare_ways(task, options.envs) if options.bare else ways_of(task, options.envs)
        turns = {name: [] for name in ways}
        for name in [*ways, *reversed(ways)]:
            envs = ways[name]()
            turns[name].append(measure(envs))
            envs.close()
        for name, found in turns.items():
            rates, busy = zip(*found)
            print(f"{task}, {name}: {min(rates):.0f} to {max(rates):.0f} a second, {min(busy):.1f} to {max(busy):.1f} us",
                  flush=True)


if __name__ == "__main__":
    main()
