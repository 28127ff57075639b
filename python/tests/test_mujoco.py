"""stiction inside MuJoCo: rows as they were, answers as MuJoCo's Newton has them, steps as mj_step makes them."""

import gc
import pathlib

import numpy as np
import pytest

mujoco = pytest.importorskip("mujoco", reason="stiction.mujoco is NOT tested: pip install mujoco")

import stiction  # noqa: E402
import stiction.mujoco  # noqa: E402
from stiction import _mujoco_layout  # noqa: E402

# Every kind of row: equality, friction loss of a joint and of a tendon, limits of both, contacts of 1, 3, 4 and 6 rows.
ZOO = """
<mujoco>
  <option timestep="0.004" integrator="{integrator}" cone="{cone}" jacobian="{jacobian}" tolerance="0" iterations="100"/>
  <default><joint damping="0.2"/></default>
  <worldbody>
    <geom type="plane" size="5 5 1" friction="0.7 0.01 0.001"/>
    <body pos="0 0 0.1"><freejoint/><geom type="box" size=".1 .1 .1" condim="3"/></body>
    <body pos="0.05 0 0.3"><freejoint/><geom type="box" size=".1 .1 .1" condim="4" friction="0.5 0.02 0.001"/></body>
    <body pos="0.6 0 0.1"><freejoint/><geom type="sphere" size=".1" condim="6" friction="0.9 0.05 0.01"/></body>
    <body pos="-0.6 0 0.1"><freejoint/><geom type="sphere" size=".1" condim="1" priority="1"/></body>
    <body pos="0 1 0.5">
      <joint name="a" axis="0 1 0" range="5 10" limited="true" frictionloss="0.3"/>
      <geom type="capsule" fromto="0 0 0 .3 0 0" size=".04"/>
      <body pos=".3 0 0"><joint name="b" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 .3 0 0" size=".04"/></body>
    </body>
    <body pos="0 -1 0.5"><joint name="c" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 .3 0 0" size=".04"/></body>
    <body pos="1 1 1"><joint name="d" type="ball"/><geom type="capsule" fromto="0 0 0 .3 0 0" size=".04"/></body>
  </worldbody>
  <tendon><fixed name="t" frictionloss="0.2" range="-0.05 0.05" limited="true">
    <joint joint="b" coef="1"/><joint joint="c" coef="-0.5"/></fixed></tendon>
  <equality><joint joint1="b" joint2="c"/></equality>
  <actuator><motor joint="a" gear="3"/><motor joint="b" gear="2"/></actuator>
</mujoco>"""
INTEGRATORS = ("Euler", "implicit", "implicitfast", "RK4")


def zoo(cone="elliptic", integrator="Euler", jacobian="dense"):
    return mujoco.MjModel.from_xml_string(ZOO.format(cone=cone, integrator=integrator, jacobian=jacobian))


def controls(model, step, seed=0):
    return np.random.default_rng([seed, step]).uniform(-1, 1, model.nu)


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
    """Whether each row's state would be the same if J qacc - aref were a little different (mj_constraintUpdate)."""
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
    """States that stiction and MuJoCo's Newton have at equal state along a trajectory: of all rows far from the borders
    of their zones the same ones. Returns how often each state was, and the share of rows that were compared.

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
    # What is around the solve is MuJoCo's own, called in its order; only RK4's sums are formed here.
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


def step_side_by_side(simulation, peer, ctrl):
    """One step of both from the simulation's state; how far apart their positions are then.

    A trajectory apart from each other's would be no test: where bodies lie symmetrically, MuJoCo's collision detection
    chooses contacts by what rounding has left.
    """
    data = simulation.data[0]
    for field in ("qpos", "qvel", "act", "qacc_warmstart"):
        getattr(peer, field)[:] = getattr(data, field)
    peer.time, peer.ctrl[:] = data.time, ctrl
    simulation.step(ctrl[None])
    mujoco.mj_step(simulation.model, peer)
    return np.abs(data.qpos - peer.qpos).max()


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_steps_with_stiction_are_nearly_mj_steps(integrator):
    simulation = stiction.mujoco.BatchedSimulation(zoo(integrator=integrator), 1, tolerance=1e-12)
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


def test_a_warm_start_saves_iterations_and_can_be_reset():
    iterations = {}
    for warm in (0.0, 0.95):
        model = zoo()
        simulation = stiction.mujoco.BatchedSimulation(model, 1, solver="npgs", tolerance=1e-8, warm_start=warm)
        for step in range(30):
            simulation.step(controls(model, 0)[None])
        iterations[warm] = simulation.solver.stats()["iterations"]["p50"]
    assert iterations[0.95] < iterations[0.0]
    again = simulation.status["iterations"][0]
    simulation.forward()
    for drop in (simulation.reset_warm_start, simulation.forget):  # the latter until 1.0
        simulation.forward()
        drop([0])
        simulation.forward()
        assert simulation.status["iterations"][0] >= again


def test_simulations_that_are_not_active_stay_as_they_are():
    model = zoo()
    simulation = stiction.mujoco.BatchedSimulation(model, 3)
    before = simulation.data[1].qpos.copy()
    simulation.step(np.ones((3, model.nu)), nstep=3, active=[True, False, True])
    np.testing.assert_array_equal(simulation.data[1].qpos, before)
    assert simulation.data[1].time == 0 and simulation.data[1].ctrl[0] == 0
    np.testing.assert_array_equal(simulation.data[0].qpos, simulation.data[2].qpos)
    simulation.step(nstep=3)
    assert [data.time for data in simulation.data] == pytest.approx([0.024, 0.012, 0.024])


def test_the_batch_of_the_last_solve_can_be_solved_again():
    model = zoo()
    simulation = stiction.mujoco.BatchedSimulation(model, 2, tolerance=1e-10)
    simulation.step(nstep=20)
    batch = simulation.batch()
    solution = stiction.Solver(solver="newton", tolerance=1e-10).solve(batch)
    assert solution.solved.all()
    np.testing.assert_allclose(solution.velocities, batch.extras["velocities"], atol=1e-6)
    assert stiction.verify(batch, batch.extras["lambda_"])[:, 0].max() < 1e-9


WELD = """
<mujoco><option timestep="0.002"/><worldbody>
  <body name="a" pos="0 0 1"><freejoint/><geom size=".1"/></body>
  <body name="b" pos=".3 0 1"><freejoint/><geom size=".1"/></body>
  <body name="c" pos="0 0 2"><freejoint/><geom size=".1"/></body>
</worldbody><equality>
  <weld body1="a" body2="b"/><connect body1="a" body2="c" anchor="0 0 .5"/><weld body1="c" relpose="0 0 2 1 0 0 0"/>
</equality></mujoco>"""


def test_each_row_of_a_weld_and_of_a_connect_has_an_id_of_its_own():
    simulation = stiction.mujoco.BatchedSimulation(mujoco.MjModel.from_xml_string(WELD), 1, warm_start=1, tolerance=1e-9)
    simulation.step()
    ids = simulation.batch().extras["cone_id"]
    assert len(ids) == 6 + 3 + 6 and len(set(ids.tolist())) == len(ids)


def test_all_rows_of_a_weld_are_warm_started():
    """Where nothing changes, the second solve starts from the answer of the first and has nothing left to do."""
    simulation = stiction.mujoco.BatchedSimulation(mujoco.MjModel.from_xml_string(WELD), 1, warm_start=1, tolerance=1e-7,
                                                   solver="npgs")
    simulation.data[0].qvel[:] = np.linspace(-1, 1, simulation.model.nv)
    simulation.forward()
    cold = int(simulation.status["iterations"][0])
    simulation.forward()
    assert cold > 1 and int(simulation.status["iterations"][0]) == 0


def test_data_may_be_replaced_by_data_of_the_same_model():
    model = zoo()
    simulation = stiction.mujoco.BatchedSimulation(model, 3, warm_start=0.9)
    plain = stiction.mujoco.BatchedSimulation(model, 3, warm_start=0.9)
    for _ in range(20):
        simulation.step()
        plain.step()
    fresh = mujoco.MjData(model)
    simulation.data[1] = fresh
    assert simulation.data[1] is fresh
    del fresh
    gc.collect()
    alone = stiction.mujoco.BatchedSimulation(model, 1, warm_start=0.9)
    for _ in range(20):
        simulation.step()
        plain.step()
        alone.step()
    np.testing.assert_array_equal(simulation.data[1].qpos, alone.data[0].qpos)
    for i in (0, 2):
        np.testing.assert_array_equal(simulation.data[i].qpos, plain.data[i].qpos)


def test_data_that_cannot_be_stepped_is_refused_and_nothing_changes():
    model, other = zoo(), zoo()
    simulation = stiction.mujoco.BatchedSimulation(model, 2)
    kept = list(simulation.data)
    for place, wrong, error, message in (
            (0, mujoco.MjData(other), ValueError, r"data\[0\]: expected data of this simulation's model"),
            (0, simulation.data[1], ValueError, r"data\[0\]: expected data of its own, got that of simulation 1"),
            (1, None, TypeError, r"data\[1\]: expected a mujoco.MjData, got NoneType"),
            (2, mujoco.MjData(model), IndexError, r"expected a simulation in 0..1, got 2"),
            (slice(0, 2), kept, TypeError, "expected one simulation at a time")):
        with pytest.raises(error, match=message):
            simulation.data[place] = wrong
    assert all(one is before for one, before in zip(simulation.data, kept))
    with pytest.raises(AttributeError):
        simulation.data = kept
    with pytest.raises(AttributeError):
        simulation.model = other
    one = mujoco.MjData(model)
    with pytest.raises(ValueError, match=r"data\[1\]: expected data of its own"):
        stiction.mujoco.BatchedSimulation(model, [one, one])
    with pytest.raises(ValueError, match=r"data\[0\]: expected data of this simulation's model"):
        stiction.mujoco.gather(model, [mujoco.MjData(other)])
    simulation.step()


def test_a_model_without_constraints_falls():
    model = mujoco.MjModel.from_xml_string(
        "<mujoco><worldbody><body><freejoint/><geom size='.1'/></body></worldbody></mujoco>")
    simulation = stiction.mujoco.BatchedSimulation(model, 2)
    simulation.step(nstep=10)
    assert simulation.data[1].qacc[2] == pytest.approx(-9.81)
    assert simulation.solver.stats()["codes"] == {"solved": 20}


def test_options_of_the_model_may_change_between_steps():
    # Only a time step that is read anew has the same clock and the same fall.
    simulation = stiction.mujoco.BatchedSimulation(zoo(integrator="RK4"), 1, tolerance=1e-12)
    peer = mujoco.MjData(simulation.model)
    for step, (timestep, jacobian) in enumerate(((0.004, 0), (0.002, 1), (0.002, 0), (0.003, 1))):
        simulation.model.opt.timestep, simulation.model.opt.jacobian = timestep, jacobian
        for _ in range(5):
            assert step_side_by_side(simulation, peer, controls(simulation.model, step)) < 1e-11
    assert simulation.data[0].time == pytest.approx(0.055) == peer.time


def test_a_solver_of_the_callers_counts():
    solver = stiction.Solver(solver="npgs", tolerance=1e-5)
    simulation = stiction.mujoco.BatchedSimulation(zoo(), 2, solver=solver)
    simulation.step(nstep=4)
    assert solver.stats()["environments"] == 8


@pytest.mark.parametrize("change, message", [
    (lambda opt: setattr(opt, "integrator", mujoco.mjtIntegrator.mjINT_DISCRETE), "got discrete"),
    (lambda opt: setattr(opt, "noslip_iterations", 3), "noslip_iterations: expected 0, got 3"),
    (lambda opt: setattr(opt, "enableflags", int(mujoco.mjtEnableBit.mjENBL_SLEEP)), "mjENBL_SLEEP"),
])
def test_what_would_be_stepped_otherwise_is_refused(change, message):
    model = zoo()
    change(model.opt)
    with pytest.raises(ValueError, match=message):
        stiction.mujoco.BatchedSimulation(model, 1)


def test_other_mistakes():
    model = zoo()
    with pytest.raises(ValueError, match="n: expected at least one simulation, got 0"):
        stiction.mujoco.BatchedSimulation(model, 0)
    with pytest.raises(ValueError, match="solver: expected one on cpu"):
        stiction.mujoco.BatchedSimulation(model, 1, solver=stiction.Solver(device="emulated"))
    simulation = stiction.mujoco.BatchedSimulation(model, 2)
    with pytest.raises(ValueError, match=r"ctrl: expected \(2, 2\), got \(2,\)"):
        simulation.step(np.zeros(2))
    with pytest.raises(ValueError, match=r"active: expected bool \(2,\), got \(3,\)"):
        simulation.step(active=[True] * 3)
    mujoco.set_mjcb_control(lambda m, d: None)
    try:
        with pytest.raises(ValueError, match="mjcb_control: expected no callback"):
            simulation.step()
    finally:
        mujoco.set_mjcb_control(None)


def test_a_description_that_is_wrong_is_noticed(monkeypatch):
    structs = _mujoco_layout.structs
    fields = structs.STRUCTS["mjData"].fields
    monkeypatch.setattr(_mujoco_layout, "_known", {})
    monkeypatch.setitem(structs.STRUCTS, "mjData",
                        type("Shifted", (), {"fields": tuple(f for f in fields if f.name != "act")}))
    with pytest.raises(stiction.mujoco.LayoutError, match="is not"):
        model = zoo()
        _mujoco_layout.layout(model, mujoco.MjData(model))
