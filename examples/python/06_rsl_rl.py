"""PPO of rsl_rl learns to hop: rsl_rl's runner on stiction's environments. Needs rsl-rl-lib, tensordict, gymnasium, mujoco."""

import argparse
import tempfile

import torch
from gymnasium.vector import AutoresetMode
from rsl_rl.runners import OnPolicyRunner

from stiction.envs import MujocoVectorEnv
from stiction.envs.rsl_rl import RslRlEnv


def train_cfg(steps=24, hidden=(64, 64)):
    """Configuration of rsl_rl 5.5: PPO with its own defaults, networks of that size, `steps` of each environment before
    an update."""
    network = {"class_name": "MLPModel", "hidden_dims": list(hidden), "activation": "elu", "obs_normalization": True}
    return {"num_steps_per_env": steps, "save_interval": 100,
            "obs_groups": {"actor": ["policy"], "critic": ["policy"]},
            "algorithm": {"class_name": "PPO"},
            "actor": network | {"distribution_cfg": {"class_name": "GaussianDistribution", "init_std": 1.0}},
            "critic": network}


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--task", default="Hopper")
    parser.add_argument("--envs", type=int, default=64)
    parser.add_argument("--iterations", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    torch.manual_seed(arguments.seed)
    envs = MujocoVectorEnv(arguments.task, arguments.envs, tolerance=1e-4, autoreset_mode=AutoresetMode.SAME_STEP)
    env = RslRlEnv(envs)
    env.reset(seed=arguments.seed)
    with tempfile.TemporaryDirectory() as folder:
        runner = OnPolicyRunner(env, train_cfg(), log_dir=folder)
        runner.learn(arguments.iterations, init_at_random_ep_len=False)
    stats = envs.simulation.solver.stats()
    returns = runner.logger.rewbuffer  # of the last hundred episodes
    print(f"{arguments.iterations} iterations: return {sum(returns) / max(1, len(returns)):.0f} over the last "
          f"{len(returns)} episodes, {stats['environments']} solves, all of them solved: "
          f"{list(stats['codes']) == ['solved']}")


if __name__ == "__main__":
    main()
