"""PPO of Stable-Baselines3 over environments with stiction's contacts: common to the training examples."""

import csv
import sys
import time

import numpy as np

try:
    import gymnasium
    import torch
    from gymnasium.vector import AutoresetMode
    from stable_baselines3 import PPO
    from stable_baselines3.common.callbacks import BaseCallback
    from stable_baselines3.common.vec_env import VecNormalize

    from stiction import AccuracyPolicy
    from stiction.envs import MujocoVectorEnv
    from stiction.envs.sb3 import Sb3VecEnv
    from stiction.monitor import Progress
except ImportError as missing:
    print(f"NOT run, because this needs stable-baselines3, torch, gymnasium and mujoco: {missing}")
    sys.exit(77)

ROLLOUT = 128          # steps of each environment between two updates of the policy
EVALUATION = 1e-8      # tolerance that a finished policy is judged at


class Curve(BaseCallback):
    """Prints one line after each rollout: steps, seconds of the wall's clock and of the processor's (all threads),
    reward per thousand steps, the solver's iterations. Sets the accuracy of the next one by the policy, if there is one."""

    def __init__(self, envs, accuracy, total):
        super().__init__()
        self._envs, self._accuracy, self._total = envs, accuracy, total
        self.rows, self._sum, self._count = [], 0.0, 0
        self._start, self._cpu = time.perf_counter(), time.process_time()
        self._bar = Progress(total=total, title="training", unit="step")

    def _on_rollout_start(self):
        if self._accuracy is not None:
            self._envs.set_accuracy(self._accuracy.apply(progress=min(1.0, self.num_timesteps / self._total)))
            self._envs.simulation.clear()
        self._began = time.perf_counter()

    def _on_step(self):
        rewards = self.training_env.get_original_reward()
        self._sum += float(rewards.sum())
        self._count += len(rewards)
        self._bar.update(len(rewards))
        return True

    def _on_rollout_end(self):
        now = time.perf_counter()
        spent = self._envs.simulation.seconds if self._accuracy is not None else dict(solve=0.0, assemble=0.0)
        iterations = self._envs.simulation.status["iterations"]
        self.rows.append({"steps": self.num_timesteps, "seconds": round(now - self._start, 2),
                          "cpu_seconds": round(time.process_time() - self._cpu, 2),
                          "return_per_1000_steps": round(1000 * self._sum / self._count, 1),
                          "simulation_seconds": round(now - self._began, 3),
                          "solver_seconds": round(spent["solve"] + spent["assemble"], 3),
                          "iterations_mean": round(float(iterations.mean()), 2)})
        self._bar.print("  ".join(f"{name} {value}" for name, value in self.rows[-1].items()))
        self._sum, self._count = 0.0, 0

    def _on_training_end(self):
        self._bar.close()


def train(task, steps, envs=32, seed=0, accuracy=None, engine="mujoco"):
    """The rows of a training run, its policy, and its observations' normalisation. In lanes the accuracy is fixed."""
    torch.manual_seed(seed)
    torch.set_num_threads(1)
    vector = MujocoVectorEnv(task, envs, autoreset_mode=AutoresetMode.SAME_STEP, engine=engine, tolerance=1e-4)
    if accuracy is None and engine == "mujoco":
        accuracy = AccuracyPolicy.fixed(1e-4)
    learner_envs = VecNormalize(Sb3VecEnv(vector), gamma=0.99)
    learner_envs.seed(seed)
    model = PPO("MlpPolicy", learner_envs, n_steps=ROLLOUT, batch_size=512, n_epochs=10, learning_rate=3e-4, seed=seed,
                device="cpu", verbose=0)
    curve = Curve(vector, accuracy, steps)
    model.learn(steps, callback=curve)
    return curve.rows, model, learner_envs


def evaluate(task, model, normalised, envs=8, steps=1000):
    """Mean return of a policy without exploration, its contacts solved to EVALUATION."""
    vector = MujocoVectorEnv(task, envs, tolerance=EVALUATION, autoreset_mode=AutoresetMode.DISABLED,
                             max_episode_steps=steps)
    observations, _ = vector.reset(seed=1000)
    total, alive = np.zeros(envs), np.ones(envs, bool)
    for _ in Progress(range(steps), title="evaluation", unit="step"):
        actions, _ = model.predict(normalised.normalize_obs(observations.astype(np.float32)), deterministic=True)
        observations, rewards, terminations, truncations, _ = vector.step(actions)
        total += rewards * alive
        over = terminations | truncations
        alive &= ~over
        if not alive.any():
            break
        if over.any():
            observations, _ = vector.reset(options={"reset_mask": over})
    return float(total.mean())


def evaluate_in_gymnasium(task, model, normalised, episodes=8):
    """Mean return of a policy without exploration, and mean steps until an end, in Gymnasium's own environment: mj_step."""
    env = gymnasium.make(f"{task}-v5")
    total = steps = 0
    for episode in Progress(range(episodes), title="evaluation by mj_step", unit="episode"):
        observation, _ = env.reset(seed=1000 + episode)
        over = False
        while not over:
            action, _ = model.predict(normalised.normalize_obs(observation.astype(np.float32)), deterministic=True)
            observation, reward, terminated, truncated, _ = env.step(action)
            total, steps, over = total + reward, steps + 1, terminated or truncated
    return total / episodes, steps / episodes


def write(path, rows):
    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, rows[0])
        writer.writeheader()
        writer.writerows(rows)
