"""engine="lanes" with observes_bodies: places, inertias, velocities and contact forces beside MuJoCo's, and their bits."""

import copy
import pickle

import numpy as np
import pytest
from lanes_models import COUNT, NAMES, after_six_steps, apart, compare_bodies, fallen_states, model_of, mujoco, random_states

import stiction.mujoco

KINEMATIC = ("xpos", "xipos", "cinert", "cvel", "qfrc_actuator", "ten_length", "ten_velocity")
ALL = (*KINEMATIC, "cfrc_ext")


def lanes(model, data, **options):
    return stiction.mujoco.BatchedSimulation(model, data, engine="lanes", **{"observes_bodies": True, **options})


def compare(simulation, data, forces, kinematics=1e-12):
    for i, one in enumerate(data):
        compare_bodies(simulation, i, one, KINEMATIC, kinematics, forces)


@pytest.mark.parametrize("name", NAMES)
def test_what_a_forward_observes_is_mujocos(name):
    """At equal state, with pyramids, whose problem MuJoCo's Newton solves to its last digits or to 1e-8."""
    model = model_of(name)
    touching = 0.0
    for data in (fallen_states(model, 11), random_states(model, 11, seed=1)):
        simulation = lanes(model, data, tolerance=1e-10)
        before = simulation.hash(), simulation.qacc.tobytes()
        simulation.forward()
        assert (simulation.hash(), simulation.qacc.tobytes()) == before and simulation.solved.all()
        for one in data:
            mujoco.mj_rnePostConstraint(model, one)
            touching = max(touching, np.abs(one.cfrc_ext).max())
        compare(simulation, data, forces=1e-7)
    assert touching > 1 or name in ("joints", "inverted_double_pendulum", "inverted_pendulum", "reacher")


@pytest.mark.parametrize("name", NAMES)
def test_forces_in_elliptic_cones_are_those_of_the_solver_by_rows(name):
    """Contacts of one, three, four and six directions: one problem, solved twice to 1e-10."""
    model = model_of(name, "elliptic")
    data = fallen_states(model, 9, seed=2)
    simulation = lanes(model, data, tolerance=1e-10)
    simulation.forward()
    peers = stiction.mujoco.BatchedSimulation(model, data, tolerance=1e-10)
    peers.forward()
    peers.run("mj_rnePostConstraint")
    compare(simulation, data, forces=1e-9)


@pytest.mark.parametrize("integrator", ["Euler", "RK4"])
@pytest.mark.parametrize("name", NAMES)
def test_what_a_step_observes_is_of_its_last_evaluation(name, integrator):
    model = model_of(name, "pyramidal", integrator)
    data = fallen_states(model, 9)
    simulation = lanes(model, data, tolerance=1e-10)
    simulation.step()
    for one in data:
        mujoco.mj_step(model, one)
        mujoco.mj_rnePostConstraint(model, one)
    # With RK4 the last stage follows three solves, each to its tolerance.
    compare(simulation, data, forces=1e-6, kinematics=1e-12 if integrator == "Euler" else 1e-9)


@pytest.mark.parametrize("name", ["dog", "humanoid"])
def test_single_precision_is_near(name):
    """Compliances of stiff rows keep three digits, and forces fewer where rows are many."""
    model = model_of(name)
    data = fallen_states(model, 21)
    narrow, wide = lanes(model, data, dtype="float32"), lanes(model, data)
    for simulation in (narrow, wide):
        simulation.forward()
    for field in KINEMATIC:
        assert narrow.observed[field].dtype == np.float32
        assert apart(narrow.observed[field], wide.observed[field]) < 1e-5, field
    near = [apart(narrow.observed["cfrc_ext"][i], wide.observed["cfrc_ext"][i]) < 2e-2 for i in range(21)]
    assert np.mean(near) > 0.9, near


def seen(simulation, chosen=slice(None)):
    return b"".join(array[chosen].tobytes() for array in simulation.observed.values())


@pytest.fixture(scope="module", params=[("dog", "elliptic", "Euler", "float64"), ("heap", "pyramidal", "RK4", "float32"),
                                        ("heap", "elliptic", "RK4", "float64")], ids="-".join)
def case(request):
    made = after_six_steps(lanes, *request.param)
    assert np.abs(made[-1].observed["cfrc_ext"]).max() > 1
    return made


def test_mates_threads_and_calls_change_no_bit(case):
    model, data, options, expected = case
    order = np.random.default_rng(5).permutation(COUNT)
    shuffled = lanes(model, [data[i] for i in order], threads=3, **options)
    shuffled.step(nstep=6)
    assert seen(shuffled) == seen(expected, order)
    alone = lanes(model, [data[7]], **options)
    for _ in range(6):
        alone.step()
    assert seen(alone) == seen(expected, [7])


def test_what_is_observed_changes_no_step(case):
    model, data, options, expected = case
    plain = lanes(model, [copy.copy(one) for one in data], observes_bodies=False, **options)  # read() fills them
    plain.step(nstep=6)
    assert plain.hash() == expected.hash() and (plain.status == expected.status).all()
    assert plain.observed == {} and plain.read("cfrc_ext").shape == (COUNT, model.nbody, 6)


def test_who_fails_keeps_what_it_had_and_a_mask_leaves_the_rest(case):
    model, data, options, expected = case
    simulation = lanes(model, data, **options)
    simulation.step(nstep=4)
    had = seen(simulation, [5])
    simulation.qvel[5, 0] = np.nan
    simulation.step(nstep=2)
    rest = np.arange(COUNT) != 5
    assert simulation.failed.tolist() == [5] and seen(simulation, [5]) == had
    assert seen(simulation, rest) == seen(expected, rest)
    simulation.qvel[5] = 0
    simulation.qvel[5, 3:5] = 0.9 * np.finfo(simulation.qvel.dtype).max  # finite, but no product of them
    for call in (simulation.forward, simulation.step):
        call()
        assert simulation.failed.tolist() == [5] and seen(simulation, [5]) == had
    had = seen(simulation, rest)
    simulation.reset()
    simulation.forward(active=~rest)
    assert seen(simulation, rest) == had and not simulation.failed.size
    peer = mujoco.MjData(model)
    mujoco.mj_forward(model, peer)
    assert apart(simulation.observed["xpos"][5], peer.xpos) < 1e-5 and not simulation.observed["cvel"][5].any()


def test_what_is_observed_is_read_and_copied(case):
    model, _, _, expected = case
    for name in ALL:
        np.testing.assert_array_equal(expected.read(name), expected.observed[name])
        assert expected.read(name).shape == (COUNT, *getattr(mujoco.MjData(model), name).shape)
    for other in (copy.deepcopy(expected), pickle.loads(pickle.dumps(expected))):
        assert seen(other) == seen(expected)


def test_tendons_that_are_not_fixed_are_not_observed():
    model = mujoco.MjModel.from_xml_string("""<mujoco><worldbody><site name="a" pos="0 0 1"/><body><joint type="hinge"/>
      <geom type="sphere" size=".1" contype="0"/><site name="b" pos=".1 0 0"/></body></worldbody>
      <tendon><spatial><site site="a"/><site site="b"/></spatial></tendon></mujoco>""")
    simulation = lanes(model, 2)
    simulation.forward()
    assert simulation.read("xpos").shape == (2, 2, 3) and "ten_length" not in simulation.observed
    with pytest.raises(stiction.mujoco.UnsupportedModel, match="ten_length of tendons that are not fixed"):
        simulation.read("ten_length")
    assert lanes(model, 2, observes_bodies=False).read("ten_length").shape == (2, 1)
