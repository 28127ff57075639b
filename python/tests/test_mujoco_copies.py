"""Simulations copied and pickled, the rows that MuJoCo's own solver has solved, and wrong counts."""

import copy
import pickle

import numpy as np
import pytest

mujoco = pytest.importorskip("mujoco", reason="stiction.mujoco is NOT tested: pip install mujoco")

import stiction  # noqa: E402
import stiction.mujoco  # noqa: E402
from mujoco_zoo import controls, zoo  # noqa: E402
from stiction.mujoco import BatchedSimulation  # noqa: E402

AGAIN = pytest.mark.parametrize("again", [copy.deepcopy, lambda it: pickle.loads(pickle.dumps(it))],
                                ids=["deepcopy", "pickle"])


def run(simulation, begin, end):
    for step in range(begin, end):
        simulation.step(np.tile(controls(simulation.model, step), (len(simulation), 1)))


def begun(**options):
    simulation = BatchedSimulation(zoo(), 3, **options)
    for i, data in enumerate(simulation.data):
        data.qvel[:] = 0.1 * np.random.default_rng(i).normal(size=len(data.qvel))
    run(simulation, 0, 15)
    return simulation


@AGAIN
@pytest.mark.parametrize("options", [{}, {"solver": "npgs", "warm_start": 0}, {"solver": "mujoco"},
                                     {"solver": stiction.Solver(tolerance=1e-4)}], ids=["auto", "npgs", "mujoco", "given"])
def test_a_copy_goes_on_with_the_same_bits_and_changes_nothing_of_the_first(again, options):
    simulation = begun(**options)
    came = again(simulation)
    assert came.model is not simulation.model and len(came) == 3
    for name in ("qpos", "qacc", "sensordata", "cfrc_ext"):
        np.testing.assert_array_equal(came.read(name), simulation.read(name))
    for one, other in zip(came.data, simulation.data):
        np.testing.assert_array_equal(one.efc_force, other.efc_force)
    before = simulation.read("qpos")
    came.model.opt.gravity[2] = -1
    run(came, 15, 20)
    np.testing.assert_array_equal(simulation.read("qpos"), before)
    other = again(simulation)
    run(simulation, 15, 30)
    run(other, 15, 30)
    for name in ("qpos", "qvel", "qacc_warmstart"):
        np.testing.assert_array_equal(other.read(name), simulation.read(name))


@AGAIN
def test_limits_and_held_states_come_along(again):
    simulation = begun(hold_failed=True)
    simulation.set_accuracy(max_iterations=[1, 0, 1])
    simulation.data[1].qvel[3] = np.nan
    simulation.step()
    assert simulation.failed.tolist() == [1]
    came = again(simulation)
    assert came.failed.tolist() == [1]
    came.data[2].qpos[3] = np.nan
    for one in (simulation, came):
        one.step()
    assert came.failed.tolist() == [2]
    np.testing.assert_array_equal(came.read("qpos")[:2], simulation.read("qpos")[:2])
    np.testing.assert_array_equal(came.status["iterations"][:2], simulation.status["iterations"][:2])
    assert (came.status["iterations"] <= 1).all()


@AGAIN
def test_a_copy_of_one_that_starts_from_reactions_starts_without(again):
    simulation = begun(solver="npgs", tolerance=1e-12)
    assert simulation.starts_from_reactions
    came = again(simulation)
    simulation.reset_warm_start()
    run(simulation, 15, 17)
    run(came, 15, 17)
    np.testing.assert_array_equal(came.read("qpos"), simulation.read("qpos"))


@AGAIN
def test_environments_go_on_as_the_first_does(again):
    pytest.importorskip("gymnasium", reason="environments are NOT copied: pip install gymnasium")
    from stiction.envs import MujocoVectorEnv
    envs = MujocoVectorEnv("Hopper", 4, max_episode_steps=7)
    envs.reset(seed=3)
    actions = np.random.default_rng(0).uniform(-1, 1, (20, 4, 3)).astype(np.float32)
    for action in actions[:5]:
        envs.step(action)
    came = again(envs)
    assert came.model is came.simulation.model and came.model is not envs.model
    for action in actions[5:]:  # episodes end and begin, with noise of the same streams
        expected, found = envs.step(action), came.step(action)
        for one, other in zip(expected[:4], found[:4]):
            np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("integrator", ["Euler", "implicitfast", "RK4", "discrete"])
@pytest.mark.parametrize("cone", ["elliptic", "pyramidal"])
@pytest.mark.parametrize("jacobian", ["dense", "sparse"])
def test_the_rows_of_mujocos_own_solves(integrator, cone, jacobian):
    model = zoo(cone, integrator, jacobian)
    simulation = BatchedSimulation(model, 2, solver="mujoco")
    simulation.step(np.ones((2, model.nu)), nstep=20, active=[True, False])
    simulation.step(np.ones((2, model.nu)), nstep=20)
    before = simulation.read("qpos")
    batch = simulation.batch()
    assert len(batch) == 2 and batch.rows == sum(data.nefc for data in simulation.data) > 20
    np.testing.assert_array_equal(batch.extras["lambda_"], np.concatenate([data.efc_force for data in simulation.data]))
    if integrator != "RK4":  # which leaves the mean of four solves there
        np.testing.assert_array_equal(batch.extras["velocities"], simulation.read("qacc").reshape(-1))
    # MuJoCo's answer, run to its end, is the answer of these rows.
    solution = stiction.Solver(solver="newton", tolerance=1e-10).solve(batch)
    np.testing.assert_allclose(solution.velocities, batch.extras["velocities"], atol=1e-5)
    assert stiction.verify(batch, batch.extras["lambda_"])[:, 0].max() < 1e-6
    np.testing.assert_array_equal(simulation.read("qpos"), before)
    simulation.step(active=[False, True])
    assert (simulation.read("qpos")[0] == before[0]).all() and (simulation.read("qpos")[1] != before[1]).any()


def test_the_rows_of_mujocos_own_solves_are_saved(tmp_path):
    simulation = BatchedSimulation(zoo(), 2, solver="mujoco")
    simulation.step(nstep=20)
    simulation.batch().save(tmp_path / "rows.h5")
    again = stiction.Batch.from_file(tmp_path / "rows.h5")
    assert again.rows == sum(data.nefc for data in simulation.data) and len(again.extras["v_free"]) == 2 * simulation.model.nv


@pytest.mark.parametrize("count", [2.5, "2", None, np.float32(1.5)])
def test_a_count_that_is_none_is_refused(count):
    with pytest.raises(TypeError, match="n: expected an integer, got "):
        BatchedSimulation(zoo(), count)


def test_a_whole_float_is_a_count_and_one_below_one_is_none():
    assert len(BatchedSimulation(zoo(), 2.0)) == len(BatchedSimulation(zoo(), np.float32(2))) == 2
    for count in (0, -1):
        with pytest.raises(ValueError, match=f"n: expected at least one simulation, got {count}"):
            BatchedSimulation(zoo(), count)


def test_a_count_of_environments_that_is_none_is_refused():
    pytest.importorskip("gymnasium", reason="counts of environments are NOT tested: pip install gymnasium")
    from stiction.envs import MujocoVectorEnv
    with pytest.raises(TypeError, match="num_envs: expected an integer, got 2.5"):
        MujocoVectorEnv("Hopper", 2.5)


READ_BACK = """<mujoco><option timestep="0.002" integrator="{integrator}" cone="{cone}" tolerance="0" iterations="100">
  <flag energy="{energy}" fwdinv="{fwdinv}"/></option>
  <worldbody><geom type="plane" size="5 5 1"/>
    <body pos="0 0 .0999"><freejoint/><geom type="box" size=".1 .1 .1" mass="2"/></body>
    <body pos="1 0 1"><joint name="h" axis="0 1 0" range="-20 15" limited="true" frictionloss=".2"/>
      <geom type="capsule" fromto="0 0 0 .4 0 0" size=".04" mass="1"/></body></worldbody>
  {sensors}</mujoco>"""


@pytest.mark.parametrize("integrator", ["Euler", "implicitfast", "RK4", "discrete"])
@pytest.mark.parametrize("cone", ["elliptic", "pyramidal"])
@pytest.mark.parametrize("solver", ["auto", "mujoco"])
def test_energies_and_the_check_of_inverse_dynamics_are_left_as_mj_step_leaves_them(integrator, cone, solver):
    state = mujoco.mjtState.mjSTATE_INTEGRATION
    for energy, fwdinv in (("enable", "enable"), ("disable", "enable"), ("enable", "disable")):
        model = mujoco.MjModel.from_xml_string(READ_BACK.format(
            integrator=integrator, cone=cone, energy=energy, fwdinv=fwdinv,
            sensors="<sensor><e_potential/><e_kinetic/></sensor>" if energy == "enable" else ""))
        simulation, peer = BatchedSimulation(model, 2, solver=solver, tolerance=1e-11), mujoco.MjData(model)
        data, room, compared = simulation.data[1], np.zeros(mujoco.mj_stateSize(model, state)), []
        for _ in range(40):
            mujoco.mj_getState(model, data, room, state)
            mujoco.mj_setState(model, peer, room, state)
            mujoco.mj_step(model, peer)
            simulation.step()
            np.testing.assert_allclose(data.energy, peer.energy, atol=1e-9)
            np.testing.assert_allclose(data.sensordata, peer.sensordata, atol=1e-9)
            compared.append((data.solver_fwdinv.copy(), peer.solver_fwdinv.copy()))
        ours, theirs = (np.array(part) for part in zip(*compared))
        assert (ours.max() > 0) == (theirs.max() > 0) == (fwdinv == "enable")
        assert ours.max() < 1e-6 and (np.abs(data.energy).max() > 0) == (energy == "enable")
