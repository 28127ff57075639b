"""The vector environment as rsl_rl (of legged_gym and Isaac Lab) wants one. Needs torch; uses tensordict if it is there."""

import numpy as np
import torch
from gymnasium.vector import AutoresetMode

try:
    from tensordict import TensorDict
except ImportError:
    TensorDict = None
try:
    from rsl_rl.env import VecEnv
except ImportError:
    VecEnv = object


class RslRlEnv(VecEnv):
    """A stiction.envs.MujocoVectorEnv as an rsl_rl.env.VecEnv, or with its interface where rsl_rl is not installed.

    envs: made with autoreset_mode=AutoresetMode.SAME_STEP. device: where the tensors are, which the learner asks for;
    MuJoCo's state is on the CPU and copied.

    Attributes: num_envs, num_actions, max_episode_length, episode_length_buf int64 (num_envs,), device, cfg.
    Observations are a TensorDict of "policy" float32 (num_envs, observations), or without tensordict a dict.
    """

    def __init__(self, envs, device="cpu", cfg=None):
        if envs.autoreset_mode is not AutoresetMode.SAME_STEP:
            raise ValueError(f"envs: expected autoreset_mode SAME_STEP, got {envs.autoreset_mode}")
        self.envs, self.device, self.cfg = envs, torch.device(device), cfg if cfg is not None else {}
        self.num_envs, self.num_actions = envs.num_envs, envs.single_action_space.shape[0]
        self.max_episode_length = envs.max_episode_steps
        self._returns = np.zeros(self.num_envs)
        self._observations = None

    @property
    def episode_length_buf(self):
        """Steps of each environment's episode; a learner's writes (to spread the ends) are taken over."""
        if self.device.type == "cpu":
            return torch.from_numpy(self.envs.episode_length)
        return torch.from_numpy(self.envs.episode_length.copy()).to(self.device)

    @episode_length_buf.setter
    def episode_length_buf(self, lengths):
        self.envs.episode_length[:] = lengths.cpu().numpy()

    def reset(self, seed=None):
        """Starts all episodes anew; observations and extras."""
        observations, _ = self.envs.reset(seed=seed)
        self._returns[:] = 0
        self._observations = self._pack(observations)
        return self._observations, {}

    def get_observations(self):
        """Observations of the last step, of a reset before the first."""
        if self._observations is None:
            self.reset()
        return self._observations

    def step(self, actions):
        """actions (num_envs, num_actions), clipped to the action space. Observations, rewards float32, dones int64 and
        extras: "time_outs" bool, "log" with the mean return and length of the episodes that ended, if any did."""
        space = self.envs.single_action_space
        clipped = np.clip(actions.detach().cpu().numpy(), space.low, space.high)
        lengths = self.envs.episode_length + 1
        observations, rewards, terminations, truncations, _ = self.envs.step(clipped)
        self._returns += rewards
        over = terminations | truncations
        extras = {"time_outs": self._tensor(truncations & ~terminations), "log": {}}
        if over.any():
            extras["log"] = {"/episode/return": float(self._returns[over].mean()),
                             "/episode/length": float(lengths[over].mean())}
            self._returns[over] = 0
        self._observations = self._pack(observations)
        return (self._observations, self._tensor(rewards.astype(np.float32)), self._tensor(over.astype(np.int64)),
                extras)

    def close(self):
        self.envs.close()

    def _tensor(self, array):
        return torch.from_numpy(np.ascontiguousarray(array)).to(self.device)

    def _pack(self, observations):
        policy = self._tensor(observations.astype(np.float32))
        if TensorDict is None:
            return {"policy": policy}
        return TensorDict({"policy": policy}, batch_size=[self.num_envs], device=self.device)
