"""The vector environment as Stable-Baselines3 wants one. Needs stable-baselines3."""

import numpy as np
from gymnasium.vector import AutoresetMode
from stable_baselines3.common.vec_env import VecEnv


class Sb3VecEnv(VecEnv):
    """A stiction.envs.MujocoVectorEnv as a stable_baselines3 VecEnv.

    envs: made with autoreset_mode=AutoresetMode.SAME_STEP, as that library does. Infos have "terminal_observation" and
    "TimeLimit.truncated" where an episode ended, and no reward terms unless all_infos.
    """

    def __init__(self, envs, all_infos=False):
        if envs.autoreset_mode is not AutoresetMode.SAME_STEP:
            raise ValueError(f"envs: expected autoreset_mode SAME_STEP, got {envs.autoreset_mode}")
        self.envs, self.all_infos = envs, all_infos
        self._seed, self._actions = None, None
        super().__init__(envs.num_envs, envs.single_observation_space, envs.single_action_space)

    def seed(self, seed=None):
        """Environment i starts its next episode with seed + i."""
        self._seed = seed
        return [None if seed is None else seed + i for i in range(self.num_envs)]

    def reset(self):
        observations, _ = self.envs.reset(seed=self._seed)
        self._seed = None
        return observations.astype(np.float32)

    def step_async(self, actions):
        self._actions = actions

    def step_wait(self):
        observations, rewards, terminations, truncations, found = self.envs.step(self._actions)
        infos = [{} for _ in range(self.num_envs)]
        if self.all_infos:
            for name, values in found.items():
                if not name.startswith("_") and name not in ("final_obs", "final_info"):
                    for i in np.flatnonzero(found[f"_{name}"]):
                        infos[i][name] = values[i]
        over = terminations | truncations
        for i in np.flatnonzero(over):
            infos[i]["terminal_observation"] = found["final_obs"][i].astype(np.float32)
            infos[i]["TimeLimit.truncated"] = bool(truncations[i] and not terminations[i])
        return observations.astype(np.float32), rewards.astype(np.float32), over, infos

    def close(self):
        self.envs.close()

    def get_attr(self, attr_name, indices=None):
        return [getattr(self.envs, attr_name)] * len(list(self._get_indices(indices)))

    def set_attr(self, attr_name, value, indices=None):
        if indices is not None:
            raise ValueError("indices: expected None, got some: environments share their attributes")
        setattr(self.envs, attr_name, value)

    def env_method(self, method_name, *arguments, indices=None, **named):
        return [getattr(self.envs, method_name)(*arguments, **named)] * len(list(self._get_indices(indices)))

    def env_is_wrapped(self, wrapper_class, indices=None):
        return [False] * len(list(self._get_indices(indices)))
