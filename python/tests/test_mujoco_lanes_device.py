"""BatchedSimulation(engine="lanes") on a device, which tests emulate: arrays stay in its memory, and no bit differs."""

import numpy as np
import pytest
from frameworks import OtherArray, framework
from lanes_models import fallen_states, model_of

import stiction.mujoco

COUNT = 5


def pair(dtype="float32", **options):
    """Equal simulations, on the CPU and on the device."""
    model = model_of("dog", "elliptic")
    data = fallen_states(model, COUNT, seed=3)
    return [stiction.mujoco.BatchedSimulation(model, data, engine="lanes", dtype=dtype, device=device, **options)
            for device in ("cpu", "emulated")]


def expect_same(here, there):
    for name in ("qpos", "qvel", "ctrl", "qfrc_applied", "qacc", "time"):
        assert np.asarray(getattr(here, name)).tobytes() == np.asarray(getattr(there, name)).tobytes(), name
    for name, array in here.observed.items():
        assert array.tobytes() == np.asarray(there.observed[name]).tobytes(), name
    assert (here.status == there.status).all() and here.hash() == there.hash()


@pytest.mark.parametrize("dtype", ["float32", "float64"])
def test_what_is_written_resets_and_breaks_between_steps_is_as_on_the_cpu(dtype):
    both = pair(dtype, observes_bodies=True, varies=("body_mass", "geom_friction", "actuator_gainprm"))
    rng = np.random.default_rng(1)
    controls = rng.uniform(-1, 1, (6, COUNT, both[0].model.nu))
    for simulation in both:
        simulation.step(controls[0], nstep=2)
        simulation.varied["body_mass"][:] *= 1.125
        simulation.varied["geom_friction"][2] *= 0.5
        simulation.step(controls[1], active=np.arange(COUNT) != 3)
        simulation.qpos[1, 2] += 0.01
        simulation.qvel[[0, 4]] = 0.25
        simulation.qfrc_applied[2][3] = 1.5
        simulation.step(controls[2])
        simulation.qvel[4, 0] = np.nan
        simulation.step(controls[3], nstep=3)
        assert simulation.failed.tolist() == [4] and simulation.solved.tolist() == [True] * 4 + [False]
        simulation.reset([4, 0])
        assert simulation.time[4] == 0 < simulation.time[1]
        simulation.reset_warm_start([1])
        simulation.step(controls[4])
        simulation.data[2].qpos[2] += 0.01
        simulation.take([2])
        simulation.forward()
        simulation.step(controls[5])
    expect_same(*both)
    assert both[0].probe()["M"].tobytes() == both[1].probe()["M"].tobytes()
    assert (both[0].read("xpos") == both[1].read("xpos")).all()
    assert (both[0].read("qvel") == both[1].read("qvel")).all()
    assert (both[0].data[3].qacc_warmstart == both[1].data[3].qacc_warmstart).all()


def test_a_device_array_is_the_memory_that_steps_write():
    here, there = pair(observes_bodies=True)
    qpos, ctrl = np.from_dlpack(there.qpos), np.from_dlpack(there.ctrl)
    cvel = np.from_dlpack(there.observed["cvel"])
    held = there.qpos[2]
    for k in range(3):
        here.ctrl[1] = ctrl[1] = 0.1 * k
        here.step(nstep=2)
        there.step(nstep=2)
        assert held.tolist() == here.qpos[2].tolist()  # waits for the steps
        assert qpos.tobytes() == here.qpos.tobytes() and cvel.tobytes() == here.observed["cvel"].tobytes()
        here.qpos[0, 1] = there.qpos[0, 1] = 0.5
        assert qpos[0, 1] == 0.5
        qpos[3] += 0.01
        here.qpos[3] += np.float32(0.01)
    expect_same(here, there)
    del there, held
    assert qpos.tobytes() == here.qpos.tobytes()  # it keeps the memory alive


def test_controls_of_the_device_are_taken_where_they_are():
    here, there = pair()
    ctrl = np.random.default_rng(2).uniform(-1, 1, here.ctrl.shape).astype(np.float32)
    here.step(ctrl)
    there.step(OtherArray(ctrl))
    expect_same(here, there)
    for wrong, error, text in (
            (ctrl.astype(np.float64), TypeError, r"ctrl: expected float32 \(5, 8\) C-contiguous on cpu, got float64"),
            (ctrl[:, :3].copy(), ValueError, r"ctrl: expected float32 \(5, 8\) .*, got float32 \(5, 3\)"),
            (ctrl.T.copy().T, ValueError, "make it contiguous first")):
        with pytest.raises(error, match=text):
            there.step(OtherArray(wrong))
    with pytest.raises(ValueError, match=r"ctrl: expected \(5, 8\), got \(5, 3\)"):
        there.step(ctrl[:, :3])
    expect_same(here, there)


def test_a_device_array_reads_like_numpy():
    here, there = pair()
    for array, other in ((here.qpos, there.qpos), (here.qpos[1:3], there.qpos[1:3]), (here.time, there.time)):
        assert other.shape == array.shape and len(other) == len(array) and other.dtype == array.dtype
        assert other.ndim == array.ndim and other.size == array.size
        assert (np.asarray(other, np.float64) == array.astype(np.float64)).all()
        assert (other + 1 == array + 1).all() and (2 - other == 2 - array).all() and not (other != array).any()
        assert np.abs(other).max() == np.abs(array).max() and other.sum() == array.sum()
        assert [row.tolist() for row in other] == [row.tolist() for row in array]
    assert float(there.qpos[1, 2]) == there.qpos[1][2] == here.qpos[1, 2]
    assert (there.qpos[[3, 0]] == here.qpos[[3, 0]]).all()
    part = there.qpos[1:3]
    part *= 2
    part[0][2] = 7
    assert there.qpos[1, 2] == 7 and (there.qpos[2] == 2 * here.qpos[2]).all()
    there.qvel[...] = there.qvel[::-1]
    assert (there.qvel == here.qvel[::-1]).all()
    assert "qpos (5, 15) float32 on emulated" in repr(there.qpos)


def test_copies_of_the_host_cannot_be_taken_for_the_device():
    there = pair()[1]
    with pytest.raises(ValueError, match="read-only"):
        there.qpos.numpy()[0, 0] = 1
    with pytest.raises(ValueError, match="read-only"):
        there.qpos.fill(0)
    with pytest.raises(ValueError, match="qpos: expected copy=None or True, got False: the array is in memory of emulated"):
        np.asarray(there.qpos, copy=False) if np.lib.NumpyVersion(np.__version__) >= "2.0.0" else \
            there.qpos.__array__(copy=False)
    with pytest.raises(ValueError, match="qpos: expected the whole array for DLPack, got a part of it"):
        np.from_dlpack(there.qpos[1:])
    with pytest.raises(AttributeError, match="nothing"):
        there.qpos.nothing
    with pytest.raises(AttributeError):
        there.qpos = np.zeros(3)


def test_torch_shares_the_memory():
    torch = framework("torch")
    here, there = pair()
    qvel = torch.from_dlpack(there.qvel)
    ctrl = torch.full(tuple(there.ctrl.shape), 0.25)
    here.step(ctrl.numpy())
    there.step(ctrl)
    there.synchronize()
    assert qvel.numpy().tobytes() == here.qvel.tobytes()
    qvel.zero_()
    here.qvel[:] = 0
    here.step()
    there.step()
    expect_same(here, there)
