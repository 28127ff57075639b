"""Worlds of stiction.newton apart from each other, their records, warm starts, and refusals."""

import dataclasses
import re
import runpy
import sys
import types

import numpy as np
import pytest
from conftest import ROOT
from newton_scenes import Run, SolverStiction, box, hinge, newton, on_ground, pile, rod, wp

import stiction
from stiction.testing import assert_permutation_invariant

pytestmark = pytest.mark.warp
G = 9.81

# -- worlds -----------------------------------------------------------------------------------------------------------

@pytest.mark.quick
def test_a_worlds_bits_are_its_own():
    order = np.array([3, 0, 4, 1, 2])
    straight = Run(pile(np.arange(5))).step(60, 0.005).q.reshape(5, -1)
    mixed = Run(pile(order), threads=2).step(60, 0.005).q.reshape(5, -1)
    alone = Run(pile([3])).step(60, 0.005).q.reshape(1, -1)
    assert mixed.tobytes() == straight[order].tobytes() and alone.tobytes() == straight[3].tobytes()
    assert len({row.tobytes() for row in straight}) == 5


def test_worlds_of_different_sizes_step_together():
    def add(builder, world):
        if world == 1:
            builder.add_shape_sphere(-1, radius=0.1)  # nothing in it that moves
            return
        for level in range(world + 1):
            box(height=0.1 + 0.3 * level)(builder, world)
        if world == 2:  # and articulations of another size
            rod(builder, "revolute", axis=(1, 0, 0))
    run = Run(on_ground(add, 4)).step(100, 0.005)
    assert run.solver.status.shape == (4,) and not run.solver.status["code"].any() and not run.solver.failed.size
    heights = run.state.body_q.numpy()[:, 2]
    worlds = run.model.body_world.numpy()
    np.testing.assert_allclose(heights[worlds == 0], [0.1], atol=1e-5)
    np.testing.assert_allclose(heights[worlds == 2], [0.1, 0.3, 0.5, 0], atol=1e-4)
    np.testing.assert_allclose(heights[worlds == 3], [0.1, 0.3, 0.5, 0.7], atol=1e-4)


def test_a_body_without_a_joint_that_all_worlds_share_carries_what_lies_on_it():
    builder = newton.ModelBuilder()
    belt = builder.add_link(xform=wp.transform((0, 0, 0.5), wp.quat_identity()), is_kinematic=True)
    builder.add_shape_plane(body=belt, width=0.0, length=0.0)
    for _ in range(2):
        builder.begin_world()
        box(height=0.6)(builder, 0)
        builder.end_world()
    run = Run(builder.finalize(device="cpu"))
    speeds = run.state.body_qd.numpy()
    speeds[0] = [0.5, 0, 0, 0, 0, 0]
    for state in (run.state, run.other):
        state.body_qd.assign(speeds)
    run.step(100, 0.005)
    np.testing.assert_allclose(run.qd, [0.5, 0, 0, 0, 0, 0] * 2, atol=1e-4)
    np.testing.assert_allclose(run.state.body_qd.numpy()[0], speeds[0])


def test_the_public_check_passes_worlds():
    def rollout(worlds):
        return list(Run(pile(worlds)).step(40, 0.005).q.reshape(len(worlds), -1))
    assert_permutation_invariant(rollout, range(2), shuffles=1)


def test_the_example_slides_as_the_formula_says(monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["09_newton.py", "--worlds", "5"])
    runpy.run_path(str(ROOT / "examples" / "python" / "09_newton.py"), run_name="__main__")
    assert len(capsys.readouterr().out.strip().splitlines()) == 6


@pytest.mark.quick
def test_the_lines_for_isaac_lab_build_a_solver_that_steps(monkeypatch):
    """Isaac Lab's two modules are stand-ins here: the test is that the page's class fills the documented slots."""
    physics, utils = types.ModuleType("isaaclab_newton.physics"), types.ModuleType("isaaclab.utils.configclass")
    physics.NewtonManager, physics.NewtonSolverCfg = type("NewtonManager", (), {}), type("NewtonSolverCfg", (), {})
    utils.configclass = dataclasses.dataclass
    for name in ("isaaclab", "isaaclab.utils", "isaaclab_newton"):
        monkeypatch.setitem(sys.modules, name, types.ModuleType(name))
    for module in (physics, utils):
        monkeypatch.setitem(sys.modules, module.__name__, module)
    page = (ROOT / "docs" / "howto" / "newton.md").read_text(encoding="utf-8")
    names = {}
    exec(re.search(r"```python\n(from isaaclab.*?)```", page, re.DOTALL).group(1), names)
    model, config = on_ground(box(height=0.3)), names["StictionSolverCfg"](law="convex", tolerance=1e-7)
    assert config.class_type.__mro__[1] is physics.NewtonManager
    config.class_type._build_solver(model, config)
    slots = vars(physics.NewtonManager)
    flags = [slots[f"_{name}"] for name in ("use_single_state", "needs_collision_pipeline", "supports_rigid_body_force_input")]
    assert flags == [False, True, True] and not config.class_type._supports_cuda_graph_capture()
    assert (slots["_solver"].law, slots["_solver"].solver.tolerance) == ("convex", 1e-7)
    run = Run(model)
    run.solver = slots["_solver"]
    np.testing.assert_allclose(run.step(10, 0.01).qd[2], -G * 0.1, rtol=1e-5)  # it falls


@pytest.mark.quick
def test_nan_in_one_world_harms_no_other_and_is_named():
    clean, dirty = Run(pile(np.arange(5))), Run(pile(np.arange(5)), hold_failed=True)
    for run in (clean, dirty):
        run.step(20, 0.005)
    good, qd = dirty.q.reshape(5, -1)[2], dirty.qd
    good_qd = qd.reshape(5, -1)[2].copy()
    qd[2 * 18 + 7] = np.nan
    dirty.state.joint_qd.assign(qd)
    for run in (clean, dirty):
        run.step(1, 0.005)
    assert dirty.solver.failed.tolist() == [2] and clean.solver.failed.size == 0
    assert dirty.q.reshape(5, -1)[2].tobytes() == good.tobytes()
    assert dirty.qd.reshape(5, -1)[2].tobytes() == good_qd.tobytes()
    for run in (clean, dirty):
        run.step(20, 0.005)
    assert dirty.solver.failed.size == 0 and np.isfinite(dirty.q).all()  # it goes on from there
    keep = [0, 1, 3, 4]
    assert clean.q.reshape(5, -1)[keep].tobytes() == dirty.q.reshape(5, -1)[keep].tobytes()


@pytest.mark.parametrize("name", ["joint_q", "joint_qd"])
def test_nan_without_contact_is_a_failure_too(name):
    run = Run(hinge(0.1))
    getattr(run.state, name).assign(np.array([np.nan], np.float32))
    run.step(1, 0.005)
    assert run.solver.failed.tolist() == [0]
    codes = run.solver.solver.stats()["codes"]
    assert codes.get("numerical") == 1 and codes.get("solved", 0) == 0


def test_each_world_has_its_status_and_the_judge_agrees():
    run = Run(pile(np.arange(4)), tolerance=1e-7).step(60, 0.005)
    status = run.solver.status
    assert status.shape == (4,) and (status["code"] == 0).all() and (status["residual"] < 1e-7).all()
    judged = stiction.verify(run.solver.batch, run.solver.solution)
    np.testing.assert_allclose(judged[:, 0], status["residual"], rtol=1e-3, atol=1e-12)
    assert run.solver.solver.stats()["solves"] == 60


def test_a_contact_far_off_loosens_no_tolerance():
    def add(builder, world):
        box()(builder, world)
        body = builder.add_body(xform=wp.transform((0, 0, 0.37), wp.quat_identity()))
        builder.add_shape_sphere(body, radius=0.1)  # 70 mm above the box, and seen
    run = Run(on_ground(add), tolerance=1e-5).step(1, 1e-4)
    contacts = int(run.contacts.rigid_contact_count.numpy()[0])
    b = run.solver._rows.b.reshape(-1, 3)
    assert contacts == 5 and np.abs(b).max() > 600
    # The box's free fall of a step, g dt, has to change, and not the sphere's gap / dt.
    assert run.solver.status["residual_abs"] <= 1e-5 * G * 1e-4 * 1.001


def test_warm_starts_by_newtons_matching_and_by_shapes():
    def last_iterations(**options):
        run = Run(pile(np.arange(3)), tolerance=1e-4, **options).step(60, 0.005)
        before = run.iterations
        return run.step(60, 0.005).iterations - before

    # Sweeps are counted: "auto" mixes methods, and counts of them do not compare.
    cold = last_iterations(solver="npgs", warm_start=0)
    for how in ("latest", "disabled"):
        assert last_iterations(solver="npgs", contact_matching=how) < 0.75 * cold


def test_a_reset_drops_what_a_world_would_start_from():
    run = Run(pile(np.arange(3))).step(80, 0.005)
    mask = wp.array([False, True, False, False], dtype=wp.bool, device="cpu")
    run.solver.reset(run.state, mask)
    run.pipeline.collide(run.state, run.contacts)
    rows = run.solver._rows
    rows.collect(run.state, run.contacts, np.zeros(54), 0.005)
    guess = [rows.guess(1.0, 0.005)[rows.offsets[e]:rows.offsets[e + 1]] for e in range(3)]
    assert guess[0].any() and guess[2].any() and len(guess[1]) and not guess[1].any()
    run.solver.reset(run.state)
    assert rows.guess(1.0, 0.005) is None


def test_the_same_contacts_may_serve_several_steps_in_place():
    runs = [Run(pile(np.arange(2))) for _ in range(2)]
    for _ in range(10):
        for run in runs:
            run.pipeline.collide(run.state, run.contacts)
        for _ in range(3):
            runs[0].solver.step(runs[0].state, runs[0].state, None, runs[0].contacts, 0.002)
            runs[1].solver.step(runs[1].state, runs[1].other, None, runs[1].contacts, 0.002)
            runs[1].state, runs[1].other = runs[1].other, runs[1].state
    assert runs[0].q.tobytes() == runs[1].q.tobytes()


# -- what is refused --------------------------------------------------------------------------------------------------

def loop(builder):
    links = [builder.add_link(mass=1.0, inertia=wp.mat33(np.eye(3))) for _ in range(2)]
    joints = [builder.add_joint_revolute(-1, links[0]), builder.add_joint_revolute(links[0], links[1])]
    builder.add_articulation(joints)
    builder.add_joint_revolute(-1, links[1])


def mimic(builder):
    links = [builder.add_link(mass=1.0, inertia=wp.mat33(np.eye(3))) for _ in range(2)]
    joints = [builder.add_joint_revolute(-1, links[0]), builder.add_joint_revolute(links[0], links[1])]
    builder.add_articulation(joints)
    builder.set_joint_mimic(joints[1], joints[0])


def stopped_ball(builder):
    rod(builder, "ball")
    builder.joint_limit_lower[-1] = -1.0


def off(builder):
    rod(builder, "revolute")
    builder.joint_enabled[-1] = False


REFUSED = {
    "particles": lambda builder: builder.add_particle((0, 0, 1), (0, 0, 0), 1.0),
    "DISTANCE": lambda builder: rod(builder, "distance", min_distance=0.1, max_distance=0.2),
    "outside articulations": loop,
    "mimic": mimic,
    "position limits of ball and free joints": stopped_ball,
    "switched off": off,
    "without a joint": lambda builder: builder.add_link(mass=1.0, inertia=wp.mat33(np.eye(3))),
}


@pytest.mark.parametrize("feature", REFUSED)
def test_what_the_solver_lacks_is_refused_by_name(feature):
    builder = newton.ModelBuilder()
    REFUSED[feature](builder)
    with pytest.raises(ValueError, match=f"SolverStiction has no .*{feature}"):
        SolverStiction(builder.finalize(device="cpu"))


@pytest.mark.parametrize("kinematic", [False, True])
def test_moving_bodies_of_all_worlds_are_refused(kinematic):
    builder = newton.ModelBuilder()
    body = builder.add_body(is_kinematic=kinematic)
    builder.add_shape_sphere(body, radius=0.1)
    for _ in range(2):
        builder.begin_world()
        box()(builder, 0)
        builder.end_world()
    with pytest.raises(ValueError, match="moving bodies that all worlds share"):
        SolverStiction(builder.finalize(device="cpu"))


def test_more_contacts_than_room_are_an_error_and_not_a_loss():
    model = on_ground(box())
    pipeline = newton.CollisionPipeline(model, rigid_contact_max=2)
    state, contacts = model.state(), pipeline.contacts()
    pipeline.collide(state, contacts)
    with pytest.raises(ValueError, match="4 were found and there is room for 2"):
        SolverStiction(model).step(state, model.state(), None, contacts, 0.01)


@pytest.mark.parametrize("options", [{"law": "sticky"}, {"contact_dim": 5}, {"warm_start": 2}, {"erp": np.nan}, {"erp": 1.5},
                                     {"slop": -1}, {"recovery_speed": np.nan}, {"restitution_threshold": -0.1}])
def test_options_out_of_range_are_refused(options):
    with pytest.raises(ValueError, match=f"{next(iter(options))}: expected"):
        SolverStiction(hinge(), **options)
