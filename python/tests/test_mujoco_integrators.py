"""Work of MuJoCo 4 around a solve: the metric of `discrete`, islands, sleep, sensors of accelerations."""

import numpy as np
import pytest

mujoco = pytest.importorskip("mujoco", reason="stiction.mujoco is NOT tested: pip install mujoco")

import stiction  # noqa: E402
import stiction.mujoco  # noqa: E402
from mujoco_zoo import ZOO, controls, zoo  # noqa: E402
from stiction.mujoco import metric as mujoco_metric  # noqa: E402
from stiction.mujoco import BatchedSimulation  # noqa: E402

CONES, JACOBIANS = ("pyramidal", "elliptic"), ("dense", "sparse")

# All that the metric has: damping, a tendon and a servo with stiffness, and a body that spins in the air.
STIFF = (ZOO.replace('<fixed name="t" ', '<fixed name="t" stiffness="3" damping="0.5" ')
         .replace('<motor joint="b" gear="2"/>', '<position joint="b" kp="500" kv="20"/>')
         .replace('damping="0.2"', 'damping="5"')
         .replace('<body pos="1 1 1">', '<body pos="2 2 8"><freejoint/><geom type="box" size=".1 .2 .3"/></body>'
                  '<body pos="1 1 1">')
         .replace('<body pos="0 0 0.1"><freejoint/>', '<body pos="0 0 0.1"><freejoint/><site name="s"/>')
         .replace("</mujoco>", '<sensor><accelerometer site="s"/><force site="s"/><torque site="s"/><touch site="s"/>'
                  '<gyro site="s"/></sensor></mujoco>'))


def stiff(cone="elliptic", integrator="discrete", jacobian="dense"):
    return mujoco.MjModel.from_xml_string(STIFF.format(cone=cone, integrator=integrator, jacobian=jacobian))


def start(simulation, peer):
    """The same velocities for all, those of the last bodies larger."""
    for data in [*simulation.data, peer]:
        data.qvel[:] = 0.1 * np.random.default_rng(7).standard_normal(len(data.qvel))
        data.qvel[-10:] *= 10


def step_beside(simulation, peer, steps=40):
    """Largest differences of positions, velocities and sensors, a step at a time from the simulation's state."""
    data, model, worst = simulation.data[0], simulation.model, np.zeros(3)
    for step in range(steps):
        for field in ("qpos", "qvel", "qacc_warmstart"):
            getattr(peer, field)[:] = getattr(data, field)
        peer.time, peer.ctrl[:] = data.time, controls(model, step)
        simulation.step(np.tile(peer.ctrl, (len(simulation), 1)))
        mujoco.mj_step(model, peer)
        felt = np.abs(data.sensordata - peer.sensordata) / (1 + np.abs(peer.sensordata))
        worst = np.maximum(worst, [np.abs(data.qpos - peer.qpos).max(), np.abs(data.qvel - peer.qvel).max(),
                                   felt.max(initial=0)])
    return worst


@pytest.mark.parametrize("jacobian", JACOBIANS)
@pytest.mark.parametrize("cone", CONES)
@pytest.mark.parametrize("solver", ["auto", "newton"])
def test_discrete_is_solved_in_its_metric(solver, cone, jacobian):
    model = stiff(cone, jacobian=jacobian)
    simulation, peer = BatchedSimulation(model, 2, solver=solver, tolerance=1e-12), mujoco.MjData(model)
    start(simulation, peer)
    options = model.opt.ls_iterations, model.opt.disableflags
    positions, velocities, sensors = step_beside(simulation, peer)
    assert positions < 1e-11 and velocities < 1e-9 and sensors < 1e-8
    assert (simulation.status["code"] == 0).all()
    assert (model.opt.ls_iterations, model.opt.disableflags) == options
    simulation.forward()
    found, mass = simulation.batch().M.reshape(2, model.nv, model.nv), np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, simulation.data[0], mass)
    assert (found[0].diagonal() / mass.diagonal()).max() > 1.5  # another one than M


def test_discrete_steps_those_that_are_asked_for():
    model = stiff()
    simulation, peer = BatchedSimulation(model, 3, tolerance=1e-12, hold_failed=True), mujoco.MjData(model)
    start(simulation, peer)
    before = simulation.data[1].qpos.copy()
    for step in range(10):
        peer.ctrl[:] = controls(model, step)
        simulation.step(np.tile(peer.ctrl, (3, 1)), active=[True, False, True])
        mujoco.mj_step(model, peer)
    np.testing.assert_array_equal(simulation.data[1].qpos, before)
    for i in (0, 2):
        np.testing.assert_allclose(simulation.data[i].qpos, peer.qpos, rtol=0, atol=1e-11)
    simulation.data[2].qvel[3] = np.nan
    simulation.step()
    assert simulation.failed.tolist() == [2]
    assert all(np.isfinite(data.qpos).all() for data in simulation.data)


def test_the_metric_is_the_one_of_the_smooth_acceleration():
    model = stiff()
    data = mujoco.MjData(model)
    data.qvel[:] = np.random.default_rng(1).standard_normal(model.nv)
    data.ctrl[:] = 1
    mujoco.mj_forward(model, data)
    metric = mujoco_metric.effective_mass(model, data)
    np.testing.assert_array_equal(metric, metric.T)
    force = data.qfrc_smooth + data.efm_c + data.efm_ca
    np.testing.assert_allclose(metric @ data.qacc_smooth, force, rtol=0, atol=1e-11 * np.abs(force).max())


@pytest.mark.parametrize("cone", CONES)
def test_discrete_steps_with_mujocos_own_solver_are_mj_steps(cone):
    model = stiff(cone)
    simulation, peer = BatchedSimulation(model, 2, solver="mujoco"), mujoco.MjData(model)
    start(simulation, peer)
    assert step_beside(simulation, peer).tolist() == [0, 0, 0]


def test_derivatives_are_those_of_the_metric():
    model = stiff()
    simulation = BatchedSimulation(model, 1, tolerance=1e-13)
    data = simulation.data[0]
    simulation.step(nstep=10)
    simulation.forward()
    weights = np.random.default_rng(3).standard_normal(model.nv)
    free = slice(model.nv - 9, model.nv - 3)  # the body in the air is MuJoCo's own affair (implicit in its spin)
    weights[free] = 0
    gradients = simulation.pull(weights[None])
    assert gradients.valid.all()
    for dof in (2, 8, 25, 26):
        values = []
        for change in (1e-5, -1e-5):
            data.qfrc_applied[dof] = change
            simulation.forward()
            values.append(weights @ data.qacc)
            data.qfrc_applied[dof] = 0
        assert gradients.qfrc[0, dof] == pytest.approx((values[0] - values[1]) / 2e-5, rel=1e-5, abs=1e-6)


@pytest.mark.parametrize("integrator", ["Euler", "implicitfast"])
def test_sensors_of_accelerations_are_of_the_present_step(integrator):
    model = stiff(integrator=integrator)
    for solver in ("auto", "mujoco"):
        simulation, peer = BatchedSimulation(model, 1, solver=solver, tolerance=1e-12), mujoco.MjData(model)
        start(simulation, peer)
        sensors = step_beside(simulation, peer)[2]
        assert sensors < 1e-8 and np.abs(peer.sensordata[:3]).max() > 1


@pytest.mark.parametrize("cone", CONES)
def test_islands_change_no_answer(cone):
    accelerations = {}
    for islands in (True, False):
        model = zoo(cone)
        if not islands:
            model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_ISLAND
        simulation, peer = BatchedSimulation(model, 1, tolerance=1e-12), mujoco.MjData(model)
        start(simulation, peer)
        assert step_beside(simulation, peer)[0] < 1e-11
        assert (simulation.data[0].nisland > 1) == islands
        accelerations[islands] = simulation.data[0].qacc.tobytes()
    assert accelerations[True] == accelerations[False]  # MuJoCo's islands are not read here


# Two boxes fall asleep; another falls onto the first and wakes it.
SLEEPERS = """
<mujoco><option timestep="0.004" cone="{cone}" jacobian="{jacobian}" integrator="{integrator}" tolerance="0"
iterations="100"><flag sleep="enable"/></option><worldbody><geom type="plane" size="5 5 1"/>
  <body pos="0 0 .1"><freejoint/><geom type="box" size=".1 .1 .1"/></body>
  <body pos="2 0 .1"><freejoint/><geom type="box" size=".1 .1 .1"/></body>
  <body pos="0.03 0.01 1.5" euler="10 20 0"><freejoint/><geom type="box" size=".1 .1 .1"/></body>
  <body pos="-1 0 .5"><joint axis="0 1 0"/><geom type="capsule" fromto="0 0 0 .3 0 0" size=".04"/></body>
</worldbody></mujoco>"""


@pytest.mark.parametrize("integrator", ["Euler", "implicit", "implicitfast", "discrete"])
@pytest.mark.parametrize("cone, jacobian", [("pyramidal", "sparse"), ("elliptic", "dense")])
def test_sleeping_trees_are_not_moved_and_wake_when_mujocos_do(cone, jacobian, integrator):
    model = mujoco.MjModel.from_xml_string(SLEEPERS.format(cone=cone, jacobian=jacobian, integrator=integrator))
    simulation, peer = BatchedSimulation(model, 2, tolerance=1e-12), mujoco.MjData(model)
    data, slept = simulation.data[1], 0
    for step in range(160):
        before, awake_before = data.qpos.copy(), data.tree_awake.copy()
        simulation.step()
        mujoco.mj_step(model, peer)
        awake = data.tree_awake
        assert awake.tolist() == peer.tree_awake.tolist(), step
        # Until the impact in step 121, which enlarges roundings.
        np.testing.assert_allclose(data.qpos, peer.qpos, rtol=0, atol=1e-11 if step < 121 else 1e-5)
        for tree in (0, 1):
            if not awake_before[tree] and not awake[tree]:
                slept += 1
                assert data.qpos[7 * tree:7 * tree + 7].tobytes() == before[7 * tree:7 * tree + 7].tobytes()
                assert (data.qvel[6 * tree:6 * tree + 6] == 0).all()
    assert slept > 150 and awake.tolist() == [1, 0, 1, 1]


def change_enable(bit):
    return lambda opt: setattr(opt, "enableflags", opt.enableflags | int(getattr(mujoco.mjtEnableBit, bit)))


@pytest.mark.parametrize("integrator, change, message", [
    ("discrete", change_enable("mjENBL_IPC"), "expected no mjENBL_IPC, got it.*clear it"),
    ("RK4", change_enable("mjENBL_SLEEP"), "no sleeping bodies with RK4, got mjENBL_SLEEP.*mjINT_IMPLICITFAST"),
])
def test_what_would_be_stepped_otherwise_is_refused(integrator, change, message):
    model = stiff(integrator=integrator)
    change(model.opt)
    with pytest.raises(ValueError, match=message):
        BatchedSimulation(model, 1)


def test_a_mujoco_without_the_metric_is_refused(monkeypatch):
    monkeypatch.setattr(mujoco_metric, "_known", {})
    monkeypatch.setattr(mujoco_metric, "library", lambda: object())
    simulation = BatchedSimulation(stiff(), 1)
    with pytest.raises(stiction.mujoco.LayoutError, match="has no mj_effMulAdd.*mjINT_IMPLICITFAST"):
        simulation.step()


def test_a_metric_that_is_another_is_noticed(monkeypatch):
    class Library:
        """MuJoCo's library, whose function does nothing."""

        def __init__(self, own):
            self.mjd_freeGyroPossible, self.mj_effMulAdd = own.mjd_freeGyroPossible, own.mju_zero4

    own = mujoco_metric.library()
    monkeypatch.setattr(mujoco_metric, "_known", {})
    monkeypatch.setattr(mujoco_metric, "library", lambda: Library(own))
    with pytest.raises(stiction.mujoco.LayoutError, match="is not what it was in 4.0.0"):
        mujoco_metric._functions()


@pytest.mark.skipif(not hasattr(mujoco.mjtIntegrator, "mjINT_DISCRETE"), reason="MuJoCo before 3.13")
def test_nothing_of_a_metric_is_left_for_the_next_integrator():
    """A damper between two bodies couples them in the metric of `discrete`, and M has no entry for that."""
    model = mujoco.MjModel.from_xml_string("""
<mujoco><option integrator="discrete"/><worldbody>
  <body><joint name="a" axis="0 1 0"/><geom size=".1" pos=".3 0 0"/></body>
  <body pos="0 1 0"><joint name="b" axis="0 1 0"/><geom size=".1" pos=".3 0 0"/></body>
</worldbody><tendon><fixed damping="50"><joint joint="a" coef="1"/><joint joint="b" coef="-1"/></fixed></tendon></mujoco>""")
    simulation = stiction.mujoco.BatchedSimulation(model, 2)
    simulation.step()
    assert simulation.batch().M.reshape(2, 2, 2)[1, 1, 0] != 0
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_EULER
    simulation.step()
    expected = np.zeros((2, 2))
    mujoco.mj_fullM(model, simulation.data[1], expected)
    np.testing.assert_array_equal(simulation.batch().M.reshape(2, 2, 2)[1], expected)
