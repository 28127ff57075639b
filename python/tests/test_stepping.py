"""The loop: warm starts by contact id, resets, room, the same on both devices."""

import numpy as np
import pytest

from stiction import Batch, ParallelContactSolver

IDS = np.arange(12, dtype=np.uint64).reshape(4, 3)


@pytest.fixture(params=["cpu", "emulated"])
def loop(request, padded):
    batch = Batch.from_delassus(padded.A, padded.b, cone_counts=padded.counts // 3, mu=0.7)
    return ParallelContactSolver(4, request.param, max_rows=9, max_cones=3, solver="npgs", tolerance=1e-8, beta=1.0), batch


def test_the_second_step_starts_from_the_first(loop):
    solver, batch = loop
    cold, warm = solver.step(batch, IDS, 0.01), solver.step(batch, IDS, 0.01)
    assert cold.iterations.max() > 0 and warm.iterations.max() == 0
    np.testing.assert_allclose(warm.lambda_, cold.lambda_, rtol=1e-15)  # scaled by mu and back: two roundings
    stats = solver.stats()
    assert stats["solves"] == 2 and stats["warm_start_hits"] == 6 and stats["warm_start_misses"] == 6


def test_contacts_are_known_by_their_ids(loop):
    solver, batch = loop
    solver.step(batch, IDS, 0.01)
    solver.step(batch, IDS + 100, 0.01)
    assert solver.stats()["warm_start_hits"] == 0


@pytest.mark.parametrize("which", ["ids", "mask", "all"])
def test_environments_that_start_over_start_from_zero(loop, which):
    solver, batch = loop
    cold = solver.step(batch, IDS, 0.01).iterations.copy()
    if which == "ids":
        solver.reset(ids=[0, 2])
    elif which == "mask":
        solver.reset(mask=np.array([True, False, True, False]))
    else:
        solver.reset()
    again = solver.step(batch, IDS, 0.01).iterations
    assert again[0] == cold[0] > 0 and again[2] == cold[2] > 0
    assert again[1] == (cold[1] if which == "all" else 0)


def test_numbers_are_read_in_place_at_every_step(loop, padded):
    solver, batch = loop
    first = solver.step(batch, IDS, 0.01).lambda_.copy()
    padded.b[0, :6] *= 2
    second = solver.step(batch, IDS, 0.01)
    assert (second.lambda_[0] != first[0]).any()
    np.testing.assert_allclose(second.lambda_[1:], first[1:], rtol=1e-15)  # scaled by mu and back: two roundings


def test_both_devices_step_through_the_same_bits(padded):
    runs = []
    for device in ("cpu", "emulated"):
        solver = ParallelContactSolver(4, device, max_rows=9, max_cones=3, tolerance=1e-6)
        rng = np.random.default_rng(0)
        b, counts, hashes = padded.b.copy(), padded.counts // 3, []
        batch = Batch.from_delassus(padded.A, b, cone_counts=counts, mu=0.7)
        for _ in range(5):
            b[:, :3] += rng.normal(size=(4, 3)) * 0.1
            counts[2] = rng.integers(1, 4)
            hashes.append(solver.step(batch, IDS, 0.01).hash())
        runs.append(hashes)
    assert runs[0] == runs[1] and len(set(runs[0])) == 5


def test_an_environments_steps_do_not_depend_on_its_neighbours(padded):
    def run(envs):
        solver = ParallelContactSolver(len(envs), max_rows=9, max_cones=3, tolerance=1e-6)
        batch = Batch.from_delassus(padded.A[envs].copy(), padded.b[envs].copy(), cone_counts=padded.counts[envs] // 3,
                                    mu=0.7)
        for _ in range(3):
            solution = solver.step(batch, IDS[envs], 0.01)
        return solution[0].lambda_

    np.testing.assert_array_equal(run([0]), run([0, 2, 1, 2, 3, 2, 1]))


def test_flat_batches_step_too(scenes):
    batch = Batch.from_delassus([s.A for s in scenes], [s.b for s in scenes], mu=0.7)
    solver = ParallelContactSolver(4, max_rows=9, max_cones=3, beta=1.0)
    ids = np.arange(6, dtype=np.int64)
    solver.step(batch, ids, 0.01)
    assert solver.step(batch, ids, 0.01).iterations.max() == 0


def test_a_queued_step_is_waited_for_by_its_status(padded):
    solver = ParallelContactSolver(4, "emulated", max_rows=9, max_cones=3)
    batch = Batch.from_delassus(padded.A, padded.b, cone_counts=padded.counts // 3, mu=0.7)
    solution = solver.step(batch, IDS, 0.01, stream=0)
    assert solution.solved.all() and (solution.lambda_[2, 0::3] > 0).any()
    assert solver.stats()["codes"] == {"solved": 4} and solver.stats()["warm_start_misses"] == 6
