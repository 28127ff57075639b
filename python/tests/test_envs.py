"""The vector environment against Gymnasium's own, its ends and seeds, and its bits."""

import dataclasses
import hashlib
import itertools
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


QUADRUPED = """<mujoco><option timestep="0.004" iterations="1" ls_iterations="5"/>
  <default><geom contype="0" conaffinity="0"/><joint damping="0.5" armature="0.005" frictionloss="0.3"/></default>
  <asset><mesh file="of_menagerie.stl"/></asset>
  <worldbody><geom name="floor" type="plane" size="0 0 1" contype="1" friction="0.6" priority="1"/>
    <body name="trunk" pos="0 0 0.3"><freejoint/><geom type="mesh" mesh="of_menagerie"/>
      <inertial pos="0.02 0 0" mass="6" diaginertia="0.07 0.06 0.02"/>{legs}</body></worldbody>
  <actuator>{servos}</actuator>
  <keyframe><key qpos="0 0 0.28 1 0 0 0 {pose}"/></keyframe></mujoco>"""
LEG = """<body pos="{x} {y} 0"><joint name="hip{leg}" axis="0 1 0"/>
  <geom type="capsule" fromto="0 0 0 0 0 -0.2" size="0.02"/>
  <body pos="0 0 -0.2"><joint name="knee{leg}" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0 0 -0.2" size="0.01"/>
  <geom type="sphere" pos="0 0 -0.2" size="0.023" conaffinity="1"/></body></body>"""


@pytest.fixture(params=("own", "go1"))
def quadruped(request, tmp_path):
    """The example's names, and its robot: its own, or a scene that, as Go1's, has absent meshes and one iteration."""
    framework("stable_baselines3", "the tutorial's quadruped is")
    example = runpy.run_path(str(ROOT / "examples" / "python" / "14_quadruped.py"))
    path = tmp_path / "scene.xml"
    corners = list(itertools.product((-0.2, 0.2), (-0.1, 0.1)))
    path.write_text(QUADRUPED.format(
        legs="".join(LEG.format(x=x, y=y, leg=leg) for leg, (x, y) in enumerate(corners)), pose="0.8 -1.6 " * 4,
        servos="".join(f'<position joint="{joint}{leg}" kp="35"/>' for leg in range(4) for joint in ("hip", "knee"))))
    robot = example["robot_of"](request.param, path)
    assert robot.model.opt.iterations == 100 and robot.model.nu == (12 if request.param == "own" else 8)
    return example, robot


def test_the_quadruped_of_the_tutorial_starts_again_and_is_seen_alike_by_mj_step(quadruped):
    example, robot = quadruped
    envs, servos = example["Quadrupeds"](robot, 8), robot.model.nu
    envs.reset(seed=2)
    envs.age[:] = 0
    rng = np.random.default_rng(0)
    for step in range(60):
        actions = rng.uniform(-1.5, 1.5, (8, servos))
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
    assert seen.shape == (8, 9 + 3 * servos + 2 * (servos == 8))
    data, local = mujoco.MjData(robot.model), np.zeros(6)
    data.qpos[:], data.qvel[:] = envs.simulation.qpos[1], envs.simulation.qvel[1]
    again = envs.task.observe(data.qpos[None], data.qvel[None], envs.action[1:2], envs.age[1:2])
    assert np.array_equal(again.astype(np.float32), seen[1:2])
    mujoco.mj_normalizeQuat(robot.model, data.qpos)
    mujoco.mj_forward(robot.model, data)
    mujoco.mj_objectVelocity(robot.model, data, mujoco.mjtObj.mjOBJ_XBODY, 1, local, 1)
    mine = np.concatenate([-data.xmat[1, 6:], local[3:], 0.25 * local[:3]])
    assert np.allclose(again[0, :9], mine, atol=1e-6)
    if robot.watt:
        data.ctrl[:] = rng.uniform(-1, 1, servos)
        mujoco.mj_forward(robot.model, data)
        power = np.abs(data.actuator_force * data.actuator_velocity).sum()
        still = dataclasses.replace(robot, watt=0.0)
        free, paid = (example["Task"](one).reward(again, actions[1:2], actions[1:2], data.ctrl) for one in (still, robot))
        assert free - paid == pytest.approx(robot.watt * power, rel=1e-6)


def test_a_trot_bends_two_legs_of_the_quadruped_at_a_time(quadruped):
    example, robot = quadruped
    swings, none = robot.trot * np.array([0.5, -1.0]) * np.sin(2 * np.pi * 0.24), np.zeros(2)
    for age, expected in ((6, [swings, none, none, swings]), (19, [none, swings, swings, none]), (0, [none] * 4)):
        targets = example["Task"](robot).control(np.zeros((1, robot.model.nu)), np.array([age]))[0]
        assert np.allclose((targets - robot.model.key_qpos[0, 7:]).reshape(4, -1)[:, -2:], expected, atol=0.01 * robot.trot)


@pytest.mark.parametrize("engine", ("lanes", "mujoco"))
def test_the_quadrupeds_of_training_step_as_the_one_that_is_judged(quadruped, engine):
    example, robot = quadruped

    class Recorded:
        """A policy of random actions, which keeps what it is shown."""

        def __init__(self):
            self.shown, self.given, self.rng = [], [], np.random.default_rng(1)

        def predict(self, seen, deterministic):
            self.shown.append(seen[0])
            self.given.append(self.rng.uniform(-0.5, 0.5, (1, robot.model.nu)))
            return self.given[-1], None

    policy, envs = Recorded(), example["Quadrupeds"](robot, 2, engine=engine)
    distance, upright = example["walk_by_mj_step"](policy, robot, seed=7, seconds=0.2)
    assert upright == 0.2 and len(policy.given) == 10
    if engine == "mujoco":
        assert np.allclose(envs.simulation.get_model(1).body_mass[1:] / robot.model.body_mass[1:], 1, atol=0.15)
        assert not np.array_equal(envs.simulation.get_model(1).body_mass, robot.model.body_mass)
        envs.simulation.set_models([robot.model] * 2)
    else:
        envs.simulation.varied["body_mass"][:] = robot.model.body_mass
        envs.simulation.varied["geom_friction"][:] = robot.model.geom_friction
    envs.reset(seed=0)
    envs.age[:] = 0
    (envs.simulation.qpos[1],), (envs.simulation.qvel[1],) = envs.task.starts(1, np.random.default_rng(7))
    begin = float(envs.simulation.qpos[1, 0])
    for shown, action in zip(policy.shown, policy.given):
        seen = envs.task.observe(envs.simulation.qpos, envs.simulation.qvel, envs.action, envs.age)[1]
        assert np.allclose(seen, shown, atol=1e-3 if engine == "lanes" else 1e-6)
        envs.step(np.repeat(action, 2, axis=0))
    assert envs.simulation.qpos[1, 0] - begin == pytest.approx(distance, abs=1e-4)
