#!/usr/bin/env python3
"""Control steps a second of 64 environments by engine="lanes" beside Gymnasium's own vector environments.

    PYTHONPATH=build/python bench/studies/vector_envs.py [--tasks Ant Humanoid] [--envs 64]

By the wall's clock, on all cores, actions drawn beforehand. Each way has two turns, in either order. Lanes solve to 1e-6 in
f64 and 1e-4 in f32; Gymnasium's Ants are stepped by mj_step. Bare ways step simulations alone, without rewards, contact
forces and ends of episodes. Beside lanes these are MuJoCo 4's mujoco.batch and PyPI's mjbatch, where installed.
"""

import argparse
import importlib
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


def ways_of(task, count):
    ways = {"lanes f64": lambda: MujocoVectorEnv(task, count, engine="lanes", tolerance=1e-6),
            "lanes f32": lambda: MujocoVectorEnv(task, count, engine="lanes", tolerance=1e-4, dtype="float32")}
    for mode in ("sync", "async"):
        ways[f"gymnasium {mode}"] = lambda mode=mode: gymnasium.make_vec(f"{task}-v5", count, vectorization_mode=mode)
    return {**ways, **bare_ways(task, count)}


def steps_per_second(envs, steps):
    envs.reset(seed=1)
    rng = np.random.default_rng(0)
    actions = rng.uniform(-1, 1, (steps, *envs.action_space.shape)).astype(np.float32)
    for action in actions[:5]:
        envs.step(action)
    begin = time.perf_counter()
    for action in actions:
        envs.step(action)
    return len(actions) * envs.num_envs / (time.perf_counter() - begin)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tasks", nargs="+", default=["Ant", "Humanoid"])
    parser.add_argument("--envs", type=int, default=64)
    options = parser.parse_args()
    for task in options.tasks:
        ways = ways_of(task, options.envs)
        rates = {name: [] for name in ways}
        for name in [*ways, *reversed(ways)]:
            envs = ways[name]()
            rates[name].append(steps_per_second(envs, 100 if "lanes" in name else 20))
            envs.close()
        print(f"{task}: " + ", ".join(f"{name} {min(found):.0f} to {max(found):.0f}" for name, found in rates.items()),
              flush=True)


if __name__ == "__main__":
    main()
