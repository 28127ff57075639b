"""Derivatives of accelerations inside MuJoCo: against differences of its forward dynamics, positions held."""

import numpy as np
import pytest

mujoco = pytest.importorskip("mujoco", reason="stiction.mujoco's derivatives are NOT tested: pip install mujoco")

import stiction  # noqa: E402
import stiction.mujoco  # noqa: E402
from mujoco_zoo import controls, zoo  # noqa: E402

N = 3


def simulations(cone, steps=30):
    """Simulations of one model that have gone apart, on the way to contact and in it."""
    model = zoo(cone)
    model.opt.iterations = 1  # of MuJoCo's own solver, which has no part in this
    simulation = stiction.mujoco.BatchedSimulation(model, N, solver="newton", tolerance=1e-13, max_iterations=200)
    for step in range(steps):
        simulation.step(np.array([controls(model, step) * (i + 1) / N for i in range(N)]))
    rng = np.random.default_rng(3)
    for data in simulation.data:
        data.qvel += rng.normal(scale=0.3, size=model.nv)  # so that something slides
    simulation.forward()
    return simulation


@pytest.mark.parametrize("cone", ["pyramidal", "elliptic"])
def test_gradients_are_those_of_differences_of_forward_dynamics(cone):
    simulation = simulations(cone)
    rng, nv = np.random.default_rng(1), simulation.model.nv
    bar = rng.normal(size=(N, nv))
    gradients = simulation.pull(bar)
    assert gradients.valid.all() and not gradients.flagged("subgradient").any()
    assert all(data.nefc > 10 for data in simulation.data)

    def difference(change, step):
        """Differences of <bar, qacc> and of qacc_smooth, by simulation, along a change that is made and taken back."""
        ends = []
        for sign in (1, -1):
            change(sign * step)
            simulation.forward()
            ends.append((np.array([data.qacc for data in simulation.data]),
                         np.array([data.qacc_smooth for data in simulation.data])))
            change(-sign * step)
        return ((np.sum((ends[0][0] - ends[1][0]) * bar, 1) / (2 * step)), (ends[0][1] - ends[1][1]) / (2 * step))

    along = rng.normal(size=(N, nv))

    def push(step):
        for data, direction in zip(simulation.data, along):
            data.qfrc_applied += step * direction

    found, _ = difference(push, 1e-4)
    assert found == pytest.approx(np.sum(gradients.qfrc * along, 1), rel=1e-5, abs=1e-6)

    def move(step):
        for data, direction in zip(simulation.data, along):
            data.qvel += step * direction

    found, smooth = difference(move, 1e-6)
    expected = np.sum(gradients.qvel * along, 1) + np.sum(gradients.qacc_smooth * smooth, 1)
    assert found == pytest.approx(expected, rel=1e-5, abs=1e-4)

    if cone == "elliptic":
        mu = np.split(simulation.batch().arrays["mu"], np.cumsum([data.nefc for data in simulation.data])[:-1])
        friction = simulation.model.geom_friction.copy()

        def rub(step):
            simulation.model.geom_friction += step * friction

        found, _ = difference(rub, 1e-4)
        expected = [part @ own for part, own in zip(gradients.friction, mu)]
        assert found == pytest.approx(expected, rel=1e-4, abs=1e-5)
        assert np.any(expected)


def test_a_force_is_a_derivative_too():
    simulation = simulations("elliptic")
    rng = np.random.default_rng(2)
    bars = [rng.normal(size=data.nefc) for data in simulation.data]
    gradients = simulation.pull(np.zeros((N, simulation.model.nv)), bars)
    along, step, ends = rng.normal(size=(N, simulation.model.nv)), 1e-4, []
    for sign in (1, -1):
        for data, direction in zip(simulation.data, along):
            data.qfrc_applied[:] = sign * step * direction
        simulation.forward()
        ends.append([data.efc_force @ bar for data, bar in zip(simulation.data, bars)])
    difference = (np.array(ends[0]) - np.array(ends[1])) / (2 * step)
    assert difference == pytest.approx(np.sum(gradients.qfrc * along, 1), rel=1e-5, abs=1e-5)


def test_mistakes_name_the_argument():
    simulation = simulations("elliptic", steps=1)
    with pytest.raises(ValueError, match="accelerations: expected"):
        simulation.pull(np.zeros(simulation.model.nv))
    with pytest.raises(ValueError, match="forces: expected"):
        simulation.pull(np.zeros((N, simulation.model.nv)), [np.zeros(1)] * N)
    simulation.forward(active=[True, False, True])
    with pytest.raises(ValueError, match="active: expected"):
        simulation.pull(np.zeros((N, simulation.model.nv)))
