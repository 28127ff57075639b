#!/usr/bin/env python3
"""A quadruped of one's own learns to walk over rubble: PPO of Stable-Baselines3 over robots in lanes, judged by mj_step.

    examples/python/14_quadruped.py [--steps 3000000] [--envs 256] [--csv FILE] [--save FILE.zip]

The program of docs/tutorials/a_robot_of_ones_own.md. Needs stable-baselines3, torch, gymnasium and mujoco.
"""

import argparse
import csv
import pathlib
import sys
import time

import numpy as np

try:
    import gymnasium
    import mujoco
    import torch
    from gymnasium.vector import AutoresetMode
    from stable_baselines3 import PPO
    from stable_baselines3.common.callbacks import BaseCallback

    from stiction.envs.sb3 import Sb3VecEnv
    from stiction.mujoco import BatchedSimulation
except ImportError as missing:
    print(f"NOT run, because this needs stable-baselines3, torch, gymnasium and mujoco: {missing}")
    sys.exit(77)

MODEL = pathlib.Path(__file__).parents[1] / "data" / "models" / "quadruped_rough.xml"
SPEED, FRAMES, EPISODE = 0.7, 5, 500  # forward [m/s]; steps of 4 ms an action; actions an episode


def rough_model():
    """The robot of quadruped_rough.xml and its rubble, laid out five times along x and three times along y."""
    spec = mujoco.MjSpec.from_file(str(MODEL))
    field = spec.hfield("rubble")
    field.userdata = np.tile(np.reshape(field.userdata, (24, 24)), (3, 5)).ravel()
    field.nrow, field.ncol, field.size[:2] = 72, 120, [7.5, 4.5]
    spec.geom("ground").pos = [6, 0, 0]
    return spec.compile()


def in_body_axes(quaternions, vectors):
    """Vectors (n, 3) of the world in the axes of bodies with those orientations (n, 4)."""
    w, axis = quaternions[:, :1], -quaternions[:, 1:]
    twice = 2 * np.cross(axis, vectors)
    return vectors + w * twice + np.cross(axis, twice)


class Task:
    """Observations (n, 45) and rewards (n) of walking forward, of arrays that simulations in lanes or one mjData have."""

    def __init__(self, model):
        self.stand = model.key_qpos[0]

    def control(self, action):
        return self.stand[7:] + 0.3 * action

    def observe(self, qpos, qvel, action):
        turn = qpos[:, 3:7]
        down = in_body_axes(turn, np.tile([0.0, 0.0, -1.0], (len(qpos), 1)))
        speed = in_body_axes(turn, qvel[:, :3])
        return np.hstack([down, speed, 0.25 * qvel[:, 3:6], qpos[:, 7:] - self.stand[7:], 0.05 * qvel[:, 6:], action])

    def reward(self, seen, action, before):
        forward, side, up = seen[:, 3], seen[:, 4], seen[:, 5]
        spin = 4 * seen[:, 6:9]
        track = np.exp(-((forward - SPEED) ** 2 + side**2) / 0.25) + 0.3 * np.exp(-(spin[:, 2] ** 2) / 0.25)
        cost = up**2 + 0.03 * (spin[:, :2] ** 2).sum(1) + 0.01 * ((action - before) ** 2).sum(1) + (seen[:, :2] ** 2).sum(1)
        return track - cost

    def has_fallen(self, qpos, seen):
        return (qpos[:, 2] < 0.2) | (seen[:, 2] > -0.5)


class Quadrupeds(gymnasium.vector.VectorEnv):
    """Quadrupeds in lanes, no two alike: masses within 15 %, friction from 0.5 to 1.2, and where on the rubble they start."""

    def __init__(self, count, seed=0):
        model = rough_model()
        self.num_envs, self.autoreset_mode = count, AutoresetMode.SAME_STEP
        self.metadata = {"autoreset_mode": self.autoreset_mode}
        self.single_observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (45,), np.float32)
        self.single_action_space = gymnasium.spaces.Box(-1.5, 1.5, (model.nu,), np.float32)
        self.observation_space = gymnasium.vector.utils.batch_space(self.single_observation_space, count)
        self.action_space = gymnasium.vector.utils.batch_space(self.single_action_space, count)
        self.task, self.rng = Task(model), np.random.default_rng(seed)
        self.simulation = BatchedSimulation(model, count, engine="lanes", dtype="float32", tolerance=1e-4,
                                            varies=("body_mass", "geom_friction"))
        self.simulation.varied["body_mass"][:] *= self.rng.uniform(0.85, 1.15, (count, model.nbody))
        self.simulation.varied["geom_friction"][:, :, 0] = self.rng.uniform(0.5, 1.2, (count, 1))
        self.action, self.age = np.zeros((count, model.nu)), np.zeros(count, int)

    def _start(self, which):
        simulation, count = self.simulation, int(which.sum())
        simulation.reset(np.flatnonzero(which))
        simulation.qpos[which] = self.task.stand
        simulation.qpos[which, 0] = self.rng.uniform(-1, 5, count)
        simulation.qpos[which, 7:] += self.rng.uniform(-0.1, 0.1, (count, self.action.shape[1]))
        simulation.qvel[which] = self.rng.uniform(-0.2, 0.2, (count, simulation.qvel.shape[1]))
        self.action[which], self.age[which] = 0, 0

    def _seen(self):
        return self.task.observe(self.simulation.qpos, self.simulation.qvel, self.action)

    def reset(self, *, seed=None, options=None):
        if seed is not None:
            self.rng = np.random.default_rng(seed)
        self._start(np.ones(self.num_envs, bool))
        self.age[:] = self.rng.integers(0, EPISODE, self.num_envs)  # episodes do not end together
        return self._seen().astype(np.float32), {}

    def step(self, actions):
        before, self.action = self.action, np.asarray(actions, float)
        self.simulation.ctrl[:] = self.task.control(self.action)
        self.simulation.step(nstep=FRAMES)
        self.age += 1
        seen = self._seen()
        rewards = self.task.reward(seen, self.action, before)
        fallen = self.task.has_fallen(self.simulation.qpos, seen)
        fallen[self.simulation.failed] = True
        late = self.age >= EPISODE
        over, infos = fallen | late, {}
        if over.any():
            infos = {"final_obs": np.array([row if end else None for row, end in zip(seen, over)], dtype=object)}
            self._start(over)
            seen = self._seen()
        return seen.astype(np.float32), rewards, fallen, late & ~fallen, infos


class Curve(BaseCallback):
    """A line after each rollout: steps, seconds, mean reward of a step, how many of its steps ended in a fall."""

    def __init__(self):
        super().__init__()
        self.rows, self.begin, self.rewards, self.falls = [], time.perf_counter(), [], 0

    def _on_step(self):
        self.rewards.append(self.locals["rewards"].mean())
        self.falls += sum(done and not info["TimeLimit.truncated"]
                          for done, info in zip(self.locals["dones"], self.locals["infos"]))
        return True

    def _on_rollout_end(self):
        self.rows.append({"steps": self.num_timesteps, "seconds": round(time.perf_counter() - self.begin, 1),
                          "reward": round(float(np.mean(self.rewards)), 4), "falls": self.falls})
        if len(self.rows) % 10 == 1:
            print("  ".join(f"{name} {value}" for name, value in self.rows[-1].items()), flush=True)
        self.rewards, self.falls = [], 0


def walk_by_mj_step(policy, seconds=10):
    """Distance that the policy walks with MuJoCo's own steps in that time [m], and how long it stays up [s]."""
    model = rough_model()
    task, data, action = Task(model), mujoco.MjData(model), np.zeros((1, model.nu))
    data.qpos[:] = task.stand
    for step in range(round(seconds / (FRAMES * model.opt.timestep))):
        seen = task.observe(data.qpos[None], data.qvel[None], action)
        if task.has_fallen(data.qpos[None], seen)[0]:
            return data.qpos[0], step * FRAMES * model.opt.timestep
        action = policy.predict(seen.astype(np.float32), deterministic=True)[0]
        data.ctrl[:] = task.control(action)[0]
        mujoco.mj_step(model, data, nstep=FRAMES)
    return data.qpos[0], seconds


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--steps", type=int, default=3_000_000)
    parser.add_argument("--envs", type=int, default=256)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--csv", help="where the curve is written")
    parser.add_argument("--save", help="where the policy is written")
    options = parser.parse_args()
    torch.manual_seed(options.seed)
    torch.set_num_threads(1)
    policy = PPO("MlpPolicy", Sb3VecEnv(Quadrupeds(options.envs, options.seed)), n_steps=24, batch_size=1536, n_epochs=5,
                 learning_rate=3e-4, gamma=0.98, device="cpu", seed=options.seed,
                 policy_kwargs=dict(net_arch=[128, 128], activation_fn=torch.nn.ELU, log_std_init=-0.7))
    curve = Curve()
    policy.learn(options.steps, callback=curve)
    distance, upright = walk_by_mj_step(policy)
    print(f"by mj_step: {distance:.2f} m forward, {upright:.1f} s upright")
    if options.csv:
        with open(options.csv, "w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, curve.rows[0])
            writer.writeheader()
            writer.writerows(curve.rows)
    if options.save:
        policy.save(options.save)


if __name__ == "__main__":
    main()
