"""Simulations inside MuJoCo of which some have no constraints: MuJoCo's own work there, and nothing beyond it."""

import numpy as np
import pytest

mujoco = pytest.importorskip("mujoco", reason="stiction.mujoco is NOT tested: pip install mujoco")

import stiction  # noqa: E402
import stiction.mujoco  # noqa: E402

# An arm of two links that nothing touches, and a ball that lies on the ground or is high above it.
MODEL = """
<mujoco><option timestep="0.004" integrator="{integrator}"/><worldbody>
  <geom type="plane" size="5 5 1"/>
  <body pos="0 0 {height}"><freejoint/><geom size=".1"/></body>
  <body pos="1 0 2"><joint axis="0 1 0" damping=".1"/><geom type="capsule" fromto="0 0 0 .3 .1 0" size=".04"/>
    <body pos=".3 .1 0"><joint type="ball" damping=".1"/><geom type="capsule" fromto="0 0 0 .3 0 .2" size=".04"/></body>
  </body>
</worldbody></mujoco>"""
CHUNK = stiction.mujoco.BatchedSimulation(mujoco.MjModel.from_xml_string(MODEL.format(integrator="Euler", height=1)), 64,
                                          threads=1)._core.chunk_size()
HIGH = np.array([True, False, True, True, False, True, False] + (CHUNK - 4) * [True])  # the last chunk has no rows at all
INTEGRATORS = "Euler", "implicit", "implicitfast", "RK4"


def some_high(solver="auto", integrator="Euler", **options):
    """Simulations on one thread, in two chunks: those of HIGH have no rows, now and for a second."""
    model = mujoco.MjModel.from_xml_string(MODEL.format(integrator=integrator, height=0.095))
    simulation = stiction.mujoco.BatchedSimulation(model, len(HIGH), solver=solver, threads=1, **options)
    for i, data in enumerate(simulation.data):
        data.qvel[:] = np.random.default_rng(i).standard_normal(model.nv)
        data.qvel[2] = 0
        data.qpos[2] += 20 * HIGH[i]
    return simulation


def copies(simulation):
    peers = [mujoco.MjData(simulation.model) for _ in simulation.data]
    for peer, data in zip(peers, simulation.data):
        mujoco.mj_copyData(peer, simulation.model, data)
    return peers


@pytest.mark.parametrize("solver", ["auto", "npgs"])
@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_without_rows_steps_have_the_bits_of_mj_step(solver, integrator):
    """Sums of RK4 over rotations are formed here (docs/howto/mujoco.md): there MuJoCo's solver is the peer, and not its step."""
    simulation = some_high(solver, integrator, tolerance=1e-10)
    peers = copies(simulation)
    simulation.step()
    assert [data.nefc == 0 for data in simulation.data] == HIGH.tolist()
    simulation.step(nstep=9)
    if integrator == "RK4":
        stiction.mujoco.BatchedSimulation(simulation.model, peers, solver="mujoco").step(nstep=10)
    else:
        for peer in peers:
            mujoco.mj_step(simulation.model, peer, nstep=10)
    for high, data, peer in zip(HIGH, simulation.data, peers):
        for name in ("qpos", "qvel", "qacc", "qacc_warmstart", "qfrc_constraint"):
            found, expected = getattr(data, name), getattr(peer, name)
            np.testing.assert_allclose(found, expected, atol=1e-7, rtol=1e-7, err_msg=name)
            assert not high or found.tobytes() == expected.tobytes(), name


def test_forward_leaves_the_fields_that_mj_forward_leaves():
    simulation = some_high()
    for data in simulation.data:
        data.qacc_warmstart[:], data.qfrc_constraint[:] = 7, 5
    peers = copies(simulation)
    simulation.forward()
    for high, data, peer in zip(HIGH, simulation.data, peers):
        mujoco.mj_forward(simulation.model, peer)
        for name in ("qacc", "qacc_warmstart", "qfrc_constraint"):
            assert not high or (getattr(data, name) == getattr(peer, name)).all(), name


def test_no_solver_is_told_of_them():
    solver = stiction.Solver(trace=True)
    simulation = some_high(solver)
    simulation.step()
    first = solver.stats()["spans"]["host/velocity_newton"]["count"]
    assert first == 1  # of two chunks
    for i in np.flatnonzero(~HIGH):
        simulation.data[i].qpos[2] += 20
    simulation.step(nstep=3)
    stats = solver.stats()
    assert stats["spans"]["host/velocity_newton"]["count"] == first
    assert stats["solves"] == 4 and stats["codes"] == {"solved": 4 * len(HIGH)}
    assert (simulation.status["iterations"] == 0).all() and (simulation.status["residual"] == 0).all()


@pytest.mark.parametrize("solver", ["auto", "npgs"])
def test_those_with_rows_do_not_notice_them(solver):
    """Limits are each simulation's own, and so are its bits."""
    limits = np.where(np.arange(len(HIGH)) == 4, 0, 1000)
    simulation = some_high(solver, tolerance=1e-8)
    simulation.set_accuracy(tolerance=np.where(HIGH, 1.0, 1e-8), max_iterations=limits)
    peers = copies(simulation)
    simulation.step(nstep=10)
    for i in np.flatnonzero(~HIGH):
        alone = stiction.mujoco.BatchedSimulation(simulation.model, [peers[i]], solver=solver, tolerance=1e-8)
        alone.set_accuracy(max_iterations=int(limits[i]))
        alone.step(nstep=10)
        assert alone.status[0] == simulation.status[i]
        np.testing.assert_array_equal(peers[i].qpos, simulation.data[i].qpos)
        np.testing.assert_array_equal(peers[i].efc_force, simulation.data[i].efc_force)
    assert [stiction.CODES[code] for code in simulation.status["code"][[1, 4, 6]]] == ["solved", "max_iterations", "solved"]


@pytest.mark.parametrize("solver", ["auto", "npgs"])
def test_the_batch_has_their_masses(solver):
    simulation = some_high(solver)
    simulation.step()
    batch = simulation.batch()
    np.testing.assert_array_equal(np.diff(batch.arrays["offsets"]), [data.nefc for data in simulation.data])
    nv = simulation.model.nv
    for mass, v_free, moved, data in zip(batch.M.reshape(-1, nv, nv), batch.v_free.reshape(-1, nv),
                                         batch.extras["velocities"].reshape(-1, nv), simulation.data, strict=True):
        expected = np.zeros((nv, nv))
        mujoco.mj_fullM(simulation.model, data, expected)
        np.testing.assert_allclose(mass, expected, atol=1e-14, rtol=1e-12)
        np.testing.assert_array_equal(v_free, data.qacc_smooth)
        np.testing.assert_array_equal(moved, data.qacc)
    simulation.step(active=HIGH)  # none of which has a row
    dofs = np.diff(simulation.batch().arrays["dof_offsets"])
    np.testing.assert_array_equal(dofs, nv * HIGH)


def test_an_acceleration_without_rows_follows_forces_by_the_inverse_mass():
    simulation = some_high()
    simulation.forward()
    gradients = simulation.pull(np.ones((len(HIGH), simulation.model.nv)))
    for i in np.flatnonzero(HIGH):
        expected = np.ones((1, simulation.model.nv))
        mujoco.mj_solveM(simulation.model, simulation.data[i], expected, expected.copy())
        np.testing.assert_allclose(gradients.qfrc[i], expected[0], rtol=1e-9, atol=1e-12)
