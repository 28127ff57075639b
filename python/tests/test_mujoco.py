"""stiction inside MuJoCo: rows as they were, answers as MuJoCo's Newton has them, steps as mj_step makes them."""

import pathlib

import numpy as np
import pytest

mujoco = pytest.importorskip("mujoco", reason="stiction.mujoco is NOT tested: pip install mujoco")

import stiction  # noqa: E402
import stiction.mujoco  # noqa: E402
from mujoco_zoo import controls, disturb, step_side_by_side, zoo  # noqa: E402

INTEGRATORS = ("Euler", "implicit", "implicitfast", "RK4")


def forward(model, steps=30):
    data = mujoco.MjData(model)
    for step in range(steps):
        data.ctrl[:] = controls(model, step)
        mujoco.mj_step(model, data)
    mujoco.mj_forward(model, data)
    return data


@pytest.mark.parametrize("jacobian", ["dense", "sparse"])
@pytest.mark.parametrize("cone", ["pyramidal", "elliptic"])
def test_rows_are_gathered_as_they_are(cone, jacobian):
    model = zoo(cone, jacobian=jacobian)
    data = forward(model)
    dense = np.zeros((data.nefc, model.nv))
    if jacobian == "sparse":
        mujoco.mju_sparse2dense(dense, data.efc_J, data.efc_J_rownnz, data.efc_J_rowadr, data.efc_J_colind)
    else:
        dense[:] = data.efc_J.reshape(dense.shape)
    batch = stiction.mujoco.gather(model, [data, data])
    assert len(batch) == 2
    n, nv = dense.shape
    np.testing.assert_array_equal(batch.J.reshape(2, n, nv)[1], dense)
    np.testing.assert_array_equal(batch.target.reshape(2, n)[1], data.efc_aref)
    np.testing.assert_array_equal(batch.R.reshape(2, n)[1], data.efc_R)
    np.testing.assert_array_equal(batch.v_free.reshape(2, nv)[1], data.qacc_smooth)
    mass = np.zeros((nv, nv))
    mujoco.mj_fullM(model, data, mass)
    np.testing.assert_allclose(batch.M.reshape(2, nv, nv)[1], mass, rtol=0, atol=1e-14 * mass.max())
    counts = np.bincount(batch.arrays["kinds"], minlength=4) // 2
    types = np.bincount(data.efc_type, minlength=8)
    assert types[:6].all(), f"the model should have every kind of row, but has {types}"
    edges, cones = types[6], sum(contact.dim > 1 for contact in data.contact) if cone == "elliptic" else 0
    assert counts.tolist() == [types[0], types[3] + types[4] + types[5] + edges, types[1] + types[2], cones]
    ids = batch.extras["cone_id"][:len(batch.extras["cone_id"]) // 2]
    assert len(set(ids.tolist())) == len(ids)


@pytest.mark.parametrize("jacobian", ["dense", "sparse"])
@pytest.mark.parametrize("cone", ["pyramidal", "elliptic"])
def test_accelerations_and_forces_are_those_of_mujocos_newton(cone, jacobian):
    # Strongly convex: both are near the one solution. Accelerations of up to 100 m/s2 times the tolerance of 1e-12, with
    # R of 1e-4 and more between residual and answer.
    model = zoo(cone, jacobian=jacobian)
    simulation = stiction.mujoco.BatchedSimulation(model, 1, tolerance=1e-12)
    data, peer = simulation.data[0], mujoco.MjData(model)
    for step in range(60):
        data.ctrl[:] = controls(model, step)
        simulation.forward()
        assert simulation.status["code"][0] == 0
        peer.qpos[:], peer.qvel[:], peer.ctrl[:], peer.qacc_warmstart[:] = data.qpos, data.qvel, data.ctrl, 0
        mujoco.mj_forward(model, peer)
        scale = max(1.0, np.abs(peer.qacc).max())
        assert np.abs(data.qacc - peer.qacc).max() <= 1e-7 * scale
        np.testing.assert_allclose(data.qfrc_constraint, peer.qfrc_constraint, rtol=0,
                                   atol=1e-7 * max(1.0, np.abs(peer.qfrc_constraint).max()))
        np.testing.assert_allclose(data.efc_force, peer.efc_force, rtol=0,
                                   atol=1e-6 * max(1.0, np.abs(peer.efc_force).max()))
        simulation.step()


def far_from_borders(model, data, margin=1e-5):
    """True if each row's state would be the same if J qacc - aref were a little different (mj_constraintUpdate)."""
    jar = np.zeros(data.nefc)
    mujoco.mj_mulJacVec(model, data, jar, data.qacc)
    jar -= data.efc_aref
    slack = np.abs(jar)
    slack[data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY] = np.inf
    for kind in (mujoco.mjtConstraint.mjCNSTR_FRICTION_DOF, mujoco.mjtConstraint.mjCNSTR_FRICTION_TENDON):
        rows = data.efc_type == kind
        slack[rows] = np.abs(slack[rows] - (data.efc_R * data.efc_frictionloss)[rows])
    for contact in data.contact:
        if contact.efc_address < 0 or contact.dim == 1 or model.opt.cone != mujoco.mjtCone.mjCONE_ELLIPTIC:
            continue
        rows = slice(contact.efc_address, contact.efc_address + contact.dim)
        normal = jar[rows][0] * contact.mu
        tangent = np.linalg.norm(jar[rows][1:] * contact.friction[:contact.dim - 1])
        slack[rows] = min(abs(normal - contact.mu * tangent), abs(contact.mu * normal + tangent))
    return slack > margin * max(1.0, np.abs(data.efc_aref).max(initial=0))


def compare_states(model, steps, scale=1.0):
    """States that stiction and MuJoCo's Newton have at equal state along a trajectory. All rows far from the borders
    of their zones have the same ones. Returns how often each state was, and the share of rows that were compared.

    Without islands: with them MuJoCo 4.0.0 leaves states of an earlier solve behind (its own mj_constraintUpdate at the
    same accelerations gives others).
    """
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_ISLAND
    simulation = stiction.mujoco.BatchedSimulation(model, 1, tolerance=1e-12)
    data, peer = simulation.data[0], mujoco.MjData(model)
    data.qvel[:] = np.random.default_rng(0).uniform(-1, 1, model.nv)  # so that contacts slip, too
    seen, rows = np.zeros(5, int), 0
    for step in range(steps):
        data.ctrl[:] = scale * controls(model, step)
        simulation.forward()
        peer.qpos[:], peer.qvel[:], peer.ctrl[:], peer.qacc_warmstart[:] = data.qpos, data.qvel, data.ctrl, 0
        mujoco.mj_forward(model, peer)
        far = far_from_borders(model, peer)
        np.testing.assert_array_equal(data.efc_state[far], peer.efc_state[far], f"step {step}")
        seen += np.bincount(peer.efc_state[far], minlength=5)
        rows += len(far)
        simulation.step()
    return seen, seen.sum() / rows


@pytest.mark.parametrize("jacobian", ["dense", "sparse"])
@pytest.mark.parametrize("cone", ["pyramidal", "elliptic"])
def test_states_are_those_of_mujocos_newton(cone, jacobian):
    seen, share = compare_states(zoo(cone, jacobian=jacobian), 120, scale=4.0)
    assert (seen[:4] > 0).all() and (seen[4] > 0) == (cone == "elliptic"), seen
    assert share > 0.9


@pytest.mark.parametrize("cone", ["pyramidal", "elliptic"])
@pytest.mark.parametrize("name", ["ant", "half_cheetah", "hopper", "walker2d_v5", "humanoid"])
def test_states_of_gymnasiums_models_are_those_of_mujocos_newton(name, cone):
    gymnasium = pytest.importorskip("gymnasium", reason="Gymnasium's models are NOT tested: pip install gymnasium")
    path = pathlib.Path(gymnasium.__file__).parent / "envs" / "mujoco" / "assets" / f"{name}.xml"
    model = mujoco.MjModel.from_xml_path(str(path))
    model.opt.cone = getattr(mujoco.mjtCone, f"mjCONE_{cone.upper()}")
    model.opt.solver, model.opt.tolerance, model.opt.iterations = mujoco.mjtSolver.mjSOL_NEWTON, 0, 100
    seen, share = compare_states(model, 150)
    assert seen[0] > 0 and seen[1] > 0 and share > 0.9, (seen, share)


def test_states_have_mujocos_numbers():
    names = ("SATISFIED", "QUADRATIC", "LINEARNEG", "LINEARPOS", "CONE")
    assert [int(getattr(mujoco.mjtConstraintState, f"mjCNSTRSTATE_{name}")) for name in names] == list(range(5))


@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize("cone", ["pyramidal", "elliptic"])
def test_steps_with_mujocos_own_solver_are_mj_steps(cone, integrator):
    # The stages around the solve are MuJoCo's own, called in its order; only RK4's sums are formed here.
    model = zoo(cone, integrator)
    simulation = stiction.mujoco.BatchedSimulation(model, 2, solver="mujoco")
    peer = mujoco.MjData(model)
    for step in range(40):
        ctrl = controls(model, step)
        simulation.step(np.stack([ctrl, ctrl]))
        peer.ctrl[:] = ctrl
        mujoco.mj_step(model, peer)
        for data in simulation.data:
            for field in ("qpos", "qvel", "qacc", "qacc_warmstart", "xpos", "time"):
                ours, theirs = np.asarray(getattr(data, field)), np.asarray(getattr(peer, field))
                if integrator == "RK4":
                    np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-10 * max(1, np.abs(theirs).max()))
                else:
                    np.testing.assert_array_equal(ours, theirs)


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_steps_with_stiction_are_nearly_mj_steps(integrator):
    simulation = stiction.mujoco.BatchedSimulation(zoo(integrator=integrator), 1, tolerance=1e-12)
    disturb(simulation)
    peer = mujoco.MjData(simulation.model)
    for step in range(40):
        assert step_side_by_side(simulation, peer, controls(simulation.model, step)) < 1e-11


def trajectory(n, threads, watched=0, steps=40):
    """Bits of one simulation's positions after some steps; simulation i has its own controls and leaps once."""
    model = zoo()
    simulation = stiction.mujoco.BatchedSimulation(model, n, tolerance=1e-6, threads=threads)
    for step in range(steps):
        if step == 20:
            for i in range(1, n, 2):  # rows of some neighbours vanish, and come back: more room than ever before
                simulation.data[i].qpos[2] += 1.0
        simulation.step(np.stack([controls(model, step, seed=i) for i in range(n)]))
    return simulation.data[watched].qpos.tobytes()


def test_bits_depend_on_nothing_beside_a_simulation():
    alone = trajectory(1, 1)
    assert trajectory(5, 1) == alone
    assert trajectory(5, 2) == alone
    assert trajectory(16, 2) == alone
    assert trajectory(5, 1, watched=4) == trajectory(16, 2, watched=4) != alone
