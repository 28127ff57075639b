"""The adapter under the learner it is for: rsl_rl's own runner, storage and networks (rsl-rl-lib of PyPI)."""

import runpy

import numpy as np
import pytest
from conftest import ROOT
from frameworks import framework

LACKING = "rsl_rl's runner is NOT tested: pip install gymnasium mujoco"
torch = framework("torch", "rsl_rl's runner is")
tensordict = framework("tensordict", "rsl_rl's runner is")
framework("rsl_rl", "rsl_rl's runner is")
pytest.importorskip("gymnasium", reason=LACKING)
pytest.importorskip("mujoco", reason=LACKING)

from gymnasium.vector import AutoresetMode  # noqa: E402
from rsl_rl.env import VecEnv  # noqa: E402
from rsl_rl.runners import OnPolicyRunner  # noqa: E402

from stiction.envs import MujocoVectorEnv  # noqa: E402
from stiction.envs.rsl_rl import RslRlEnv  # noqa: E402

ENVS, ROLLOUT = 8, 16


def make_env(**options):
    return RslRlEnv(MujocoVectorEnv("Hopper", ENVS, tolerance=1e-4, autoreset_mode=AutoresetMode.SAME_STEP, **options))


def train_cfg():
    """The example's, with small networks."""
    example = runpy.run_path(str(ROOT / "examples" / "python" / "06_rsl_rl.py"))
    return example["train_cfg"](steps=ROLLOUT, hidden=(32, 32))


def test_it_is_what_rsl_rl_calls_an_environment():
    env = make_env()
    missing = [name for name in (*VecEnv.__annotations__, *VecEnv.__abstractmethods__) if not hasattr(env, name)]
    assert not missing
    assert isinstance(env, VecEnv)


def test_observations_are_tensordicts():
    env = make_env()
    env.reset(seed=3)
    seen = env.get_observations()
    assert isinstance(seen, tensordict.TensorDict) and seen.batch_size == (ENVS,) and seen.device == env.device
    after, rewards, dones, extras = env.step(torch.zeros(ENVS, env.num_actions))
    assert isinstance(after, tensordict.TensorDict) and after["policy"].shape == (ENVS, 11)
    assert rewards.shape == dones.shape == extras["time_outs"].shape == (ENVS,)
    # Returned arrays stay: a learner keeps them until its rollout is over.
    kept = seen["policy"].clone()
    env.step(torch.ones(ENVS, env.num_actions))
    assert torch.equal(seen["policy"], kept)


def test_the_runner_learns_for_a_few_iterations(tmp_path):
    torch.manual_seed(0)
    env = make_env(max_episode_steps=40)
    env.reset(seed=0)
    runner = OnPolicyRunner(env, train_cfg(), log_dir=str(tmp_path), device="cpu")
    before = [p.detach().clone() for p in runner.alg.actor.parameters()]
    runner.learn(num_learning_iterations=4, init_at_random_ep_len=True)
    after = list(runner.alg.actor.parameters())
    assert any(not torch.equal(a, b) for a, b in zip(before, after))
    assert all(torch.isfinite(p).all() for p in after)
    assert env.envs.simulation.solver.stats()["environments"] >= 4 * ROLLOUT * ENVS
    assert list(tmp_path.glob("model_*.pt")) and list(tmp_path.glob("events.*"))
    assert (np.asarray(env.envs.episode_length) < 40).all()
    # Ends reach its log: "/episode/..." of the adapter, and its own means over episodes.
    assert len(runner.logger.rewbuffer) > 0 and 0 < np.mean(runner.logger.lenbuffer) <= 40


def test_what_was_saved_acts_as_what_was_trained(tmp_path):
    torch.manual_seed(0)
    env = make_env()
    env.reset(seed=0)
    runner = OnPolicyRunner(env, train_cfg(), log_dir=str(tmp_path), device="cpu")
    runner.learn(num_learning_iterations=1)
    actions = runner.get_inference_policy()(env.get_observations())
    again = OnPolicyRunner(make_env(), train_cfg(), device="cpu")
    again.load(str(next(tmp_path.glob("model_*.pt"))))
    assert torch.equal(again.get_inference_policy()(env.get_observations()), actions)
