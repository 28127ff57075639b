"""Worlds: the bits of the command line, environments that do not depend on each other, states in and out, mistakes."""

import json
import os
import subprocess
import sys
import threading

import numpy as np
import pytest
from frameworks import framework
from worlds import SCENES, read_states, stack, started

import stiction
from stiction import CODES, FLAGS, Body, Shape, World, WorldState, WorldStep
from stiction.core.solution import solver_name


def stepped_by_the_command_line(cli, folder, scene, envs, steps, dtype, *flags):
    """(states before, hash before, report, states after) of `stiction step`."""
    found = []
    for count in (0, steps):
        states, report = folder / f"{count}.csv", folder / f"{count}.json"
        subprocess.run([cli, "step", scene, "--envs", str(envs), "--steps", str(count), "--seed", "3", "--quiet",
                        "--precision", "f32" if dtype == "float32" else "f64", "-o", str(states), "--json", str(report),
                        *flags], check=True, timeout=120)
        rows = np.genfromtxt(states, delimiter=",", names=True)
        found += [read_states(rows, envs, dtype), json.loads(report.read_text())]
    return found


def before_normalised(orientation):
    """Quaternions that reset() normalises to these bits: a unit quaternion of rounded numbers may not stay itself."""
    found, missing = orientation.copy(), np.ones(orientation.shape[:-1], bool)
    for scale in 1 + np.arange(2000) / 2000:
        tried = (orientation * scale).astype(orientation.dtype)
        w, x, y, z = np.moveaxis(tried.astype(np.float64), -1, 0)
        unit = (tried.astype(np.float64) / np.sqrt(w * w + x * x + y * y + z * z)[..., None]).astype(orientation.dtype)
        hit = missing & (unit == orientation).all(-1)
        found[hit] = tried[hit]
        missing &= ~hit
    assert not missing.any()
    return found


RUNS = [(scene, "float64", "npgs", "cones") for scene in SCENES] + [
    ("pile", "float32", "npgs", "cones"), ("slide", "float32", "npgs", "cones"), ("stack", "float64", "newton", "cones"),
    ("bounce", "float64", "multigrid", "cones"), ("stack", "float64", "npgs", "pairs")]


def test_a_world_of_boxed_friction_holds_a_box_between_the_axes():
    """Pulled with 0.6 of its weight at mu 0.5: along an axis it slides, between the axes each has 0.42."""
    floor, shape = stiction.Shape("plane", mu=0.5), stiction.Shape("box", (0.2, 0.2, 0.02), body=0, mu=0.5)
    body = stiction.Body.solid(shape, 1000.0, position=(0, 0, 0.02))

    def speed(law, angle):
        gravity = (0.6 * 9.81 * np.cos(angle), 0.6 * 9.81 * np.sin(angle), -9.81)
        world = World([body], [floor, shape], 1, gravity=gravity, law=law, tolerance=1e-10, max_iterations=4000)
        world.step(count=20)
        change = np.array([[[*gravity, 0, 0, 0]]]) * world.dt
        one = stiction.Solver(solver="npgs", tolerance=1e-9, max_iterations=4000).solve(
            world.contacts().batch(world.state().twist, change))  # its problem again, as a batch of bodies
        assert one.solved.all()
        return np.hypot(*world.state().twist[0, 0, :2])

    sliding = 0.1 * 9.81 * 0.1
    np.testing.assert_allclose([speed("boxed", 0), speed("coulomb", np.pi / 4), speed("boxed", np.pi / 4)],
                               [sliding, sliding, 0], atol=1e-7)
    for solver in ("newton", "multigrid"):
        with pytest.raises(stiction.Error, match="solver si"):
            World([body], [floor, shape], 1, law="boxed", solver=solver)
    with pytest.raises(stiction.Error, match="box_friction"):
        stiction.WorldStep(World([body], [floor, shape], 1, law="boxed"))


@pytest.mark.parametrize("scene, dtype, solver, blocks", RUNS)
def test_a_world_has_the_bits_of_the_command_line(cli, tmp_path, scene, dtype, solver, blocks):
    flags = ["--solver", "si" if solver == "npgs" else solver, "--tolerance", "1e-5", "--iterations", "2000",
             "--warm-start", "0.9", "--threads", "1", "--blocks", blocks]
    steps = {"bounce": 900}.get(scene, 150)
    before, first, after, last = stepped_by_the_command_line(cli, tmp_path, scene, 3, steps, dtype, *flags)
    bodies, shapes, options = SCENES[scene]()
    world = World(bodies, shapes, 3, dtype=dtype, solver=solver, tolerance=1e-5, max_iterations=2000, warm_start=0.9,
                  blocks=blocks, **options)
    world.reset(position=before.position, orientation=before_normalised(before.orientation), twist=before.twist)
    assert world.hash() == first["hash"]
    contacts = 0
    for _ in range(steps):
        world.step()
        contacts += len(world.contacts())
    assert contacts > 0
    assert world.hash() == last["hash"]
    for found, wanted in zip(world.state(), after):
        np.testing.assert_array_equal(found, wanted)
    assert {solver_name(number) for number in world.status["solver"]} == {solver}


@pytest.mark.parametrize("dtype", ["float64", "float32"])
@pytest.mark.parametrize("law", ["coulomb", "convex"])
def test_an_environments_bits_do_not_depend_on_its_neighbours(law, dtype):
    together = started(law=law, dtype=dtype)
    together.step(count=120)
    state = together.state()
    for order in ([5, 3, 1, 0, 2, 4], [2], [2, 2, 4]):
        other = started(order=order, law=law, dtype=dtype, threads=2)
        other.step(count=120)
        for found, wanted in zip(other.state(), state):
            np.testing.assert_array_equal(found, wanted[order])
        assert (other.status == together.status[order]).all()
    assert len(together.contacts()) > 6 * 8


def test_the_emulated_device_has_the_same_bits():
    hashes = []
    for device in ("cpu", "emulated"):
        world = started(device=device, cfm=1e-4)
        wrench = np.zeros((6, 12, 6))
        wrench[:, 3, 0] = 50.0
        world.step(count=40)
        world.step(wrench, count=20)
        step = WorldStep(world)
        hashes.append([world.hash(), step.vjp(twist=np.ones((6, 12, 6))).twist.tobytes(), world.contacts().impulse.tobytes(),
                       world.status.tobytes()])
        assert world.device == device
    assert hashes[0] == hashes[1]


def test_laws_and_options_reach_the_world():
    hashes = set()
    for options in ({}, {"law": "convex"}, {"solver": "pgs"}, {"solver": "newton"}, {"erp": 0.5}, {"cfm": 1e-3},
                    {"dt": 0.004}, {"margin": 0.02}, {"warm_start": 0.0}, {"omega": 1.2}, {"max_iterations": 7},
                    {"tolerance": 1e-2}, {"slop": 0.01}, {"gravity": (0, 0, -9.0)}, {"max_contacts_per_env": 3},
                    {"dtype": "float32"}):
        world = started(**options)
        world.step(count=150)
        hashes.add(world.hash())
        if "max_contacts_per_env" in options:
            assert (world.status["flags"] >> FLAGS.index("contacts_dropped") & 1).all()
    assert len(hashes) == 16


def test_a_ball_falls_and_comes_to_rest():
    floor, ball = Shape("plane"), Shape("sphere", 0.1, body=0)
    body = Body.solid(ball, 1000.0, position=(0, 0, 0.5))
    assert body.mass == pytest.approx(4 / 3 * np.pi)
    world = World([body], [floor, ball], 2, dt=0.001, tolerance=1e-8, max_iterations=1000)
    assert len(world.contacts()) == 0 and world.status["code"].tolist() == [0, 0] and world.dt == 0.001
    world.step(count=100)
    assert world.state().position[0, 0, 2] == pytest.approx(0.5 - 9.81 * 0.001 ** 2 * 100 * 101 / 2)
    energy = world.motion()
    assert energy["kinetic"][0] == pytest.approx(0.5 * body.mass * 0.981 ** 2)
    assert energy["potential"][0] == pytest.approx(body.mass * 9.81 * world.state().position[0, 0, 2])
    np.testing.assert_allclose(energy["momentum"][1], [0, 0, -0.981 * body.mass])
    world.step(count=900)
    contacts = world.contacts()
    assert len(contacts) == 2 and contacts.offsets.tolist() == [0, 1, 2]
    np.testing.assert_allclose(contacts.impulse[:, 0], body.mass * 9.81 * 0.001, rtol=1e-6)
    np.testing.assert_allclose(contacts.normal, [[0, 0, 1]] * 2)
    assert contacts.body_a.tolist() == [-1, -1] and contacts.body_b.tolist() == [0, 0]
    assert world.solved.all() and [CODES[code] for code in world.status["code"]] == ["solved", "solved"]
    assert set(world.seconds()) == {"detect", "plan", "solve", "integrate"} and world.seconds()["solve"] > 0


def test_wrenches_last_for_the_steps_they_are_given_to():
    ball = Shape("sphere", 0.1, body=0)
    world = World([Body.solid(ball, 1000.0)], [ball], 2, gravity=(0, 0, 0), dt=0.01)
    mass = world.bodies[0].mass
    wrench = np.zeros((2, 1, 6))
    wrench[1, 0, 0] = mass
    world.step(wrench, count=3)
    np.testing.assert_allclose(world.state().twist[:, 0, 0], [0, 0.03], rtol=1e-14)
    world.step()
    np.testing.assert_allclose(world.state().twist[:, 0, 0], [0, 0.03], rtol=1e-14)
    wrench *= 2  # the caller's own array, edited between calls
    world.step(wrench)
    np.testing.assert_allclose(world.state().twist[:, 0, 0], [0, 0.05], rtol=1e-14)


def test_masked_environments_start_over_and_no_other_one_changes():
    world = started()
    begin = world.state()
    world.step(count=60)
    before = world.state()
    mask = np.array([1, 0, 0, 1, 0, 0], bool)
    world.reset(mask, **begin._asdict())
    now = world.state()
    for found, old, new in zip(now, before, begin):
        np.testing.assert_array_equal(found[~mask], old[~mask])
        np.testing.assert_allclose(found[mask], new[mask], rtol=1e-15)
    world.reset(np.array([0, 1, 0, 0, 0, 0], np.uint8))
    np.testing.assert_array_equal(world.state().position[1], [body.position for body in world.bodies])
    np.testing.assert_array_equal(world.state().position[2:3], before.position[2:3])
    twist = np.full((6, 12, 6), 0.25)
    world.reset(twist=twist)
    np.testing.assert_array_equal(world.state().twist, twist)
    np.testing.assert_array_equal(world.state().position[2], before.position[2])


def test_a_poisoned_environment_stays_where_it_is_and_spoils_no_other_one():
    clean, poisoned = started(), started()
    wrench = np.zeros((6, 12, 6))
    clean.step(wrench, count=50)
    wrench[2, 5, 1] = np.nan
    poisoned.step(wrench, count=50)
    others = [0, 1, 3, 4, 5]
    for a, b in zip(clean.state(), poisoned.state()):
        np.testing.assert_array_equal(a[others], b[others])
    np.testing.assert_array_equal(poisoned.state().position[2], started().state().position[2])
    assert CODES[poisoned.status["code"][2]] == "invalid_input"
    gradients = WorldStep(poisoned, wrench).vjp(twist=np.ones((6, 12, 6)))
    assert gradients.flagged("invalid_input").tolist() == [False, False, True, False, False, False]
    assert not gradients.twist[2].any() and not gradients.wrench[2].any()


def test_a_state_may_be_written_into_the_callers_arrays():
    world = started(dtype="float32")
    world.step(count=10)
    out = WorldState(*(np.full((6, 12, width), np.nan, np.float32) for width in (3, 4, 6)))
    assert world.state(out) is out
    for found, wanted in zip(out, world.state()):
        np.testing.assert_array_equal(found, wanted)
    torch = framework("torch", "states in PyTorch's memory are")
    tensors = {name: torch.zeros(6, 12, width) for name, width in (("position", 3), ("orientation", 4), ("twist", 6))}
    world.state(tensors)
    np.testing.assert_array_equal(tensors["twist"].numpy(), out.twist)
    other = started(dtype="float32")
    other.reset(**tensors)
    np.testing.assert_array_equal(other.state().position, out.position)


def test_a_worlds_contacts_are_a_batch_for_other_solvers():
    bodies, shapes, options = stack()
    world = World(bodies, shapes, 1, cfm=1e-4, tolerance=1e-10, max_iterations=5000, warm_start=0.0, **options)
    position = np.array([[[0.005 * k, 0, (2 * k + 1) * 0.1] for k in range(5)]])
    world.reset(position=position)
    world.step(count=3)
    before = world.state()
    world.step()
    change = np.zeros((1, 5, 6))
    change[:, :, 2] = -9.81 * world.dt
    batch = world.contacts().batch(before.twist, change)
    solution = stiction.Solver(tolerance=1e-10, max_iterations=5000).solve(batch)
    assert solution.solved.all() and len(world.contacts()) == 20
    # Boxes of equal moments keep the twists that the solve leaves.
    np.testing.assert_array_equal(solution.velocities.reshape(1, 5, 6), world.state().twist)
    np.testing.assert_array_equal(solution.lambda_, world.contacts().impulse)


def test_empty_worlds():
    floor, ball = Shape("plane"), Shape("sphere", 0.1, body=0)
    none = World([Body.solid(ball, 1000.0)], [floor, ball], 0)
    none.step()
    assert none.state().position.shape == (0, 1, 3) and none.status.shape == (0,) and none.hash() == f"{0:016x}"
    assert WorldStep(none).vjp().twist.shape == (0, 1, 6)
    bare = World([], [floor], 3)
    bare.step()
    assert bare.state().twist.shape == (3, 0, 6) and len(bare.contacts()) == 0


BALL = Shape("sphere", 0.1, body=0)


def ball_world(**options):
    return World([Body.solid(BALL, 1000.0)], [Shape("plane"), BALL], 2, **options)


MISTAKES = {
    "a kind that there is not": (lambda: Shape("cone"), ValueError, "Shape.kind: expected one of sphere"),
    "too few sizes": (lambda: Shape("box", 0.1), ValueError, "Shape.size: expected 3 numbers, got 1"),
    "sizes of a plane": (lambda: Shape("plane", 1.0), ValueError, "Shape.size: expected 0 numbers, got 1"),
    "words for numbers": (lambda: Shape("sphere", "big"), TypeError, "Shape.size: expected 1 numbers"),
    "half a body": (lambda: Shape("sphere", 0.1, body=0.5), TypeError, "Shape.body: expected an integer"),
    "no mass": (lambda: World([Body(0, (1, 1, 1))], [], 1), stiction.Error, "mass = 0: must be finite and > 0"),
    "a body that there is not": (lambda: World([], [BALL], 1), stiction.Error, "body = 0"),
    "a plane that moves": (lambda: World([Body(1, (1, 1, 1))], [Shape("plane", body=0)], 1), stiction.Error, "plane"),
    "a solid plane": (lambda: Body.solid(Shape("plane"), 1.0), stiction.Error, "no mass"),
    "no density": (lambda: Body.solid(BALL, 0.0), stiction.Error, "density = 0: must be finite and > 0"),
    "not a body": (lambda: World([BALL], [], 1), TypeError, r"bodies\[0\]: expected a stiction.Body, got Shape"),
    "fewer than no environments": (lambda: World([], [], -1), stiction.Error, "env_count = -1: must be >= 0"),
    "half an environment": (lambda: World([], [], 1.5), TypeError, "env_count: expected an integer, got 1.5"),
    "a solver of matrices": (lambda: ball_world(solver="lemke"), ValueError, "solver: expected one of npgs"),
    "a law that there is not": (lambda: ball_world(law="newton"), stiction.Error, "newton"),
    "a step backwards": (lambda: ball_world(dt=-1.0), stiction.Error, "dt"),
    "a device that there is not": (lambda: ball_world(device="tpu"), stiction.Error, "tpu"),
    "a margin below 0": (lambda: ball_world(margin=-1.0), stiction.Error, "margin = -1: must be finite and >= 0"),
    "half precision": (lambda: ball_world(dtype="float16"), TypeError, "dtype: expected float32 or float64"),
    "a wrench of another shape": (lambda: ball_world().step(np.zeros((2, 6))), ValueError, "wrench: expected float64"),
    "a wrench of another type": (lambda: ball_world().step(np.zeros((2, 1, 6), np.float32)), TypeError, "wrench"),
    "a wrench with gaps": (lambda: ball_world().step(np.zeros((2, 1, 12))[:, :, ::2]), ValueError, "contiguous"),
    "steps back": (lambda: ball_world().step(count=-1), ValueError, "count: expected at least 0 steps, got -1"),
    "a mask of another length": (lambda: ball_world().reset(np.ones(3, bool)), ValueError, "mask: expected bool"),
    "a state that is not finite": (lambda: ball_world().reset(position=np.full((2, 1, 3), np.nan)), stiction.Error,
                                   "state of environment 0, body 0"),
    "a quaternion of no length": (lambda: ball_world().reset(orientation=np.zeros((2, 1, 4))), stiction.Error,
                                  "zero quaternion"),
    "half a state to write": (lambda: ball_world().state({"twist": np.zeros((2, 1, 6))}), ValueError, "out: expected"),
    "no world": (lambda: WorldStep(3), TypeError, "world: expected a stiction.World, got int"),
    "a step with dropped contacts": (lambda: WorldStep(ball_world(max_contacts_per_env=1)), stiction.Error,
                                     "max_contacts_per_env = 1"),
    "a loss of another shape": (lambda: WorldStep(ball_world()).vjp(twist=np.zeros(6)), ValueError, "twist: expected"),
}


@pytest.mark.parametrize("mistake", MISTAKES, ids=lambda name: name.replace(" ", "_"))
def test_mistakes_are_named(mistake):
    make, error, message = MISTAKES[mistake]
    with pytest.raises(error, match=message):
        make()


def test_a_refused_call_changes_nothing():
    world = ball_world()
    world.step(count=3)
    before = world.hash()
    bad = np.zeros((2, 1, 4))
    bad[0] = [1, 0, 0, 0]
    for call in (lambda: world.reset(orientation=bad), lambda: world.step(np.zeros(3)), lambda: world.reset(np.ones(3, bool)),
                 lambda: WorldStep(world, residual_limit=-1.0)):
        with pytest.raises((ValueError, stiction.Error)):
            call()
        assert world.hash() == before


def test_memory_that_is_written_twice_is_refused():
    world = ball_world()
    memory = np.zeros(2 * 13 - 1)
    parts = memory[:6].reshape(2, 1, 3), memory[5:13].reshape(2, 1, 4), memory[13:].reshape(2, 1, 6)
    with pytest.raises(ValueError, match="out.orientation: expected memory of its own, got memory that it shares with out.position"):
        world.state(WorldState(*parts))
    assert not memory.any()
    frozen = world.state()
    frozen.twist.setflags(write=False)
    with pytest.raises(ValueError, match="out.twist: expected a writable array"):
        world.state(frozen)


def test_python_goes_on_while_a_world_steps():
    world = started(threads=1, tolerance=0)
    entered, finished, seen = threading.Event(), threading.Event(), []

    def work():
        entered.set()
        world.step(count=300)
        finished.set()

    interval = sys.getswitchinterval()
    sys.setswitchinterval(1000)  # only a call that releases the interpreter lets others run
    try:
        thread = threading.Thread(target=work)
        thread.start()
        entered.wait()
        seen.append(finished.is_set())
        thread.join()
    finally:
        sys.setswitchinterval(interval)
    assert seen == [False]


def test_threads_take_turns():
    world, alone = started(), started()
    threads = [threading.Thread(target=lambda: [(world.step(), world.state(), world.contacts()) for _ in range(10)])
               for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    alone.step(count=40)
    assert world.hash() == alone.hash()


FORKS = """
import os
import sys

sys.path.insert(0, sys.argv[2])
from worlds import started
world = started(threads=2)
world.step(count=50)
other = started(threads=2)
other.step(count=80)
child = os.fork()
if child == 0:
    if sys.argv[1] == "steps":
        world.step(count=30)
    sys.exit(3 if sys.argv[1] == "exits" or world.hash() == other.hash() else 4)
sys.exit(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system has no fork()")
@pytest.mark.parametrize("child", ["exits", "steps"])
def test_a_child_of_fork_exits_and_may_step(child):
    ran = subprocess.run([sys.executable, "-W", "ignore", "-c", FORKS, child, os.path.dirname(__file__)], timeout=120,
                         check=False)
    assert ran.returncode == 3
