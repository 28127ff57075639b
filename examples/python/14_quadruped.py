#!/usr/bin/env python3
"""A quadruped learns to walk: PPO of Stable-Baselines3 over robots in lanes, judged by mj_step.

    examples/python/14_quadruped.py [--robot go1] [--model FILE.xml] [--steps 3000000] [--envs 256] [--csv FILE]
        [--save FILE.zip] [--engine mujoco]

The program of docs/tutorials/a_robot_of_ones_own.md. The robot is this project's own, on rubble, or Unitree's Go1 on a
plane. Go1's scene is in the wheel of MuJoCo Playground: `pip install --no-deps playground`. `--model` names another one.
`--engine mujoco` trains with MuJoCo's own mujoco.batch. Needs stable-baselines3, torch, gymnasium and mujoco.
"""

import argparse
import csv
import dataclasses
import importlib.util
import pathlib
import sys
import time

import numpy as np

try:
    import gymnasium
    import mujoco
    import mujoco.batch
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
TROT, SWINGS = 2.0, np.array([0, np.pi, np.pi, 0])  # strides a second; when legs swing
GO1 = "_src/locomotion/go1/xmls/scene_mjx_feetonly_flat_terrain.xml"  # in mujoco_playground
FRAMES, EPISODE = 5, 500  # steps of 4 ms an action; actions an episode


@dataclasses.dataclass(frozen=True)
class Robot:
    """A model of a free trunk and four legs of position servos, whose first keyframe stands, and numbers of its task.

    Legs are front right, front left, hind right, hind left; their last two servos are hip and knee.
    """

    model: mujoco.MjModel
    speed: float        # forward, asked for [m/s]
    lowest: float       # of a trunk that has not fallen [m]
    starts: tuple       # of episodes along x [m]
    watt: float = 0.0   # cost of a watt of its servos
    trot: float = 0.0   # knees of two legs at a time are bent by this [rad], and the policy knows when


def rough_model():
    """The robot of quadruped_rough.xml and its rubble, laid out five times along x and three times along y."""
    spec = mujoco.MjSpec.from_file(str(MODEL))
    field = spec.hfield("rubble")
    field.userdata = np.tile(np.reshape(field.userdata, (24, 24)), (3, 5)).ravel()
    field.nrow, field.ncol, field.size[:2] = 72, 120, [7.5, 4.5]
    spec.geom("ground").pos = [6, 0, 0]
    return spec.compile()


def go1_model(path=None):
    """The scene of a file, by default Go1's of mujoco_playground, without meshes: they are seen and touch nothing.

    MuJoCo solves with its default number of iterations. The file has one, which leaves contacts far from a solution.
    """
    if path is None:
        package = importlib.util.find_spec("mujoco_playground")
        if package is None:
            sys.exit("--robot go1: no mujoco_playground is installed. "
                     "`pip install --no-deps playground`, or name a scene: --model")
        path = pathlib.Path(package.submodule_search_locations[0]) / GO1
    spec = mujoco.MjSpec.from_file(str(path))
    for geom in [geom for geom in spec.geoms if geom.type == mujoco.mjtGeom.mjGEOM_MESH]:
        spec.delete(geom)
    for mesh in list(spec.meshes):
        spec.delete(mesh)
    spec.option.iterations, spec.option.ls_iterations = 100, 50
    return spec.compile()


def robot_of(name, path=None):
    if name == "go1":
        return Robot(go1_model(path), speed=0.8, lowest=0.15, starts=(0, 0), watt=0.0005, trot=0.4)
    return Robot(rough_model(), speed=0.7, lowest=0.2, starts=(-1, 5))


def in_body_axes(quaternions, vectors):
    """Vectors (n, 3) of the world in the axes of bodies with those orientations (n, 4)."""
    w, axis = quaternions[:, :1], -quaternions[:, 1:]
    twice = 2 * np.cross(axis, vectors)
    return vectors + w * twice + np.cross(axis, twice)


class Task:
    """Observations and rewards (n) of walking forward, of arrays of simulations in lanes or one mjData."""

    def __init__(self, robot):
        self.robot, self.stand, self.stiffness = robot, robot.model.key_qpos[0], robot.model.actuator_gainprm[:, 0]
        self.beat = 2 * np.pi * TROT * FRAMES * robot.model.opt.timestep
        self.width = 9 + 3 * robot.model.nu + 2 * (robot.trot > 0)

    def starts(self, count, rng):
        """First coordinates and velocities of episodes, beside the keyframe."""
        qpos = np.tile(self.stand, (count, 1))
        qpos[:, 0] = rng.uniform(*self.robot.starts, count)
        qpos[:, 7:] += rng.uniform(-0.1, 0.1, (count, qpos.shape[1] - 7))
        return qpos, rng.uniform(-0.2, 0.2, (count, qpos.shape[1] - 1))

    def control(self, action, age):
        """Targets of the servos, of actions (n, servos) at those ages (n) of episodes."""
        targets = self.stand[7:] + 0.3 * action
        bent = self.robot.trot * np.maximum(0, np.sin(self.beat * age[:, None] + SWINGS))
        hips_and_knees = targets.reshape(len(targets), 4, -1)[:, :, -2:]
        hips_and_knees += bent[:, :, None] * [0.5, -1.0]
        return targets

    def observe(self, qpos, qvel, action, age):
        qpos, qvel = np.asarray(qpos, float), np.asarray(qvel, float)
        turn = qpos[:, 3:7]
        down = in_body_axes(turn, np.tile([0.0, 0.0, -1.0], (len(qpos), 1)))
        speed = in_body_axes(turn, qvel[:, :3])
        beat = self.beat * age[:, None]
        when = np.hstack([np.sin(beat), np.cos(beat)]) if self.robot.trot else np.zeros((len(qpos), 0))
        joints, turning = qpos[:, 7:] - self.stand[7:], qvel[:, 6:]
        return np.hstack([down, speed, 0.25 * qvel[:, 3:6], joints, 0.05 * turning, action, when])

    def reward(self, seen, action, before, control):
        forward, side, up = seen[:, 3], seen[:, 4], seen[:, 5]
        spin = 4 * seen[:, 6:9]
        track = np.exp(-((forward - self.robot.speed) ** 2 + side**2) / 0.25) + 0.3 * np.exp(-(spin[:, 2] ** 2) / 0.25)
        cost = up**2 + 0.03 * (spin[:, :2] ** 2).sum(1) + 0.01 * ((action - before) ** 2).sum(1) + (seen[:, :2] ** 2).sum(1)
        turned, turning = np.split(seen[:, 9:9 + 2 * action.shape[1]], 2, axis=1)
        power = np.abs(self.stiffness * (control - self.stand[7:] - turned) * turning / 0.05).sum(1)
        return track - cost - self.robot.watt * power

    def has_fallen(self, qpos, seen):
        return (qpos[:, 2] < self.robot.lowest) | (seen[:, 2] > -0.5)


class Quadrupeds(gymnasium.vector.VectorEnv):
    """Quadrupeds in lanes, no two alike: masses within 15 %, friction from 0.5 to 1.2, and where they start.

    The engine "mujoco" steps the same robots by mujoco.batch.
    """

    def __init__(self, robot, count, seed=0, engine="lanes"):
        model = robot.model
        self.task, self.rng = Task(robot), np.random.default_rng(seed)
        self.num_envs, self.autoreset_mode = count, AutoresetMode.SAME_STEP
        self.metadata = {"autoreset_mode": self.autoreset_mode}
        self.single_observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (self.task.width,), np.float32)
        self.single_action_space = gymnasium.spaces.Box(-1.5, 1.5, (model.nu,), np.float32)
        self.observation_space = gymnasium.vector.utils.batch_space(self.single_observation_space, count)
        self.action_space = gymnasium.vector.utils.batch_space(self.single_action_space, count)
        self.simulation = BatchedSimulation(model, count, engine="lanes", dtype="float32", tolerance=1e-4,
                                            varies=("body_mass", "geom_friction"))
        self.simulation.varied["body_mass"][:] *= self.rng.uniform(0.85, 1.15, (count, model.nbody))
        self.simulation.varied["geom_friction"][:, :, 0] = self.rng.uniform(0.5, 1.2, (count, 1))
        if engine == "mujoco":
            alike, self.simulation = self.simulation, mujoco.batch.Batch(model, count)
            self.simulation.set_models([alike.model_of(i) for i in range(count)])
        self.action, self.age = np.zeros((count, model.nu)), np.zeros(count, int)

    def _start(self, which):
        self.simulation.reset(np.flatnonzero(which))
        self.simulation.qpos[which], self.simulation.qvel[which] = self.task.starts(int(which.sum()), self.rng)
        self.action[which], self.age[which] = 0, 0

    def _seen(self):
        return self.task.observe(self.simulation.qpos, self.simulation.qvel, self.action, self.age)

    def reset(self, *, seed=None, options=None):
        if seed is not None:
            self.rng = np.random.default_rng(seed)
        self._start(np.ones(self.num_envs, bool))
        self.age[:] = self.rng.integers(0, EPISODE, self.num_envs)  # episodes do not end together
        return self._seen().astype(np.float32), {}

    def step(self, actions):
        before, self.action = self.action, np.asarray(actions, float)
        control = self.task.control(self.action, self.age)
        self.simulation.ctrl[:] = control
        self.simulation.step(nstep=FRAMES)
        self.age += 1
        seen = self._seen()
        rewards = self.task.reward(seen, self.action, before, control)
        fallen = self.task.has_fallen(self.simulation.qpos, seen)
        fallen[getattr(self.simulation, "failed", [])] = True
        late = self.age >= EPISODE
        over, infos = fallen | late, {}
        if over.any():
            infos = {"final_obs": np.array([row if end else None for row, end in zip(seen, over)], dtype=object)}
            self._start(over)
            seen = self._seen()
        return seen.astype(np.float32), rewards, fallen, late & ~fallen, infos


class Curve(BaseCallback):
    """A line after each rollout: steps, seconds of clock and processor, mean reward of a step, falls in it."""

    def __init__(self):
        super().__init__()
        self.rows, self.rewards, self.falls = [], [], 0
        self.begin, self.busy = time.perf_counter(), time.process_time()

    def _on_step(self):
        self.rewards.append(self.locals["rewards"].mean())
        self.falls += sum(done and not info["TimeLimit.truncated"]
                          for done, info in zip(self.locals["dones"], self.locals["infos"]))
        return True

    def _on_rollout_end(self):
        self.rows.append({"steps": self.num_timesteps, "seconds": round(time.perf_counter() - self.begin, 1),
                          "cpu_seconds": round(time.process_time() - self.busy, 1),
                          "reward": round(float(np.mean(self.rewards)), 4), "falls": self.falls})
        if len(self.rows) % 10 == 1:
            print("  ".join(f"{name} {value}" for name, value in self.rows[-1].items()), flush=True)
        self.rewards, self.falls = [], 0


def walk_by_mj_step(policy, robot, seed, seconds=10):
    """Distance that the policy walks with MuJoCo's own steps in that time [m], and how long it stays up [s]."""
    model, task = robot.model, Task(robot)
    data, action = mujoco.MjData(model), np.zeros((1, model.nu))
    (data.qpos[:],), (data.qvel[:],) = task.starts(1, np.random.default_rng(seed))
    begin, period = data.qpos[0], FRAMES * model.opt.timestep
    for step in range(round(seconds / period)):
        age = np.array([step])
        seen = task.observe(data.qpos[None], data.qvel[None], action, age)
        if task.has_fallen(data.qpos[None], seen)[0]:
            return data.qpos[0] - begin, step * period
        action = policy.predict(seen.astype(np.float32), deterministic=True)[0]
        data.ctrl[:] = task.control(action, age)[0]
        mujoco.mj_step(model, data, nstep=FRAMES)
    return data.qpos[0] - begin, seconds


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robot", choices=("own", "go1"), default="own")
    parser.add_argument("--model", help="a scene in place of the installed Go1's")
    parser.add_argument("--engine", choices=("lanes", "mujoco"), default="lanes")
    parser.add_argument("--steps", type=int, default=3_000_000)
    parser.add_argument("--envs", type=int, default=256)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--csv", help="where the curve is written")
    parser.add_argument("--save", help="where the policy is written")
    options = parser.parse_args()
    torch.manual_seed(options.seed)
    torch.set_num_threads(1)
    robot = robot_of(options.robot, options.model)
    envs = Quadrupeds(robot, options.envs, options.seed, options.engine)
    policy = PPO("MlpPolicy", Sb3VecEnv(envs), n_steps=24, batch_size=1536, n_epochs=5,
                 learning_rate=3e-4, gamma=0.98, device="cpu", seed=options.seed,
                 policy_kwargs=dict(net_arch=[128, 128], activation_fn=torch.nn.ELU, log_std_init=-0.7))
    curve = Curve()
    policy.learn(options.steps, callback=curve)
    walks = np.array([walk_by_mj_step(policy, robot, seed) for seed in range(8)])
    print("by mj_step, means of 8 episodes: {:.2f} m forward, {:.1f} s upright".format(*walks.mean(0)))
    print("distances [m]:", *(f"{distance:.2f}" for distance in walks[:, 0]))
    if options.csv:
        with open(options.csv, "w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, curve.rows[0])
            writer.writeheader()
            writer.writerows(curve.rows)
    if options.save:
        policy.save(options.save)


if __name__ == "__main__":
    main()
