"""Careless callers with simulations inside MuJoCo: wrong numbers, Ctrl-C, threads, small arenas."""

import signal
import threading

import numpy as np
import pytest

mujoco = pytest.importorskip("mujoco", reason="stiction.mujoco is NOT tested: pip install mujoco")

import stiction  # noqa: E402
import stiction.mujoco  # noqa: E402
from stiction.mujoco import memory_layout  # noqa: E402

SMALL = """<mujoco><option timestep="0.002"/><worldbody><geom type="plane" size="5 5 .1"/>
<body pos="0 0 .3"><freejoint/><geom type="box" size=".1 .1 .1"/></body>
<body pos="0 0 .6"><freejoint/><geom size=".1"/></body></worldbody></mujoco>"""


def test_simulations_that_there_are_not_are_refused_and_nothing_is_reset():
    """The number behind the last one of a smaller last chunk used to be written to."""
    model = mujoco.MjModel.from_xml_string(SMALL)
    chunk = stiction.mujoco.BatchedSimulation(model, 64, threads=1)._core.chunk_size()
    simulation = stiction.mujoco.BatchedSimulation(model, chunk + 1, threads=1)
    simulation.step(nstep=3)
    for chosen in ([chunk + 1], [0, -1], [2 * chunk - 1], [10**9]):
        for reset in (simulation.reset, simulation.reset_warm_start):
            with pytest.raises(ValueError, match=rf"simulations: expected numbers in 0\.\.{chunk}, got"):
                reset(chosen)
        with pytest.raises(stiction.Error, match=rf"simulations: expected numbers in 0\.\.{chunk}, got"):
            simulation._core.reset_warm_start(chosen)
    with pytest.raises(TypeError, match="got a mask: numpy.flatnonzero"):
        simulation.reset(np.ones(chunk + 1, bool))
    with pytest.raises(TypeError, match="simulations: expected an integer, got 1.5"):
        simulation.reset([0, 1.5])
    assert all(data.time > 0 for data in simulation.data)
    simulation.reset(np.array([0, chunk]))
    assert [i for i, data in enumerate(simulation.data) if data.time == 0] == [0, chunk]


def test_steps_are_counted_in_whole_numbers():
    simulation = stiction.mujoco.BatchedSimulation(mujoco.MjModel.from_xml_string(SMALL), 1)
    for count, error, message in ((-1, ValueError, "nstep: expected a number of steps of at least 0, got -1"),
                                  (1.5, TypeError, "nstep: expected an integer, got 1.5"), ("3", TypeError, "got '3'"),
                                  (2**31, ValueError, "nstep: expected an integer from")):
        with pytest.raises(error, match=message):
            simulation.step(nstep=count)
    simulation.step(nstep=0)
    assert simulation.data[0].time == 0


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="no timers of signals: Ctrl-C is NOT tested")
def test_ctrl_c_ends_a_call_of_many_steps_between_two_of_all_simulations():
    simulation = stiction.mujoco.BatchedSimulation(mujoco.MjModel.from_xml_string(SMALL), 17, threads=2)
    simulation.step()
    handler = signal.signal(signal.SIGALRM, signal.default_int_handler)
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.2)
        with pytest.raises(KeyboardInterrupt):
            simulation.step(nstep=200_000)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, handler)
    times = {data.time for data in simulation.data}
    assert len(times) == 1 and times.pop() > 0
    steps = simulation.solver.stats()["solves"]
    simulation.step(nstep=2)
    assert simulation.solver.stats()["solves"] == steps + 2, "records of the call that was broken off do not count"


def test_simulations_stepped_from_several_threads_wait_for_each_other():
    simulation = stiction.mujoco.BatchedSimulation(mujoco.MjModel.from_xml_string(SMALL), 3, threads=1)
    alone = stiction.mujoco.BatchedSimulation(simulation.model, 3, threads=1)
    threads = [threading.Thread(target=lambda: [simulation.step(nstep=4) for _ in range(10)]) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    alone.step(nstep=160)
    np.testing.assert_array_equal(simulation.read("qpos"), alone.read("qpos"))


@pytest.mark.skipif(memory_layout.handlers() == [0, 0], reason="MuJoCo before 4: its errors end the program, NOT tested")
def test_an_error_of_mujocos_is_an_exception_and_not_the_end_of_the_program():
    """The arena is too small once there are contacts; mujoco.mj_step raises mujoco.FatalError."""
    text = SMALL.replace("<worldbody>", '<size memory="2K"/><worldbody>').replace(
        "</worldbody>", '<body pos="1 0 1"><joint name="a"/><geom size=".1"/></body></worldbody>'
                        '<actuator><motor joint="a"/></actuator>')
    model = mujoco.MjModel.from_xml_string(text)
    simulation = stiction.mujoco.BatchedSimulation(model, 3, threads=1)
    simulation.data[1].qpos[2] = 0.095
    with pytest.raises(stiction.Error, match="(?s)simulation 1: MuJoCo: .*stack overflow.*reset\\(\\) it"):
        simulation.step()
    assert simulation.data[0].time == 0, "its chunk has gone no further"
    simulation.reset()
    simulation.step(nstep=20)
    assert [data.time for data in simulation.data] == pytest.approx([0.04] * 3)
    kept = simulation.data[2].qpos.copy()
    simulation.model.opt.integrator = 77
    with pytest.raises(stiction.Error, match="simulation 0: MuJoCo: integrator must be"):
        simulation.step()
    np.testing.assert_array_equal(simulation.data[2].qpos, kept)


def test_numbers_inside_mjdata_are_no_arrays_to_read():
    simulation = stiction.mujoco.BatchedSimulation(mujoco.MjModel.from_xml_string(SMALL), 1)
    with pytest.raises(ValueError, match="name: expected an array of numbers .* got 'energy'"):
        simulation.read("energy")
