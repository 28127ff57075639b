"""Simulations inside MuJoCo over their life: warm starts, data and options that change, and mistakes."""

import gc

import numpy as np
import pytest

mujoco = pytest.importorskip("mujoco", reason="stiction.mujoco is NOT tested: pip install mujoco")

import stiction  # noqa: E402
import stiction.mujoco  # noqa: E402
from mujoco_zoo import controls, disturb, step_side_by_side, zoo  # noqa: E402
from stiction.mujoco import memory_layout  # noqa: E402


def test_a_warm_start_saves_iterations_and_can_be_reset():
    iterations = {}
    for warm in (0.0, 0.95):
        model = zoo()
        simulation = stiction.mujoco.BatchedSimulation(model, 1, solver="npgs", tolerance=1e-8, warm_start=warm)
        for step in range(30):
            simulation.step(controls(model, 0)[None])
        iterations[warm] = simulation.solver.stats()["iterations"]["p50"]
    assert iterations[0.95] < iterations[0.0]
    simulation.forward()
    simulation.forward()
    warm = int(simulation.status["iterations"][0])
    simulation.reset_warm_start([0])
    simulation.forward()
    assert int(simulation.status["iterations"][0]) > warm


def test_solves_start_from_qacc_warmstart():
    """No iteration is left if that is the answer."""
    model = zoo()
    exact = stiction.mujoco.BatchedSimulation(model, 1, tolerance=1e-12)
    exact.step(controls(model, 0)[None], nstep=30)
    exact.forward()
    data = exact.data[0]
    data.qacc_warmstart[:] = data.qacc
    iterations = {}
    for warm in (0.0, 0.95):
        simulation = stiction.mujoco.BatchedSimulation(model, [data], tolerance=1e-6, warm_start=warm)
        simulation.forward()
        assert "velocity_newton" in simulation.solver.stats()["solvers"]
        iterations[warm] = int(simulation.status["iterations"][0])
    assert iterations == {0.0: pytest.approx(2, abs=1), 0.95: 0}


def test_what_mjdata_holds_is_all_that_a_step_starts_from():
    """A copy of a simulation goes on as the simulation does, and a reset one as a new one: nothing is stored elsewhere."""
    model = zoo()
    simulation = stiction.mujoco.BatchedSimulation(model, 2)
    simulation.step(nstep=20)
    copy = mujoco.MjData(model)
    mujoco.mj_copyData(copy, model, simulation.data[1])
    other = stiction.mujoco.BatchedSimulation(model, [copy])
    simulation.reset([0])
    simulation.step(nstep=20)
    other.step(nstep=20)
    np.testing.assert_array_equal(simulation.data[1].qpos, other.data[0].qpos)
    fresh = stiction.mujoco.BatchedSimulation(model, 1)
    fresh.step(nstep=20)
    np.testing.assert_array_equal(simulation.data[0].qpos, fresh.data[0].qpos)
    # As after mj_resetData, accelerations to start from are zero where only they are dropped.
    simulation.data[0].qacc_warmstart[:] = np.nan
    simulation.reset_warm_start([0])
    simulation.forward()
    assert simulation.status["flags"][0] == 0
    simulation.forward()
    assert simulation.status["flags"][0] == 1 << stiction.FLAGS.index("warm_start_rejected")
    assert (simulation.status["code"] == 0).all()


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
    """If nothing changes, the second solve starts from the answer of the first and has nothing left to do."""
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
    disturb(simulation)
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


def test_noslip_is_refused():
    model = zoo()
    model.opt.noslip_iterations = 3
    with pytest.raises(ValueError, match="noslip_iterations: expected 0, got 3"):
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
    structs = memory_layout.structs
    fields = structs.STRUCTS["mjData"].fields
    monkeypatch.setattr(memory_layout, "_known", {})
    monkeypatch.setitem(structs.STRUCTS, "mjData",
                        type("Shifted", (), {"fields": tuple(f for f in fields if f.name != "act")}))
    with pytest.raises(stiction.mujoco.LayoutError, match="is not"):
        model = zoo()
        memory_layout.layout(model, mujoco.MjData(model))


@pytest.mark.parametrize("accuracy, said", [
    ({"tolerance": float("nan")}, "tolerance: expected a finite number >= 0, got nan"),
    ({"tolerance": [1e-6, -1.0]}, r"tolerance\[1\]: expected a finite number >= 0, got -1"),
    ({"tolerance": [1e-6, 1e-6, 1e-6]}, r"tolerance: expected one number or one for each of 2 environments, got \(3,\)"),
    ({"max_iterations": 1.5}, "max_iterations: expected an integer from 0 to 2147483647, got 1.5"),
    ({"max_iterations": -1}, "max_iterations: .*got -1"),
    ({"max_iterations": 2**31}, "max_iterations: .*got 2147483648"),
])
def test_an_accuracy_that_is_none_is_refused_and_changes_nothing(accuracy, said):
    simulation = stiction.mujoco.BatchedSimulation(zoo(), 2, solver="npgs")
    simulation.set_accuracy(max_iterations=3, tolerance=0.0)
    with pytest.raises(ValueError, match=said):
        simulation.set_accuracy(**accuracy)
    simulation.step(nstep=20)
    assert (simulation.status["iterations"] == 3).all()


def test_a_simulation_does_not_notice_in_which_chunk_it_is():
    """One thread steps a chunk at a time. Simulations of the second have their own limits, and their bits."""
    model = zoo()
    chunk = stiction.mujoco.BatchedSimulation(model, 64, threads=1)._core.chunk_size()
    n = chunk + 3
    rng = np.random.default_rng(3)
    many = stiction.mujoco.BatchedSimulation(model, n, threads=1)
    assert many._core.chunk_size() == chunk
    many.data[chunk + 1] = mujoco.MjData(model)
    ctrl = rng.uniform(-1, 1, (12, n, model.nu))
    active = rng.random((12, n)) < 0.8
    limits = np.where(np.arange(n) == chunk, 0, 1000)
    many.set_accuracy(max_iterations=limits)
    for values, mask in zip(ctrl, active):
        many.step(values, nstep=2, active=mask)
    for i in (0, chunk - 1, chunk, chunk + 1, chunk + 2):
        alone = stiction.mujoco.BatchedSimulation(model, 1)
        alone.set_accuracy(max_iterations=limits[i])
        for values, mask in zip(ctrl[:, i:i + 1], active[:, i:i + 1]):
            alone.step(values, nstep=2, active=mask)
        for name in ("qpos", "qvel", "qacc", "efc_force", "ctrl"):
            np.testing.assert_array_equal(getattr(many.data[i], name), getattr(alone.data[0], name), err_msg=f"{i} {name}")
        assert many.status[i] == alone.status[0]
    assert many.solver.stats()["environments"] == 24 * n
    rows = [data.nefc for data in many.data]
    many.forward()
    batch = many.batch()
    np.testing.assert_array_equal(np.diff(batch.arrays["offsets"]), [data.nefc for data in many.data])
    np.testing.assert_array_equal(batch.extras["lambda_"], np.concatenate([data.efc_force for data in many.data]))
    assert len(set(rows)) > 1


def test_an_array_of_all_simulations_is_read_at_once():
    model = zoo()
    simulation = stiction.mujoco.BatchedSimulation(model, 18, threads=1)
    simulation.step(np.random.default_rng(0).uniform(-1, 1, (18, model.nu)), nstep=4)
    simulation.data[17] = mujoco.MjData(model)
    for name in ("qpos", "xpos", "cfrc_ext", "act"):
        expected = np.stack([getattr(data, name) for data in simulation.data])
        found = simulation.read(name)
        assert found.shape == expected.shape
        np.testing.assert_array_equal(found, expected)
    for name in ("efc_force", "contact", "ncon", "efc_type", "nothing"):
        with pytest.raises(ValueError, match=f"name: expected an array of numbers .* got '{name}'"):
            simulation.read(name)


def test_a_callback_is_called_after_every_solve_and_changes_no_bit():
    model, called = zoo(integrator="RK4"), []
    counted = stiction.mujoco.BatchedSimulation(model, 2, solver=stiction.Solver(tolerance=1e-6, callback=called.append))
    plain = stiction.mujoco.BatchedSimulation(model, 2)
    for simulation in (counted, plain):
        simulation.step(np.ones((2, model.nu)), nstep=3)
        assert simulation.solver.stats()["solves"] == 12 and simulation.solver.stats()["environments"] == 24
    assert len(called) == 12 and all(one["environments"] == 2 for one in called)
    np.testing.assert_array_equal(counted.data[1].qpos, plain.data[1].qpos)


# A coupling whose compliance is far below the inertia that it sees, as those of drawers, doors and knobs are.
COUPLED = """
<mujoco><option timestep="0.002" gravity="0 0 0"/><worldbody>
  <body><joint name="a" axis="0 0 1"/><geom size=".1" pos=".3 0 0"/></body>
  <body pos="0 0 1"><joint name="b" axis="0 0 1"/><geom size=".1" pos=".3 0 0"/></body>
</worldbody><equality><joint joint1="a" joint2="b" solimp="{impedance} {impedance}"/></equality></mujoco>"""


@pytest.mark.parametrize("impedance", [0.9, 0.9999])
def test_a_coupling_of_small_compliance_is_one_step(impedance):
    """An equality has no zone to leave, so that the problem is linear, whatever its compliance."""
    model = mujoco.MjModel.from_xml_string(COUPLED.format(impedance=impedance))
    model.opt.tolerance = 0
    model.dof_invweight0[:] *= 0.3  # MuJoCo's estimate of the coupling's response
    simulation = stiction.mujoco.BatchedSimulation(model, 1, tolerance=1e-9, warm_start=0)
    data, peer = simulation.data[0], mujoco.MjData(model)
    for one in (data, peer):
        one.qpos[:], one.qvel[:], one.qfrc_applied[:] = [0.1, -0.1], [1, -2], [3, 4]
    simulation.forward()
    mujoco.mj_forward(model, peer)
    diagonal = (peer.efc_J.reshape(1, 2) @ np.linalg.solve(np.diag(peer.M), peer.efc_J.reshape(2, 1))).item()
    assert peer.efc_R[0] / diagonal == pytest.approx(0.3 * (1 - impedance) / impedance)
    assert simulation.status["iterations"][0] == 1
    np.testing.assert_allclose(data.qacc, peer.qacc, rtol=1e-9)
    np.testing.assert_allclose(data.efc_force, peer.efc_force, rtol=1e-9)
