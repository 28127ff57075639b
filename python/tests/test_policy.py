"""Accuracy by rule, down to the iterations that solves make."""

import numpy as np
import pytest

from stiction import AccuracyPolicy, Batch, Solver


def chapters_config(training_step, total_steps):
    """Section 6.2 of the source chapter, as printed."""
    progress = training_step / total_steps
    if progress < 0.3:
        iterations, tolerance = 5, 1e-2
    elif progress < 0.7:
        iterations, tolerance = 10, 1e-3
    else:
        iterations, tolerance = 20, 1e-4
    return tolerance, iterations


def test_the_chapters_curriculum():
    policy = AccuracyPolicy.curriculum()
    steps = 1000
    expected = [chapters_config(step, steps) for step in range(steps + 1)]
    assert [policy.apply(progress=step / steps) for step in range(steps + 1)] == expected
    accuracy = policy.apply(progress=np.arange(steps + 1) / steps)
    assert list(zip(accuracy.tolerance.tolist(), accuracy.max_iterations.tolist())) == expected
    # The thresholds themselves, which belong to the later stage.
    assert [policy.apply(progress=p) for p in (np.nextafter(0.3, 0), 0.3, np.nextafter(0.7, 0), 0.7)] == [
        (1e-2, 5), (1e-3, 10), (1e-3, 10), (1e-4, 20)]


def test_a_custom_curriculum_by_environment():
    policy = AccuracyPolicy.curriculum([(0, 2, 1e-1), (0.5, 40, 1e-5)])
    accuracy = policy.apply(progress=np.array([0.1, 0.5, 0.9]))
    assert accuracy.max_iterations.tolist() == [2, 40, 40] and accuracy.tolerance.tolist() == [1e-1, 1e-5, 1e-5]


def test_entropy_buys_iterations():
    policy = AccuracyPolicy.entropy(base=10, alpha=0.5, tolerance=1e-6)
    assert policy.apply(entropy=2.0) == (1e-6, 20)
    assert policy.apply(entropy=np.array([0, 1, -3, 2.1])).max_iterations.tolist() == [10, 15, 10, 20]


def test_presets_and_fixed_numbers():
    assert AccuracyPolicy.preset("grasping").apply().tolerance == 1e-4
    assert AccuracyPolicy.fixed(1e-5, 50).apply(progress=0.3, entropy=1) == (1e-5, 50)


def test_limits_reach_every_environment(padded):
    batch = Batch.from_delassus(padded.A, padded.b, counts=padded.counts, mu=0.7)
    solver = Solver(solver="npgs", tolerance=1e-3)
    batch.set_accuracy(AccuracyPolicy.fixed(0.0, np.array([3, 5, 7, 9])).apply())
    assert solver.solve(batch).iterations[[0, 2]].tolist() == [3, 7]
    batch.set_accuracy(AccuracyPolicy.fixed(1e-9, 500).apply())
    fine = solver.solve(batch)
    assert fine.residual.max() <= 1e-9 and fine.solved.all()


def test_limits_are_read_in_place(padded):
    tolerance = np.full(4, 1e-2)
    batch = Batch.from_delassus(padded.A, padded.b, counts=padded.counts, mu=0.7, env_tolerance=tolerance)
    solver = Solver(solver="npgs")
    coarse = solver.solve(batch).iterations.sum()
    tolerance[:] = 1e-10
    assert solver.solve(batch).iterations.sum() > coarse


@pytest.mark.parametrize("device", ["cpu", "emulated"])
@pytest.mark.parametrize("form", ["delassus", "jacobian"])
def test_a_tolerance_of_nan_is_the_solvers(padded, form, device):
    def hashes(tolerance, own):
        if form == "delassus":
            batch = Batch.from_delassus(padded.A, padded.b, counts=padded.counts, mu=0.7, env_tolerance=own)
        else:
            rng = np.random.default_rng(3)
            J, M = rng.standard_normal((4, 6, 7)), np.tile(np.eye(7), (4, 1, 1))
            batch = Batch.from_jacobian(J, M, rng.standard_normal((4, 7)), mu=0.7, R=np.full((4, 6), 1e-2),
                                        env_tolerance=own)
        answer = Solver(tolerance=tolerance, device=device).solve(batch)
        return [answer.lambda_[env].tobytes() for env in range(4)], answer.iterations.tolist()

    coarse, fine = hashes(1e-1, None), hashes(1e-9, None)
    own = np.array([np.nan, 1e-9, -1.0, np.nan])
    for k in (0, 1):
        expected = [fine[k][env] if own[env] >= 0 else coarse[k][env] for env in range(4)]
        assert hashes(1e-1, own)[k] == expected
    assert coarse != fine
