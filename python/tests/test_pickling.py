"""Batches, solutions and solvers in another process, or beside themselves."""

import copy
import multiprocessing
import pickle

import numpy as np
import pytest
from frameworks import framework

import stiction


def delassus_arrays(environments=5, contacts=3):
    rng = np.random.default_rng(8)
    rows = 3 * contacts
    J = rng.normal(size=(environments, rows, rows + 2))
    return J @ J.transpose(0, 2, 1), rng.normal(size=(environments, rows))


def padded():
    A, b = delassus_arrays()
    return stiction.Batch.from_delassus(A, b, mu=0.5, cone_counts=np.array([3, 1, 0, 2, 3], np.int32), law="coulomb")


def listed():
    A, b = delassus_arrays()
    return stiction.Batch.from_delassus([A[0], A[1][:3, :3]], [b[0], b[1][:3]], mu=0.5)


def jacobian():
    rng = np.random.default_rng(4)
    M = np.eye(7) + 0.1 * np.ones((4, 7, 7))
    return stiction.Batch.from_jacobian(rng.normal(size=(4, 6, 7)), M, rng.normal(size=(4, 7)), mu=0.7, R=np.full((4, 6), 0.01))


def bodies():
    arrays = dict(inv_mass=np.ones((2, 1)), inv_inertia=np.tile([1.0, 0, 0, 1, 0, 1], (2, 1, 1)),
                  twist=np.tile([0.3, 0, -1, 0, 0, 0], (2, 1, 1)), body_a=np.zeros((2, 1), np.int32),
                  body_b=np.full((2, 1), -1, np.int32), arm_a=np.zeros((2, 1, 3)), arm_b=np.zeros((2, 1, 3)),
                  normal=np.tile([0.0, 0, 1], (2, 1, 1)), depth=np.zeros((2, 1)), mu=np.full((2, 1), 0.5))
    return stiction.Batch.from_bodies(**arrays)


def solved(batch):
    return stiction.Solver(tolerance=1e-8, threads=1).solve(batch)


@pytest.mark.parametrize("make", [padded, listed, jacobian, bodies])
@pytest.mark.parametrize("again", [lambda it: pickle.loads(pickle.dumps(it)), copy.deepcopy], ids=["pickle", "deepcopy"])
def test_a_batch_that_came_through_has_the_same_answer(make, again):
    batch = make()
    came = again(batch)
    assert solved(came).hash() == solved(batch).hash()


def test_a_copy_has_arrays_of_its_own_and_reads_them_anew():
    batch = padded()
    before = solved(batch).hash()
    came = copy.deepcopy(batch)
    came.arrays["b"][0] -= 1.0
    came.arrays["cone_counts"][2] = 3
    assert solved(batch).hash() == before
    changed = solved(came)
    assert changed.hash() != before
    A, _ = delassus_arrays()
    expected = solved(stiction.Batch.from_delassus(A, came.arrays["b"], mu=0.5, law="coulomb",
                                                   cone_counts=came.arrays["cone_counts"]))
    assert changed.hash() == expected.hash()


def test_a_solution_comes_through_with_its_status_and_takes_the_next_answer():
    batch = padded()
    solution = solved(batch)
    came = pickle.loads(pickle.dumps(solution))
    np.testing.assert_array_equal(came.lambda_, solution.lambda_)
    np.testing.assert_array_equal(came.status, solution.status)
    assert came.hash() == solution.hash() and came[1].status["code"] == solution[1].status["code"]
    came.lambda_[:] = 7.0
    stiction.Solver(tolerance=1e-8, threads=1).solve(batch, out=came)
    assert came.hash() == solution.hash()


def test_a_solver_that_came_through_has_its_settings_and_nothing_else():
    solver = stiction.Solver(solver="npgs", tolerance=1e-7, max_iterations=77, threads=1, omega=0.9)
    solver.solve(padded())
    for came in (copy.copy(solver), copy.deepcopy(solver), pickle.loads(pickle.dumps(solver))):
        assert (came.solver, came.tolerance, came.max_iterations) == ("npgs", 1e-7, 77)
        assert came.stats()["solves"] == 0 and solver.stats()["solves"] == 1
        assert came.solve(padded()).hash() == stiction.Solver(
            solver="npgs", tolerance=1e-7, max_iterations=77, threads=1, omega=0.9).solve(padded()).hash()


def _hash(solver, batch):
    return solver.solve(batch).hash()


def test_another_process_has_the_same_bits():
    solver, batch = stiction.Solver(tolerance=1e-8, threads=1), padded()
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        assert pool.apply_async(_hash, (solver, batch)).get(timeout=100) == solved(batch).hash()


def test_tensors_come_through_as_tensors():
    torch = framework("torch")
    A, b = delassus_arrays()
    batch = stiction.Batch.from_delassus(torch.from_numpy(A), torch.from_numpy(b), mu=0.5)
    came = pickle.loads(pickle.dumps(batch))
    solution = solved(came)
    assert isinstance(solution.lambda_, torch.Tensor) and solution.hash() == solved(batch).hash()


def test_masks_and_foreign_byte_orders_are_refused():
    A, b = delassus_arrays()
    with pytest.raises(TypeError, match="A: expected an array without a mask, got one with: give A.filled"):
        stiction.Batch.from_delassus(np.ma.masked_array(A, A < 0), b)
    with pytest.raises(TypeError, match=r"b: expected this machine's byte order, got >f8: give b.astype\('float64'\)"):
        stiction.Batch.from_delassus(A, b.astype(">f8"))
