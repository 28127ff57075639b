"""Environments for reinforcement learning: MuJoCo's models, stiction's contacts. docs/howto/training.md.

    envs = stiction.envs.MujocoVectorEnv("Ant", num_envs=1024)      # a gymnasium.vector.VectorEnv
    stiction.envs.rsl_rl.RslRlEnv(envs), stiction.envs.sb3.Sb3VecEnv(envs)   # for those libraries

Needs gymnasium and mujoco: pip install "stiction[envs]".
"""

from .tasks import TASKS
from .vector import MujocoVectorEnv

__all__ = ["MujocoVectorEnv", "TASKS"]
