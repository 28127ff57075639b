"""engine="lanes" with constants that differ by simulation, beside MuJoCo models with these constants, and their bits."""

import copy
import pickle

import numpy as np
import pytest
from lanes_models import (
    COUNT,
    NAMES,
    after_six_steps,
    apart,
    bits,
    compare_bodies,
    compare_contacts_and_rows,
    compare_smooth,
    compare_step,
    fallen_states,
    model_of,
    mujoco,
    random_states,
)

import stiction.mujoco
from stiction.core.solution import CODES
from stiction.mujoco.varied import NAMES as KNOWN

CONES = ("pyramidal", "elliptic")


def vary(arrays, seed=0):
    """Constants at random, each array by a stream of its own: a simulation's do not depend on which others vary."""
    for name, array in arrays.items():
        rng = np.random.default_rng([seed, *name.encode()])
        array *= rng.uniform(0.5, 1.5, array.shape)
        if name.startswith("dof"):
            array += rng.uniform(0, 0.1, array.shape) * (rng.uniform(size=array.shape) < 0.5)
        if name == "dof_frictionloss":
            array[rng.uniform(size=array.shape) < 0.2] = 0
        if name.startswith("actuator"):
            array += rng.uniform(-0.1, 0.1, array.shape)
    return arrays


def lanes(model, data, **options):
    simulation = stiction.mujoco.BatchedSimulation(model, data, engine="lanes", **{"varies": tuple(KNOWN), **options})
    vary(simulation.varied)
    return simulation


def forwarded(simulation, data):
    """Models with each simulation's constants, and data that mj_forward has filled with them."""
    models = [simulation.model_of(i) for i in range(len(data))]
    for model, one in zip(models, data):
        mujoco.mj_forward(model, one)
    return zip(models, data)


@pytest.mark.parametrize("cone", CONES)
@pytest.mark.parametrize("name", NAMES)
def test_dynamics_contacts_and_rows_are_those_of_a_model_with_these_constants(name, cone):
    model = model_of(name, cone)
    for data in (fallen_states(model, 11), random_states(model, 11, seed=1)):
        simulation = lanes(model, data)
        found = simulation.probe()
        for i, (own, one) in enumerate(forwarded(simulation, data)):
            compare_smooth(own, found, i, one)
            compare_contacts_and_rows(own, found, i, one)


@pytest.mark.parametrize("integrator", ["Euler", "RK4"])
@pytest.mark.parametrize("name", NAMES)
def test_a_step_and_bodies_are_those_of_a_model_with_these_constants(name, integrator):
    model = model_of(name, "pyramidal", integrator)
    data = fallen_states(model, 9)
    simulation = lanes(model, data, tolerance=1e-10, observes_bodies=True)
    models = [simulation.model_of(i) for i in range(9)]
    simulation.step()
    assert simulation.solved.all(), simulation.status
    for i, (own, one) in enumerate(zip(models, data)):
        mujoco.mj_step(own, one)
        mujoco.mj_rnePostConstraint(own, one)
        compare_step(simulation, i, one)
        compare_bodies(simulation, i, one, ("cinert", "cvel", "xipos"), 1e-12 if integrator == "Euler" else 1e-9, 1e-6)


@pytest.mark.parametrize("name", ["dog", "heap", "humanoid"])
def test_accelerations_in_elliptic_cones_are_those_of_the_solver_by_rows(name):
    model = model_of(name, "elliptic")
    data = fallen_states(model, 9, seed=2)
    simulation = lanes(model, data, tolerance=1e-10)
    found = simulation.probe()
    for i, (own, one) in enumerate(forwarded(simulation, data)):
        peer = stiction.mujoco.BatchedSimulation(own, 1, tolerance=1e-10)
        for field in ("qpos", "qvel", "ctrl", "qfrc_applied", "qacc_warmstart"):
            getattr(peer.data[0], field)[:] = getattr(one, field)
        peer.forward()
        assert apart(found["qacc"][i], peer.data[0].qacc) < 1e-8, i


@pytest.mark.parametrize("name", ["joints", "dog", "heap"])
@pytest.mark.parametrize("known", KNOWN)
def test_one_constant_may_vary_alone(known, name):
    model = model_of(name)
    data = fallen_states(model, 9)
    simulation = lanes(model, data, varies=known)
    found = simulation.probe()
    for i, (own, one) in enumerate(forwarded(simulation, data)):
        compare_smooth(own, found, i, one)
        compare_contacts_and_rows(own, found, i, one)


@pytest.mark.parametrize("cone", CONES)
@pytest.mark.parametrize("name", NAMES)
def test_constants_of_the_model_give_its_bits(name, cone):
    """In double precision, where damping that may vary is not all zero: a model without damping solves with M once less.
    In single, numbers derived from constants are rounded otherwise."""
    model = model_of(name, cone)
    varied = tuple(known for known in KNOWN if known != "dof_damping" or model.dof_damping.any())
    data = fallen_states(model, 9, seed=4)
    for dtype in ("float64", "float32"):
        plain, equal = (stiction.mujoco.BatchedSimulation(model, [copy.copy(one) for one in data], engine="lanes", dtype=dtype,
                                                          varies=varies) for varies in ((), varied))
        for simulation in (plain, equal):
            simulation.step(nstep=4 if dtype == "float64" else 1)
        assert dtype == "float32" or plain.hash() == equal.hash()
        assert apart(equal.qpos, plain.qpos) < 1e-4


@pytest.fixture(scope="module", params=[("dog", "elliptic", "Euler", "float64"), ("heap", "pyramidal", "RK4", "float32"),
                                        ("dog", "pyramidal", "RK4", "float64")], ids="-".join)
def case(request):
    return after_six_steps(lanes, *request.param)


def test_mates_threads_and_calls_change_no_bit(case):
    model, data, options, expected = case
    order = np.random.default_rng(5).permutation(COUNT)
    shuffled = lanes(model, [data[i] for i in order], threads=3, **options)
    for name, array in shuffled.varied.items():
        array[:] = expected.varied[name][order]
    shuffled.step(nstep=6)
    assert bits(shuffled) == bits(expected, order)
    alone = lanes(model, [data[7]], **options)
    for name, array in alone.varied.items():
        array[0] = expected.varied[name][7]
    for _ in range(6):
        alone.step()
    assert bits(alone) == bits(expected, [7])


def test_constants_are_written_between_steps_and_copied(case):
    model, data, options, expected = case
    simulation = stiction.mujoco.BatchedSimulation(model, data, engine="lanes", varies=tuple(KNOWN), **options)
    kept = {name: array.copy() for name, array in simulation.varied.items()}
    vary(simulation.varied)
    simulation.step(nstep=2)
    for other in (copy.deepcopy(simulation), pickle.loads(pickle.dumps(simulation))):
        other.step(nstep=4)
        assert bits(other) == bits(expected)
    for name, array in simulation.varied.items():
        array[:] = kept[name]
    simulation.step(nstep=4)
    assert simulation.hash() != expected.hash()
    plain = stiction.mujoco.BatchedSimulation(model, COUNT, engine="lanes", **options)
    simulation.reset()
    for one in (plain, simulation):
        one.step(nstep=3)
    assert plain.hash() == simulation.hash() or options["dtype"] == "float32"


@pytest.mark.parametrize("known", KNOWN)
@pytest.mark.parametrize("number", [np.nan, -np.inf, -1.0])
def test_numbers_out_of_range_stay_alone(case, known, number):
    """Friction below MuJoCo's least is that, and gains and biases may be negative."""
    model, data, options, expected = case
    simulation = lanes(model, data, **options)
    if not simulation.varied[known].size:
        pytest.skip("the model has none")
    simulation.varied[known][5].flat[0] = number
    before = simulation.qpos[5].tobytes(), simulation.qvel[5].tobytes()
    simulation.step(nstep=6)
    rest = np.arange(COUNT) != 5
    assert bits(simulation, rest) == bits(expected, rest)
    is_allowed = known.endswith("friction") and not np.isnan(number) or known.startswith("actuator") and number == -1.0
    assert simulation.failed.tolist() == ([] if is_allowed else [5])
    if simulation.failed.size:
        assert (simulation.qpos[5].tobytes(), simulation.qvel[5].tobytes()) == before
        assert simulation.status["code"][5] == CODES.index("invalid_input") and simulation.status["flags"][5]


def test_data_and_models_have_their_own_constants():
    model = model_of("dog")
    simulation = lanes(model, 4)
    own = simulation.model_of(2)
    assert (own.body_mass == simulation.varied["body_mass"][2]).all() and (own.body_mass != model.body_mass).any()
    assert own.body_subtreemass[0] == pytest.approx(own.body_mass.sum())
    assert (own.body_invweight0 == model.body_invweight0).all()
    found = simulation.probe()
    for i, one in enumerate(simulation.data):
        assert apart(found["qacc_smooth"][i], one.qacc_smooth) < 1e-12
    for name in ("heap", "joints"):
        own = lanes(model_of(name), 1).model_of(0)
        peer, simple = copy.copy(own), own.dof_simplenum > 0
        mujoco.mj_setConst(peer, mujoco.MjData(peer))
        np.testing.assert_allclose(own.dof_M0[simple], peer.dof_M0[simple], rtol=1e-13)
        np.testing.assert_allclose(own.body_subtreemass, peer.body_subtreemass, rtol=1e-13)
        assert simple.any() or name == "joints"
    with pytest.raises(IndexError, match="model_of: expected a simulation in 0..3"):
        simulation.model_of(4)


def test_names_without_effect_are_refused():
    model = model_of("dog")
    with pytest.raises(ValueError, match="expected some of body_mass, .*, got 'gravity'"):
        lanes(model, 1, varies=("body_mass", "gravity"))
    assert list(lanes(model, 1, varies="body_mass").varied) == ["body_mass"]
    assert stiction.mujoco.BatchedSimulation(model, 1, engine="lanes").varied == {}
    for flag, name in (("DAMPER", "dof_damping"), ("FRICTIONLOSS", "dof_frictionloss")):
        model.opt.disableflags = int(getattr(mujoco.mjtDisableBit, f"mjDSBL_{flag}"))
        with pytest.raises(stiction.mujoco.UnsupportedModel, match=f"{name} has no effect"):
            lanes(model, 1, varies=(name,))
