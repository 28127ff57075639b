"""stiction.testing: it passes functions that do not depend on neighbours, and catches those that do."""

import numpy as np
import pytest

import stiction
from stiction.testing import assert_permutation_invariant


def matrices(count=6):
    """Contact problems of different sizes."""
    rng = np.random.default_rng(3)
    made = []
    for i in range(count):
        rows = 3 * (1 + i % 3)
        half = rng.normal(size=(rows, rows + 2))
        made.append((half @ half.T, rng.normal(size=rows)))
    return made


def solve(environments):
    A, b = zip(*environments)
    batch = stiction.Batch.from_delassus(list(A), list(b), mu=0.5, law="coulomb")
    solution = stiction.Solver(tolerance=1e-8).solve(batch)
    return [{"lambda": one.lambda_, "w": one.w, "status": one.status} for one in (solution[i] for i in range(len(A)))]


def test_it_passes_a_batch_of_stiction():
    assert_permutation_invariant(solve, matrices())


def test_it_passes_rollouts_of_mujoco():
    mujoco = pytest.importorskip("mujoco", reason="rollouts of MuJoCo are NOT tested: pip install mujoco")
    from stiction.mujoco import BatchedSimulation
    model = mujoco.MjModel.from_xml_string("""<mujoco><worldbody><geom type="plane" size="5 5 1"/>
        <body pos="0 0 .3"><freejoint/><geom type="capsule" size=".05 .1"/></body></worldbody></mujoco>""")

    def rollout(seeds):
        simulation = BatchedSimulation(model, len(seeds))
        for seed, data in zip(seeds, simulation.data):
            data.qvel[:] = np.random.default_rng(seed).normal(size=6)
        simulation.step(nstep=60)
        return [(data.qpos, data.qvel) for data in simulation.data]

    assert_permutation_invariant(rollout, range(5))


def leaning(lean):
    """A solver whose answers lean on something else than the environment."""
    def run(environments):
        total = np.float32(sum(float(b.sum()) for _, b in environments))
        return [np.float32(b) + lean(place, len(environments), total) for place, (_, b) in enumerate(environments)]
    return run


@pytest.mark.parametrize("lean", [
    pytest.param(lambda place, count, total: np.float32(1e-6 * place), id="its place"),
    pytest.param(lambda place, count, total: np.float32(0.25) if count == 1 else np.float32(0), id="being alone"),
    pytest.param(lambda place, count, total: np.float32(0.25) if count > 6 else np.float32(0), id="the batch's size"),
    pytest.param(lambda place, count, total: total * np.float32(1e-3), id="a sum over the batch"),
])
def test_it_catches_a_solver_that_leans_on(lean):
    with pytest.raises(AssertionError, match=r"environment \d of 6 returned other bits at place \d+ of \d+ .*differ"):
        assert_permutation_invariant(leaning(lean), matrices())


def test_an_honest_solver_passes():
    assert_permutation_invariant(leaning(lambda *_: np.float32(0)), matrices())


def test_one_bit_is_enough_and_is_named():
    def run(environments):
        return [np.array([1.0, 0.0 if place else -0.0]) for place in range(len(environments))]
    with pytest.raises(AssertionError, match=r"the result\[1\] is .*0\.0.*, and was .*0\.0.*; 1 of 2 numbers differ"):
        assert_permutation_invariant(run, range(3))


def test_nan_is_equal_to_itself():
    assert_permutation_invariant(lambda environments: [np.array([np.nan, 1.0])] * len(environments), range(3))


def test_memory_that_is_written_again_is_no_excuse():
    memory = np.zeros(8)

    def run(environments):
        memory[:len(environments)] = environments
        return [memory[i:i + 1] for i in range(len(environments))]
    assert_permutation_invariant(run, [0.5, 1.5, 2.5])


@pytest.mark.parametrize("run, environments, message", [
    (lambda environments: [], [1, 2], "run: expected one result for each of 2 environments, got 0"),
    (lambda environments: environments, [], "environments: expected at least one, got none"),
])
def test_wrong_use_is_said(run, environments, message):
    with pytest.raises(ValueError, match=message):
        assert_permutation_invariant(run, environments)


def test_a_result_of_another_shape_is_a_difference():
    def run(environments):
        return [np.zeros(len(environments)) for _ in environments]
    with pytest.raises(AssertionError, match=r"is float64 \(2,\), and was float64 \(3,\)"):
        assert_permutation_invariant(run, range(3))
