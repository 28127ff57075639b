"""stiction as MuJoCo Warp's constraint solver: its rows as they are, and answers as MuJoCo has them in double."""

import pathlib
import runpy

import numpy as np
import pytest
from conftest import ROOT

from mujoco_warp_worlds import (CREEPING, controls, dense_rows, disturbed, mujoco, mujoco_warp, numbers, worlds_of, wp,
                                zoo, zoo_worlds)
from mujoco_warp._src import solver as theirs
from mujoco_warp._src import types

import stiction
import stiction.mujoco_warp as drop_in

pytestmark = pytest.mark.warp
CONES, JACOBIANS = ("pyramidal", "elliptic"), ("dense", "sparse")
DROPPED = 1 << stiction.FLAGS.index("contacts_dropped")


def compare(datas, m, d, limit, ties):
    """One solve of the worlds beside MuJoCo Warp's own and MuJoCo's. limit: on accelerations, by their largest. ties:
    share of rows that may be so near to the border of a zone that their state is another one's."""
    mujoco_warp.forward(m, d)
    names = ("qacc", "qfrc_constraint", "force", "Ma", "state", "nefc")
    their_qacc, _, their_force, their_Ma, their_state, nefc = numbers(d, *names)
    d.qacc.fill_(np.nan)
    d.efc.force.fill_(np.nan)
    solution = drop_in.solve(m, d)
    assert solution.solved.all(), solution.status
    qacc, qfrc, force, Ma, state, _ = numbers(d, *names)
    for world, data in enumerate(datas):
        n, scale = data.nefc, max(1.0, np.abs(data.qacc).max())
        assert nefc[world] == n
        assert np.abs(qacc[world] - data.qacc).max() <= limit * scale
        assert np.abs(qacc[world] - their_qacc[world]).max() <= limit * scale
        for ours, expected in ((qfrc[world], data.qfrc_constraint), (force[world, :n], their_force[world, :n]),
                               (Ma[world], their_Ma[world])):
            np.testing.assert_allclose(ours, expected, rtol=0, atol=5 * limit * np.abs(expected).max(initial=0))
        assert (state[world, :n] != their_state[world, :n]).sum() <= ties * n
    return solution


@pytest.mark.parametrize("cone, jacobian", [pytest.param("elliptic", "dense", marks=pytest.mark.quick),
                                            ("elliptic", "sparse"), ("pyramidal", "dense"), ("pyramidal", "sparse")])
def test_answers_are_those_of_mujoco_and_of_its_warp(cone, jacobian):
    model, datas, m, d = zoo_worlds(cone, jacobian)
    # float32: numbers are rounded by 6e-8 of their size, and the terms of qacc are several times qacc.
    solution = compare(datas, m, d, 4e-6, 0)
    types_seen = np.unique(d.efc.type.numpy()[0, :datas[0].nefc])
    assert set(types_seen) == {0, 1, 2, 3, 4, 5, 6 if cone == "pyramidal" else 7}
    states_seen = np.unique(d.efc.state.numpy()[:, :min(data.nefc for data in datas)])
    assert set(states_seen) >= ({1, 2, 3, 4} if cone == "elliptic" else {0, 1, 2, 3})
    batch = drop_in.solution_of(d)._batch
    assert (stiction.verify(batch, solution)[:, 0] < 5e-6).all()
    if jacobian == "dense":
        assert batch.arrays["J"] is d.efc.J  # read where it lies


@pytest.mark.parametrize("cone", CONES)
@pytest.mark.parametrize("name", ["ant", "humanoid"])
def test_gymnasiums_models(name, cone):
    gymnasium = pytest.importorskip("gymnasium", reason="Gymnasium's models are NOT tested: pip install gymnasium")
    path = pathlib.Path(gymnasium.__file__).parent / "envs" / "mujoco" / "assets" / f"{name}.xml"
    model = mujoco.MjModel.from_xml_path(str(path))
    model.opt.cone = getattr(mujoco.mjtCone, f"mjCONE_{cone.upper()}")
    model.opt.solver, model.opt.tolerance, model.opt.iterations = mujoco.mjtSolver.mjSOL_NEWTON, 0, 100
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_EULER
    datas = [disturbed(model, seed, steps=150) for seed in range(3)]
    assert any(data.nefc for data in datas)
    # A humanoid's limbs weigh a tenth of a per cent of it: its J and M round worse.
    compare(datas, *worlds_of(model, datas, njmax=96, nconmax=48), 1e-5, 0.05)


@pytest.mark.parametrize("integrator", ["Euler", "implicit", "implicitfast", "RK4", "discrete"])
@pytest.mark.parametrize("cone", CONES)
def test_steps_are_those_of_mujoco_warp(cone, integrator):
    model, _, m, d = zoo_worlds(cone, count=2, integrator=integrator)
    _, _, _, peer = zoo_worlds(cone, count=2, integrator=integrator)
    for step in range(15):
        ctrl = np.tile(controls(model, step), (2, 1)).astype(np.float32)
        for name in ("qpos", "qvel", "qacc_warmstart", "time"):
            wp.copy(getattr(peer, name), getattr(d, name))
        for one in (d, peer):
            one.ctrl.assign(ctrl)
        mujoco_warp.step(m, peer)
        solution = drop_in.step(m, d)
        assert (solution.residual < 1e-5).all()
        for name, limit in (("qpos", 2e-6), ("qvel", 2e-4)):  # velocities of up to 20; dt times 4e-6 of 200 m/s2
            ours, their = numbers(d, name)[0], numbers(peer, name)[0]
            assert np.abs(ours - their).max() <= limit, (name, step)
    assert not np.array_equal(ours, their)  # another solver's


def test_it_can_take_the_solvers_place():
    _, _, m, d = zoo_worlds()
    _, _, _, peer = zoo_worlds()
    own = theirs.solve
    with drop_in.replaces_solver():
        assert theirs.solve is not own
        mujoco_warp.step(m, d)
    drop_in.step(m, peer)
    assert numbers(d, "qpos")[0].tobytes() == numbers(peer, "qpos")[0].tobytes()
    assert drop_in.solution_of(d).solved.all() and drop_in.solution_of(peer).solved.all()
    with pytest.raises(KeyError), drop_in.replaces_solver():
        raise KeyError
    assert theirs.solve is own
    _, _, _, other = zoo_worlds()
    assert drop_in.solution_of(other) is None


def solved(m, d, **options):
    mujoco_warp.forward(m, d)
    solution = drop_in.solve(m, d, **options)
    return solution, numbers(d, "qacc", "force", "qfrc_constraint", "nefc")


@pytest.mark.parametrize("jacobian", JACOBIANS)
def test_worlds_in_another_order_have_the_same_bits(jacobian):
    model = zoo(jacobian=jacobian)
    datas = [disturbed(model, seed, steps=10 + 7 * seed) for seed in range(5)]
    order = [3, 0, 4, 2, 1]
    first, (qacc, force, qfrc, nefc) = solved(*worlds_of(model, datas))
    second, (qacc2, force2, qfrc2, _) = solved(*worlds_of(model, [datas[i] for i in order]))
    assert len(set(nefc.tolist())) > 1
    assert qacc[order].tobytes() == qacc2.tobytes() and qfrc[order].tobytes() == qfrc2.tobytes()
    for there, here in enumerate(order):
        assert force[here, :nefc[here]].tobytes() == force2[there, :nefc[here]].tobytes()
    assert np.array_equal(first.status[order], second.status)


@pytest.mark.quick
def test_one_world_of_nan_harms_no_other():
    model = zoo()
    datas = [disturbed(model, seed) for seed in range(4)]
    clean, (qacc, force, _, nefc) = solved(*worlds_of(model, datas))
    m, d = worlds_of(model, datas)
    qvel = d.qvel.numpy()
    qvel[2, 4] = np.nan
    d.qvel.assign(qvel)
    dirty, (qacc2, force2, qfrc2, _) = solved(m, d)
    codes = [stiction.CODES[code] for code in dirty.status["code"]]
    assert codes == ["solved", "solved", "invalid_input", "solved"]
    assert dirty.status["flags"][2] & 1 << stiction.FLAGS.index("non_finite_input")
    others = [0, 1, 3]
    assert qacc[others].tobytes() == qacc2[others].tobytes()
    for world in others:
        assert force[world, :nefc[world]].tobytes() == force2[world, :nefc[world]].tobytes()
    assert (force2[2, :nefc[2]] == 0).all() and (qfrc2[2] == 0).all()


def test_the_emulated_device_has_the_same_bits():
    model, _, m, d = zoo_worlds("pyramidal", "sparse")
    first, answer = solved(m, d)
    second, again = solved(m, d, device="emulated")
    for name, one, other in zip(("qacc", "force", "qfrc_constraint"), answer, again):
        assert one.tobytes() == other.tobytes(), name
    assert np.array_equal(first.status, second.status)
    assert drop_in._solver_of(m, d, {"device": "emulated"}).solver.device == "emulated"


def answer_to(model, d, rows):
    """Accelerations of world 0 with its first rows alone, by a solve in double of copies."""
    J, M = dense_rows(model, d, 0)
    kind, ids = d.efc.type.numpy()[0, :rows], d.efc.id.numpy()[0, :rows]
    R, aref, loss = (getattr(d.efc, name).numpy()[0, :rows].astype(float) for name in ("D", "aref", "frictionloss"))
    address, dim, friction = (getattr(d.contact, name).numpy() for name in ("efc_address", "dim", "friction"))
    cones, mu, bound = [], np.zeros(rows), np.where(np.isin(kind, (1, 2)), loss, 0)
    for row in range(rows):
        name = {0: "free", 1: "box", 2: "box"}.get(kind[row], "unilateral")
        if kind[row] == 7:
            first = address[ids[row], 0]
            mu[row] = 0 if row == first else friction[ids[row], row - first - 1]
            name = ("friction", int(dim[ids[row]])) if row == first else None
        cones += [name] if name else []
    batch = stiction.Batch.from_jacobian(
        [J[:rows]], [M], [d.qacc_smooth.numpy()[0].astype(float)], [aref], cones=[cones], mu=[mu], R=[1 / R],
        lo=[-bound], hi=[bound])
    return stiction.Solver(tolerance=1e-12).solve(batch).velocities


@pytest.mark.parametrize("cone", CONES)
def test_rows_without_room_are_flagged_and_the_rest_is_solved(cone):
    model = zoo(cone)
    settled, airborne = disturbed(model, 0), mujoco.MjData(model)
    airborne.qpos[[2, 9, 16, 23]] += 2, 3, 2, 2
    mujoco.mj_forward(model, airborne)
    m, d = worlds_of(model, [settled, airborne])
    mujoco_warp.forward(m, d)
    contacts = sorted((row, dim) for row, dim, world in zip(d.contact.efc_address.numpy()[:, 0], d.contact.dim.numpy(),
                                                            d.contact.worldid.numpy()) if world == 0 and dim > 1)
    first, dim = contacts[-2]
    size = dim if cone == "elliptic" else 2 * (dim - 1)
    room = int(first + size - 1)  # this contact is cut by the room, and the last one is beyond it
    expected = answer_to(model, d, first)
    m, d = worlds_of(model, [settled, airborne], njmax=room)
    solution, (qacc, force, _, nefc) = solved(m, d)
    assert nefc[0] == settled.nefc > room and nefc[1] == airborne.nefc <= room
    assert [bool(flags & DROPPED) for flags in solution.status["flags"]] == [True, False]
    assert solution.solved.all()
    assert drop_in.solution_of(d)._batch.rows_of(0) == (0, slice(0, first))
    assert (force[0, first:room] == 0).all() and (force[0, :first] != 0).any()
    np.testing.assert_allclose(qacc[1], airborne.qacc, rtol=0, atol=4e-6 * np.abs(airborne.qacc).max())
    np.testing.assert_allclose(qacc[0], expected, rtol=0, atol=4e-6 * np.abs(expected).max())
    assert np.abs(qacc[0] - settled.qacc).max() > 1e-2 * np.abs(settled.qacc).max()


def test_contacts_without_room_are_flagged():
    _, _, m, d = zoo_worlds(nconmax=4, count=2)
    solution, _ = solved(m, d)
    assert d.nacon.numpy()[0] > d.naconmax
    assert (solution.status["flags"] & DROPPED != 0).all()
    _, _, m, d = zoo_worlds(count=2)
    d.overflow.fill_(int(types.OverflowType.NJMAX_NNZ))
    assert (solved(m, d)[0].status["flags"] & DROPPED != 0).all()


@pytest.mark.quick
def test_what_ends_at_the_limit_says_so():
    _, _, m, d = zoo_worlds()
    solution, _ = solved(m, d, solver="pgs", tolerance=1e-6, max_iterations=2)
    assert {stiction.CODES[code] for code in solution.status["code"]} == {"max_iterations"}
    assert not solution.solved.any() and (solution.residual > 1e-6).all()
    assert (d.solver_niter.numpy() == 2).all()
    assert (d.overflow.numpy() & int(types.OverflowType.ITERATIONS) != 0).all()
    d.overflow.zero_()
    solved(m, d, tolerance=1e-5)
    assert (d.overflow.numpy() == 0).all() and (d.solver_niter.numpy() > 0).all()


@pytest.mark.quick
def test_solves_start_from_qacc_warmstart():
    _, _, m, d = zoo_worlds()
    solved(m, d)
    wp.copy(d.qacc_warmstart, d.qacc)
    assert (drop_in.solve(m, d, tolerance=1e-4).iterations == 0).all()
    m.opt.disableflags |= int(types.DisableBit.WARMSTART)
    assert (drop_in.solve(m, d, tolerance=1e-4).iterations > 0).all()


def test_no_memory_is_taken_in_a_solve(monkeypatch):
    _, _, m, d = zoo_worlds()
    m.opt.noslip_iterations = 5
    solved(m, d)
    taken = []
    for name in ("empty", "zeros", "full", "clone", "from_numpy"):
        own = getattr(wp, name)
        monkeypatch.setattr(wp, name, lambda *a, own=own, name=name, **k: taken.append((name, a)) or own(*a, **k))
    first = drop_in.solve(m, d)
    assert [call for call in taken if call != ("empty", (0,))] == []  # an array of nothing, in MuJoCo Warp's mul_m
    assert drop_in.solve(m, d) is first


def test_data_with_other_memory_is_read_anew():
    _, _, m, d = zoo_worlds()
    solved(m, d)
    qacc = numbers(d, "qacc")[0]
    d.qacc = wp.zeros_like(d.qacc)
    drop_in.solve(m, d)
    assert numbers(d, "qacc")[0].tobytes() == qacc.tobytes()


# -- sleep, discrete, what is refused ---------------------------------------------------------------------------------

SLEEPERS = """
<mujoco><option timestep="0.004" cone="{cone}" jacobian="{jacobian}" integrator="{integrator}">
<flag sleep="enable"/></option>
<worldbody><geom type="plane" size="5 5 1"/>
  <body pos="0 0 .1"><freejoint/><geom type="box" size=".1 .1 .1"/></body>
  <body pos="1 0 1.5"><freejoint/><geom type="box" size=".1 .1 .1"/></body>
  <body pos="-1 0 .5"><joint axis="0 1 0"/><geom type="capsule" fromto="0 0 0 .3 0 0" size=".04"/></body>
  <body pos="-2 0 .5"><joint axis="0 1 0" range="-90 0" limited="true" damping="2"/>
    <geom type="capsule" fromto="0 0 0 .1 0 0" size=".04"/></body>
</worldbody></mujoco>"""


@pytest.mark.parametrize("integrator", ["Euler", "discrete"])
@pytest.mark.parametrize("cone, jacobian", [("pyramidal", "sparse"), ("elliptic", "dense")])
def test_what_sleeps_is_not_moved(cone, jacobian, integrator):
    """Trees fall asleep when MuJoCo's do. Beside MuJoCo Warp's solver where J is dense. With a sparse one, its version
    4.0.0 has NaN in its first step at times, on the CPU."""
    model = mujoco.MjModel.from_xml_string(SLEEPERS.format(cone=cone, jacobian=jacobian, integrator=integrator))
    start = [disturbed(model, 0, steps=0, speed=0)] * 2
    m, d = worlds_of(model, start, njmax=48, nconmax=16)
    _, peer = worlds_of(model, start, njmax=48, nconmax=16)
    peers, data, slept, rested = [], mujoco.MjData(model), 0, 0
    for _ in range(75):
        mujoco.mj_step(model, data)
        peers.append(data.tree_awake.tolist())
    for step in range(75):
        before = numbers(d, "qpos", "tree_awake")
        if jacobian == "dense":
            for name in ("qpos", "qvel", "qacc_warmstart"):
                wp.copy(getattr(peer, name), getattr(d, name))
            mujoco_warp.step(m, peer)
        drop_in.step(m, d)
        awake = numbers(d, "tree_awake")[0]
        assert awake[0].tolist() == awake[1].tolist()
        if peers[max(step - 8, 0)] == peers[min(step + 8, 74)]:  # not about to fall asleep
            assert awake[0].tolist() == peers[step], step
        if jacobian == "dense":
            np.testing.assert_array_equal(awake, numbers(peer, "tree_awake")[0])
            np.testing.assert_allclose(numbers(d, "qvel")[0], numbers(peer, "qvel")[0], rtol=0, atol=1e-4)
        assert np.isfinite(numbers(d, "qvel")[0]).all()
        if not before[1][0, 0] and not awake[0, 0]:  # the box on the floor, while the other falls beside it
            slept += 1
            assert numbers(d, "qpos")[0][:, :7].tobytes() == before[0][:, :7].tobytes()
            assert (numbers(d, "qacc")[0][:, :6] == 0).all() and (numbers(d, "qfrc_constraint")[0][:, :6] == 0).all()
            mass = np.tril(drop_in.solution_of(d)._batch.arrays["M"].numpy()[0])
            np.testing.assert_array_equal(mass[:6], np.eye(6, model.nv))  # alone, with a mass of 1
        rested += not before[1][0, 3] and not awake[0, 3]
    assert slept > 20 and rested > 10 and awake[0].tolist() == [0, 1, 1, 0]
    with drop_in.replaces_solver():
        mujoco_warp.forward(m, d)  # a step ends by zeros for sleeping bodies
    assert d.nl.numpy()[0] == 1  # a row of the arm that sleeps on its limit
    for name in ("qacc", "qfrc_constraint"):
        assert (numbers(d, name)[0][:, [0, 1, 2, 3, 4, 5, -1]] == 0).all(), name


def test_what_would_be_solved_otherwise_is_refused():
    model, _, m, d = zoo_worlds(count=1, integrator="discrete")
    with pytest.raises(ValueError, match="model.opt.integrator: expected another one with noslip, got discrete"):
        drop_in.noslip(m, d)
    with pytest.raises(TypeError, match="model: expected a mujoco_warp.Model .*put_model.*, got MjModel"):
        drop_in.solve(model, d)
    with pytest.raises(TypeError, match="data: expected a mujoco_warp.Data .*put_data.*, got MjData"):
        drop_in.solve(m, mujoco.MjData(model))
    m.opt.run_qacc_smooth = False
    with pytest.raises(ValueError, match="run_qacc_smooth: expected True, got False"):
        drop_in.solve(m, d)


@pytest.mark.parametrize("height", [0.0999, 2], ids=["rows", "no rows"])
@pytest.mark.parametrize("dof", [0, 7])
def test_a_world_whose_motion_is_no_number_is_not_solved(height, dof):
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><worldbody><geom type="plane" size="5 5 1"/><body pos="0 0 {height}"><freejoint/>'
        '<geom type="box" size=".1 .1 .1"/></body><body pos="0 3 2"><freejoint/><geom size=".1"/></body></worldbody></mujoco>')
    m, d = worlds_of(model, [disturbed(model, 0, steps=0, speed=0)] * 3)
    qvel = np.zeros((3, model.nv), np.float32)
    qvel[1, dof] = np.nan
    d.qvel.assign(qvel)
    mujoco_warp.forward(m, d)
    solution = drop_in.solve(m, d)
    assert (d.nefc.numpy() > 0).all() == (height < 1)
    assert solution.solved.tolist() == [True, False, True]
    if height == 2:
        assert stiction.CODES[solution.status["code"][1]] == "numerical"


def test_a_model_without_room_for_rows_moves_freely():
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><option><flag contact="disable"/></option><worldbody><body><freejoint/><geom size=".1"/></body>'
        "</worldbody></mujoco>")
    data = disturbed(model, 0, steps=1)
    m, d = worlds_of(model, [data], njmax=0, nconmax=0)
    mujoco_warp.forward(m, d)
    d.qacc.zero_()
    assert drop_in.solve(m, d) is None and drop_in.noslip(m, d) is None
    np.testing.assert_allclose(numbers(d, "qacc")[0][0], data.qacc, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("room, dropped", [("32", 0), ("8", 1)])
def test_the_example_runs(room, dropped, monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["12_mujoco_warp.py", "--worlds", "3", "--njmax", room])
    runpy.run_path(str(ROOT / "examples" / "python" / "12_mujoco_warp.py"), run_name="__main__")
    lines = [line for line in capsys.readouterr().out.splitlines() if " solved " in line]
    assert len(lines) == 3 and sum("contacts_dropped" in line for line in lines) == dropped


def test_the_page_s_first_lines_run(tmp_path, monkeypatch):
    (tmp_path / "robot.xml").write_text(CREEPING.format(cone="elliptic", jacobian="dense"), encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    page = (ROOT / "docs" / "howto" / "mujoco_warp.md").read_text(encoding="utf-8")
    block = page.partition("```python\n")[2].partition("```")[0].replace("4096", "4").replace("1000", "5")
    names = {}
    exec(compile(block, "docs/howto/mujoco_warp.md", "exec"), names)
    assert names["solution"].solved.all() and (names["d"].time.numpy() > 0).all()
