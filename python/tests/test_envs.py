"""The vector environment against Gymnasium's own, its ends and seeds, and its bits."""

import hashlib
import runpy

import numpy as np
import pytest
from conftest import ROOT
from frameworks import framework

gymnasium = pytest.importorskip("gymnasium", reason="the environments are NOT tested: pip install gymnasium")
mujoco = pytest.importorskip("mujoco", reason="the environments are NOT tested: pip install mujoco")

from gymnasium.vector import AutoresetMode  # noqa: E402

from stiction import AccuracyPolicy  # noqa: E402
from stiction.distributed import Shard  # noqa: E402
from stiction.envs import TASKS, MujocoVectorEnv  # noqa: E402

STEPS = 25


def actions_of(rng, envs):
    space = envs.single_action_space
    return rng.uniform(space.low, space.high, envs.action_space.shape).astype(np.float32)


@pytest.mark.parametrize("name, solver, tolerance, close",
                         [(name, *how) for name in TASKS for how in (("mujoco", 1e-6, 1e-9), ("auto", 1e-12, 1e-5),
                                                                           ("lanes", 1e-12, 1e-5))])
def test_observations_rewards_and_ends_are_gymnasiums(name, solver, tolerance, close):
    pytest.importorskip("imageio", reason="NOT compared with Gymnasium: pip install 'gymnasium[mujoco]'")
    # MuJoCo's Newton is run to its end in both, so that the difference of the solvers is rounding and `tolerance`.
    how = dict(engine="lanes") if solver == "lanes" else dict(solver=solver)
    envs = MujocoVectorEnv(name, 2, tolerance=tolerance, autoreset_mode=AutoresetMode.DISABLED, **how)
    peers = [gymnasium.make(f"{name}-v5") for _ in range(2)]
    for model in [envs.model] + [peer.unwrapped.model for peer in peers]:
        model.opt.solver, model.opt.tolerance, model.opt.iterations = 2, 0, 100
    ours, infos = envs.reset(seed=5)
    assert envs.observation_space.contains(ours)
    for i, peer in enumerate(peers):
        theirs, peer_infos = peer.reset(seed=5 + i)
        np.testing.assert_allclose(ours[i], theirs, rtol=0, atol=1e-12 * np.abs(theirs).max() * (solver == "lanes"))
        assert set(peer_infos) == {key for key in infos if not key.startswith("_")}
    assert envs.single_observation_space == peers[0].observation_space
    assert envs.single_action_space == peers[0].action_space
    rng = np.random.default_rng(1)
    for _ in range(STEPS):
        actions = actions_of(rng, envs)
        ours, rewards, terminations, truncations, infos = envs.step(actions)
        for i, peer in enumerate(peers):
            theirs, reward, terminated, truncated, peer_infos = peer.step(actions[i])
            scale = max(1.0, np.abs(theirs).max())
            assert np.abs(ours[i] - theirs).max() <= close * scale
            assert rewards[i] == pytest.approx(reward, abs=close * max(1.0, abs(reward)) + 1e-6 * (solver != "mujoco"))
            assert (terminations[i], truncations[i]) == (terminated, truncated)
            for key, value in peer_infos.items():
                np.testing.assert_allclose(infos[key][i], value, rtol=1e-4, atol=max(1e-7, close), err_msg=key)
        if terminations.any():
            break


def test_what_lanes_do_not_have_is_refused():
    with pytest.raises(ValueError, match="'mujoco' or 'lanes'"):
        MujocoVectorEnv("Hopper", 2, engine="wide")
    envs = MujocoVectorEnv("Hopper", 2, engine="lanes")
    for call in (envs.stats, lambda: envs.set_accuracy(AccuracyPolicy.fixed())):
        with pytest.raises(ValueError, match="engine"):
            call()


@pytest.mark.parametrize("name, width", [("Hopper", 3), ("Ant", 8), ("Humanoid", 17)])
@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_an_episode_in_lanes_depends_on_its_seed_alone(dtype, name, width):
    def seen(num_envs, threads):
        envs = MujocoVectorEnv(name, num_envs, engine="lanes", dtype=dtype, tolerance=1e-4, threads=threads)
        envs.reset(seed=3)
        rng, parts = np.random.default_rng(2), []
        for _ in range(40):  # some fall, and begin anew
            actions = rng.uniform(-1, 1, (33, width))[:num_envs]
            parts += [np.asarray(part)[:5].tobytes() for part in envs.step(actions)[:4]]
        return hashlib.sha256(b"".join(parts)).hexdigest()
    assert seen(5, 1) == seen(33, 1) == seen(33, 2)


@pytest.mark.parametrize("name", ["Ant", "Humanoid"])
@pytest.mark.parametrize("cone", ["pyramidal", "elliptic"])
def test_bodies_and_contacts_in_lanes_are_those_of_the_other_engine(name, cone):
    """A control step from one state, both after resets of fallen robots and in flight."""
    engines = [MujocoVectorEnv(name, 3, engine=engine, tolerance=1e-10, cone=cone, max_episode_steps=30,
                               autoreset_mode=AutoresetMode.SAME_STEP) for engine in ("lanes", "mujoco")]
    for envs in engines:
        envs.reset(seed=1)
    rng, touching = np.random.default_rng(4), 0.0
    for _ in range(45):
        actions = actions_of(rng, engines[0])
        ours, theirs = (envs.step(actions) for envs in engines)
        for mine, other in zip(ours[:4], theirs[:4]):
            np.testing.assert_allclose(mine, other, rtol=0, atol=1e-6 * max(1.0, np.abs(other).max()))
        touching = max(touching, np.abs(engines[0].simulation.observed["cfrc_ext"]).max())
        with_state(*engines)
    assert touching > 10


def test_constants_in_lanes_differ_by_environment_and_are_among_states():
    varies = ("body_mass", "geom_friction")
    with pytest.raises(ValueError, match="varies: expected none with engine='mujoco'"):
        MujocoVectorEnv("Hopper", 2, varies=varies)
    first, second = (MujocoVectorEnv("Hopper", shard=Shard(0, 4, 4), engine="lanes", varies=varies) for _ in range(2))
    rng = np.random.default_rng(1)
    for array in first.simulation.varied.values():
        array *= rng.uniform(0.5, 1.5, array.shape)
    first.reset(seed=2)
    actions = actions_of(rng, first)
    first.step(actions)
    second.set_states(first.states())
    for array, expected in zip(second.simulation.varied.values(), first.simulation.varied.values()):
        np.testing.assert_array_equal(array, expected)
    for _ in range(3):
        for mine, other in zip(first.step(actions)[:4], second.step(actions)[:4]):
            np.testing.assert_array_equal(mine, other)


def with_state(lanes, peers):
    """Puts the other engine's simulations into the states of those in lanes."""
    for i, data in enumerate(peers.simulation.data):
        data.qpos[:], data.qvel[:] = lanes.simulation.qpos[i], lanes.simulation.qvel[i]
        data.qacc_warmstart[:] = lanes.simulation.qacc[i]


def rollout(num_envs, threads, steps=12, cone=None):
    """Hash of everything that environment 0 returned."""
    envs = MujocoVectorEnv("Ant", num_envs, threads=threads, tolerance=1e-4, cone=cone, max_episode_steps=7)
    seen = hashlib.sha256()
    observations, _ = envs.reset(seed=3)
    streams = [np.random.default_rng(i) for i in range(num_envs)]
    for _ in range(steps):
        actions = np.stack([stream.uniform(-1, 1, 8).astype(np.float32) for stream in streams])
        observations, rewards, terminations, truncations, _ = envs.step(actions)
        for array in (observations[0], rewards[:1], terminations[:1], truncations[:1]):
            seen.update(np.ascontiguousarray(array).tobytes())
    return seen.hexdigest()


@pytest.mark.parametrize("cone", ["pyramidal", "elliptic"])
def test_a_rollout_is_the_same_whoever_is_beside_it(cone):
    alone = rollout(1, 1, cone=cone)
    assert rollout(16, 1, cone=cone) == alone
    assert rollout(16, 2, cone=cone) == alone
    assert rollout(64, 2, cone=cone) == alone


def test_a_seed_repeats_a_rollout_and_another_does_not():
    envs = MujocoVectorEnv("Hopper", 3)
    first, _ = envs.reset(seed=1)
    again, _ = envs.reset(seed=1)
    other, _ = envs.reset(seed=2)
    np.testing.assert_array_equal(first, again)
    np.testing.assert_array_equal(first[1:], other[:2])  # environment i has seed + i
    assert not np.array_equal(first, other)
    listed, _ = envs.reset(seed=[2, 3, 4])
    np.testing.assert_array_equal(listed, other)
    going_on, _ = envs.reset()
    assert not np.array_equal(going_on, other)


def test_next_step_resets_in_the_step_after_the_end():
    envs = MujocoVectorEnv("HalfCheetah", 2, max_episode_steps=3)
    envs.reset(seed=0)
    zeros = np.zeros(envs.action_space.shape, np.float32)
    for step in range(3):
        last, _, _, truncations, _ = envs.step(zeros)
        assert truncations.all() == (step == 2)
    observations, rewards, terminations, truncations, infos = envs.step(zeros)
    assert not truncations.any() and not terminations.any() and (rewards == 0).all()
    assert np.abs(observations - last).max() > 1e-3  # a new start
    assert "reward_forward" not in infos or not infos["_reward_forward"].any()
    assert infos["_x_position"].all()
    _, rewards, *_ = envs.step(zeros)
    assert (rewards != 0).all()


def test_same_step_resets_at_once_and_keeps_the_last_observation():
    envs = MujocoVectorEnv("HalfCheetah", 2, max_episode_steps=3, autoreset_mode=AutoresetMode.SAME_STEP)
    plain = MujocoVectorEnv("HalfCheetah", 2, max_episode_steps=3, autoreset_mode=AutoresetMode.DISABLED)
    envs.reset(seed=0)
    plain.reset(seed=0)
    actions = np.full(envs.action_space.shape, 0.3, np.float32)
    for _ in range(3):
        observations, rewards, _, truncations, infos = envs.step(actions)
        expected, expected_rewards, _, _, expected_infos = plain.step(actions)
    assert truncations.all()
    np.testing.assert_array_equal(np.stack(infos["final_obs"]), expected)
    np.testing.assert_array_equal(rewards, expected_rewards)
    np.testing.assert_array_equal(infos["final_info"]["x_velocity"], expected_infos["x_velocity"])
    assert not np.array_equal(observations, expected)
    with pytest.raises(ValueError, match="environment 0 has ended"):
        plain.step(actions)
    again, infos = plain.reset(options={"reset_mask": np.array([True, False])})
    assert infos["_x_position"].tolist() == [True, False]
    np.testing.assert_array_equal(again[1], expected[1])
    assert not np.array_equal(again[0], expected[0])


def test_gymnasiums_vector_wrappers_take_it():
    envs = gymnasium.wrappers.vector.RecordEpisodeStatistics(MujocoVectorEnv("Hopper", 2, max_episode_steps=4))
    envs.reset(seed=0)
    envs.action_space.seed(0)
    for _ in range(4):
        *_, infos = envs.step(envs.action_space.sample())
    assert infos["episode"]["l"].tolist() == [4, 4]


def test_accuracy_reaches_the_solver():
    envs = MujocoVectorEnv("Ant", 2, solver="npgs", tolerance=1e-12)
    envs.reset(seed=0)
    envs.set_accuracy(AccuracyPolicy.curriculum().apply(progress=0.5))
    rng = np.random.default_rng(0)
    for _ in range(10):
        envs.step(actions_of(rng, envs))
    # The first solve, the reset's, ran before.
    assert envs.simulation.status["iterations"].max() <= 10
    assert envs.stats()["iterations"]["p99"] <= 10


def test_mistakes():
    for steps in (0, -1, float("nan"), 1.5):
        with pytest.raises((TypeError, ValueError), match="max_episode_steps: expected"):
            MujocoVectorEnv("Hopper", 1, max_episode_steps=steps)
    with pytest.raises(ValueError, match="name: expected one of Ant"):
        MujocoVectorEnv("Swimmer")
    with pytest.raises(ValueError, match="healthy_reward: not a parameter of HalfCheetah"):
        MujocoVectorEnv("HalfCheetah", healthy_reward=1.0)
    envs = MujocoVectorEnv("Hopper", 2)
    with pytest.raises(gymnasium.error.ResetNeeded):
        envs.step(np.zeros((2, 3), np.float32))
    envs.reset(seed=0)
    with pytest.raises(ValueError, match=r"actions: expected \(2, 3\), got \(3,\)"):
        envs.step(np.zeros(3, np.float32))


def test_rsl_rl_adapter():
    torch = framework("torch", "the rsl_rl adapter is")
    from stiction.envs.rsl_rl import RslRlEnv

    envs = RslRlEnv(MujocoVectorEnv("Hopper", 2, max_episode_steps=3, autoreset_mode=AutoresetMode.SAME_STEP))
    assert (envs.num_envs, envs.num_actions, envs.max_episode_length) == (2, 3, 3)
    envs.reset(seed=0)
    observations = envs.get_observations()["policy"]
    assert observations.shape == (2, 11) and observations.dtype == torch.float32
    envs.episode_length_buf = torch.tensor([1, 0])
    for _ in range(2):
        observations, rewards, dones, extras = envs.step(torch.zeros(2, 3))
    assert dones.tolist() == [1, 0] and extras["time_outs"].tolist() == [True, False]
    assert extras["log"]["/episode/length"] == 3 and rewards.shape == (2,)
    assert envs.episode_length_buf.tolist() == [0, 2]


def test_stable_baselines_adapter():
    framework("stable_baselines3", "the Stable-Baselines3 adapter is")
    from stiction.envs.sb3 import Sb3VecEnv

    envs = Sb3VecEnv(MujocoVectorEnv("Hopper", 2, max_episode_steps=2, autoreset_mode=AutoresetMode.SAME_STEP))
    envs.seed(0)
    first = envs.reset()
    actions = np.zeros((2, 3), np.float32)
    envs.step(actions)
    observations, _, dones, infos = envs.step(actions)
    assert dones.all() and all(info["TimeLimit.truncated"] for info in infos)
    assert not np.array_equal(observations[0], infos[0]["terminal_observation"])


def test_the_quadruped_of_the_tutorial_starts_again_and_is_seen_alike_by_mj_step():
    framework("stable_baselines3", "the tutorial's quadruped is")
    example = runpy.run_path(str(ROOT / "examples" / "python" / "14_quadruped.py"))
    envs = example["Quadrupeds"](8)
    envs.reset(seed=2)
    envs.age[:] = 0
    rng = np.random.default_rng(0)
    for step in range(60):
        actions = rng.uniform(-1.5, 1.5, (8, 12))
        if step == 30:
            envs.simulation.qpos[3, 3:7] = 0, 1, 0, 0  # on its back
        if step == 40:
            envs.age[5] = example["EPISODE"] - 1
        seen, rewards, terminations, truncations, infos = envs.step(actions)
        assert np.isfinite(seen).all() and (rewards < 1.3 + 1e-12).all()
        over = terminations | truncations
        assert [row is not None for row in infos.get("final_obs", [None] * 8)] == over.tolist()
        if step == 30:
            assert terminations[3] and np.allclose(seen[3, 2], -1, atol=0.1)
        if step == 40:
            assert truncations[5] and not terminations[5]
    model = example["rough_model"]()
    task, data = envs.task, mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = envs.simulation.qpos[1], envs.simulation.qvel[1]
    assert np.allclose(task.observe(data.qpos[None], data.qvel[None], envs.action[1:2]), seen[1:2], atol=1e-5)
    local = np.zeros(6)
    mujoco.mj_forward(model, data)
    mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_XBODY, 1, local, 1)
    assert np.allclose(seen[1, 3:6], local[3:], atol=1e-5) and np.allclose(4 * seen[1, 6:9], local[:3], atol=1e-5)
