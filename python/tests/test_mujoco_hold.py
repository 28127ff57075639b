"""One simulation that fails among many: it is named and held, and no other one has a bit of it."""

import numpy as np
import pytest

LACKING = "simulations held after a failure are NOT tested: pip install mujoco"
mujoco = pytest.importorskip("mujoco", reason=LACKING)

from stiction.mujoco import BatchedSimulation  # noqa: E402

XML = """<mujoco><option timestep="0.004"/><worldbody><geom type="plane" size="5 5 1"/>
  <body pos="0 0 .2"><freejoint/><geom type="capsule" size=".05 .1"/></body></worldbody></mujoco>"""


def simulations(count, over=None, **options):
    """Makes so many simulations; over: the mjData of others, used again."""
    if over is None:
        made = BatchedSimulation(mujoco.MjModel.from_xml_string(XML), count, **options)
    else:
        made = BatchedSimulation(over.model, list(over.data), **options)
    for i, data in enumerate(made.data):
        mujoco.mj_resetData(made.model, data)
        data.qvel[:] = np.random.default_rng(i).normal(size=6) / 2
    return made


def states(simulation):
    return np.array([np.concatenate([data.qpos, data.qvel]) for data in simulation.data])


def poison_state(data):
    data.qvel[3] = np.nan


def poison_force(data):
    data.xfrc_applied[1, 2] = np.inf


def throw(data):
    """Finite, and more than MuJoCo takes by the end of the step."""
    data.xfrc_applied[1, 2] = 9.9e9
    data.qvel[2] = 9.999e9


@pytest.mark.parametrize("count, bad, poison, nstep", [
    (512, 123, poison_state, 1), (64, 63, poison_force, 1), (64, 0, throw, 1),
    (64, 31, throw, 3),  # MuJoCo resets it in the second step, and the third ends well
])
def test_one_of_many_fails_and_is_held(count, bad, poison, nstep):
    clean = simulations(count)
    clean.step(nstep=2)
    clean.step(nstep=nstep)
    expected = states(clean)
    dirty = simulations(count, over=clean, hold_failed=True)
    dirty.step(nstep=2)
    assert clean.failed is None and dirty.failed.size == 0
    if poison is throw:  # the state that the step begins with is good, and is held
        poison(dirty.data[bad])
    good = states(dirty)[bad]
    poison(dirty.data[bad])
    dirty.step(nstep=nstep)
    assert dirty.failed.tolist() == [bad]
    others = np.arange(count) != bad
    assert states(dirty)[others].tobytes() == expected[others].tobytes()
    assert states(dirty)[bad].tobytes() == good.tobytes()


def test_it_goes_on_from_there():
    simulation = simulations(3, hold_failed=True)
    simulation.step(nstep=5)
    poison_state(simulation.data[1])
    simulation.step()
    held = states(simulation)[1]
    simulation.step()
    assert simulation.failed.size == 0
    after = states(simulation)[1]
    assert np.isfinite(after).all() and not np.array_equal(after, held)
    assert simulation.data[1].time == pytest.approx(simulation.data[0].time - 0.004)  # a step was taken back


def test_without_it_mujoco_starts_over():
    simulation = simulations(2)
    simulation.step(nstep=5)
    poison_state(simulation.data[1])
    simulation.step()
    assert simulation.data[1].time == pytest.approx(0.004)  # MuJoCo has reset it and stepped from there


def test_one_that_never_was_good_starts_over_and_inactive_ones_are_left_alone():
    simulation = simulations(3, hold_failed=True)
    for i in (0, 1):
        poison_state(simulation.data[i])
    simulation.step(active=[True, False, True])
    assert simulation.failed.tolist() == [0]
    assert np.isfinite(states(simulation)[0]).all() and simulation.data[0].time == 0
    assert np.isnan(simulation.data[1].qvel[3]) and simulation.data[2].time > 0
