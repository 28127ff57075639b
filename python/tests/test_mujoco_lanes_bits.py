"""engine="lanes": the bits of a simulation depend on itself alone; numbers that are not finite stay alone."""

import copy
import os
import pickle
import subprocess
import sys

import numpy as np
import pytest
from lanes_models import COUNT, bits, fallen_states, model_of, mujoco

import stiction
import stiction.mujoco
from stiction.core.solution import CODES

CASES = [("dog", "elliptic", "float64", "Euler"), ("dog", "pyramidal", "float32", "implicitfast"),
         ("heap", "elliptic", "float32", "Euler"), ("heap", "pyramidal", "float64", "implicitfast"),
         ("blocks", "elliptic", "float64", "Euler"), ("blocks", "pyramidal", "float32", "implicitfast")]


def lanes(model, data, **options):
    return stiction.mujoco.BatchedSimulation(model, data, engine="lanes", **{"threads": 1, **options})


def states(name, cone, count=COUNT, integrator="Euler"):
    model = model_of(name, cone, integrator)
    return model, fallen_states(model, count, seed=3)


@pytest.fixture(scope="module", params=CASES, ids="-".join)
def case(request):
    """Model, data, precision, and the bits of all after six steps."""
    name, cone, dtype, integrator = request.param
    model, data = states(name, cone, integrator=integrator)
    simulation = lanes(model, data, dtype=dtype)
    simulation.step(nstep=6)
    assert (simulation.status["iterations"] > 0).any()
    return model, data, dtype, simulation


@pytest.mark.parametrize("threads", [2, 3])
def test_threads_change_no_bit(case, threads):
    model, data, dtype, expected = case
    simulation = lanes(model, data, dtype=dtype, threads=threads)
    simulation.step(nstep=6)
    assert simulation.hash() == expected.hash()
    assert (simulation.status == expected.status).all()


def test_a_device_changes_no_bit(case):
    model, data, dtype, expected = case
    simulation = lanes(model, data[:5], dtype=dtype, device="emulated")
    simulation.step(nstep=4)
    simulation = pickle.loads(pickle.dumps(simulation))
    simulation.step(nstep=2)
    assert bits(simulation) == bits(expected, range(5))


def test_order_and_mates_change_no_bit(case):
    model, data, dtype, expected = case
    order = np.random.default_rng(5).permutation(COUNT)
    shuffled = lanes(model, [data[i] for i in order], dtype=dtype)
    shuffled.step(nstep=6)
    assert bits(shuffled) == bits(expected, order)
    for i in (0, 7, COUNT - 1):
        alone = lanes(model, [data[i]], dtype=dtype)
        alone.step(nstep=6)
        assert bits(alone) == bits(expected, [i])


def test_calls_and_masks_change_no_bit(case):
    model, data, dtype, expected = case
    simulation = lanes(model, data, dtype=dtype)
    even = np.arange(COUNT) % 2 == 0
    for _ in range(2):
        simulation.step(active=even)
    simulation.step(active=~even, nstep=2)
    for _ in range(4):
        simulation.step()
    assert bits(simulation) == bits(expected)
    assert (simulation.time == expected.time).all()


def test_copies_go_on_with_the_same_bits(case):
    model, data, dtype, expected = case
    simulation = lanes(model, data, dtype=dtype)
    simulation.step(nstep=2)
    for other in (copy.deepcopy(simulation), pickle.loads(pickle.dumps(simulation))):
        other.step(nstep=4)
        assert bits(other) == bits(expected)


PROGRAM = """
import numpy as np
from lanes_models import fallen_states, model_of
import stiction.mujoco
for name, cone, dtype, integrator in {cases}:
    model = model_of(name, cone, integrator)
    simulation = stiction.mujoco.BatchedSimulation(model, fallen_states(model, {count}, seed=3), engine="lanes", dtype=dtype)
    simulation.step(nstep=6)
    print(simulation.hash())
"""


def test_instruction_sets_change_no_bit():
    """Lanes of every width that this build and machine have, including one robot at a time."""
    found = {}
    folder = os.path.dirname(__file__)
    for isa in ("widest", "avx2", "baseline"):
        paths = os.pathsep.join([folder, os.path.dirname(os.path.dirname(stiction.__file__))])
        ran = subprocess.run([sys.executable, "-c", PROGRAM.format(cases=CASES, count=COUNT)], capture_output=True, text=True,
                             env={**os.environ, "STICTION_ISA": isa, "PYTHONPATH": paths})
        if "expected one of widest" in ran.stderr:
            continue  # this build has it not
        assert ran.returncode == 0, ran.stderr
        found[isa] = ran.stdout.split()
    assert len(found["widest"]) == len(CASES)
    assert all(hashes == found["widest"] for hashes in found.values()), found


@pytest.mark.parametrize("field", ["qpos", "qvel", "ctrl", "qfrc_applied"])
@pytest.mark.parametrize("number", [np.nan, np.inf])
def test_what_is_not_finite_stays_alone(case, field, number):
    model, data, dtype, expected = case
    if not getattr(data[0], field).size:
        pytest.skip("the model has none")
    simulation = lanes(model, data, dtype=dtype)
    getattr(simulation, field)[5, 0] = number
    before = simulation.qpos[5].tobytes(), simulation.qvel[5].tobytes()
    simulation.step(nstep=6)
    assert (simulation.qpos[5].tobytes(), simulation.qvel[5].tobytes()) == before
    assert simulation.status["code"][5] == CODES.index("invalid_input")
    assert simulation.failed.tolist() == [5] and not simulation.solved[5]
    rest = np.arange(COUNT) != 5
    assert bits(simulation, rest) == bits(expected, rest)


def test_what_would_become_infinite_stays_where_it_is():
    model, data = states("dog", "elliptic", 3)
    simulation = lanes(model, data, dtype="float32")
    simulation.qvel[1, 0] = 3e38
    before = simulation.qpos[1].tobytes()
    simulation.step(nstep=2)
    assert simulation.qpos[1].tobytes() == before and simulation.failed.tolist() == [1]
    assert np.isfinite(simulation.qpos).all() and np.isfinite(simulation.qvel).all()


def test_data_are_filled_and_taken():
    model, data = states("dog", "elliptic", 4)
    simulation = lanes(model, 4)
    assert (simulation.qpos == model.qpos0).all()
    simulation.step(np.full((4, model.nu), 0.1), nstep=3)
    one = simulation.data[2]
    assert (one.qpos == simulation.qpos[2]).all() and one.time == simulation.time[2] == pytest.approx(3 * model.opt.timestep)
    peer = mujoco.MjData(model)
    peer.qpos[:], peer.qvel[:] = simulation.qpos[2], simulation.qvel[2]
    mujoco.mj_kinematics(model, peer)
    assert (one.xpos == peer.xpos).all() and simulation.read("xpos").shape == (4, model.nbody, 3)
    one.qpos[2] += 1
    simulation.take(2)
    assert simulation.qpos[2, 2] == one.qpos[2]
    simulation.reset([2])
    assert (simulation.qpos[2] == model.qpos0).all() and simulation.time.tolist()[2] == 0 < simulation.time[1]
    with pytest.raises(ValueError, match="array of mujoco.MjData"):
        simulation.read("nothing")
    with pytest.raises(ValueError, match=r"ctrl: expected \(4, 8\)"):
        simulation.step(np.zeros((4, 3)))
    with pytest.raises(ValueError, match="nstep"):
        simulation.step(nstep=-1)
