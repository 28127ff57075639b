"""Cones of semidefinite from Python: projections against numpy.linalg.eigh, solutions against Clarabel."""

import numpy as np
import pytest

import stiction
from stiction import Batch, Solver, semidefinite_matrix, semidefinite_vector
from stiction.learning import Guess

SOLVERS = ["auto", "admm", "apgd", "jacobi"]


def test_rows_and_matrices_are_each_other():
    S = np.array([[1.0, 2.0, 3.0], [2.0, 4.0, 5.0], [3.0, 5.0, 6.0]])
    root = np.sqrt(2.0)
    np.testing.assert_array_equal(semidefinite_vector(S), [1, 2 * root, 4, 3 * root, 5 * root, 6])
    np.testing.assert_array_equal(semidefinite_vector(S[:2, :2]), [1, 2 * root, 4])
    rng = np.random.default_rng(1)
    T = rng.normal(size=(5, 3, 3))
    T = T + np.swapaxes(T, 1, 2)
    np.testing.assert_allclose(semidefinite_matrix(semidefinite_vector(T)), T, rtol=1e-15)
    inner = (semidefinite_vector(T[0]) * semidefinite_vector(T[1])).sum()
    np.testing.assert_allclose(inner, np.trace(T[0] @ T[1]), rtol=1e-13)
    with pytest.raises(ValueError, match="S: expected matrices"):
        semidefinite_vector(np.eye(4))
    with pytest.raises(ValueError, match="rows: expected"):
        semidefinite_matrix(np.ones(4))


# With A = I the answer is the projection of -b.
@pytest.mark.parametrize("order", [2, 3])
@pytest.mark.parametrize("solver", SOLVERS)
def test_the_nearest_matrix_is_that_of_eigh(solver, order):
    rng = np.random.default_rng(order)
    S = rng.normal(size=(200, order, order))
    S = S + np.swapaxes(S, 1, 2)
    value, vector = np.linalg.eigh(S)
    nearest = np.einsum("...ik,...k,...jk->...ij", vector, np.maximum(value, 0), vector)
    b = np.ascontiguousarray(-semidefinite_vector(S))
    batch = Batch.from_delassus(np.broadcast_to(np.eye(b.shape[1]), (200, b.shape[1], b.shape[1])).copy(), b,
                                cones=[("semidefinite", b.shape[1])])
    solution = Solver(solver=solver, tolerance=1e-13, max_iterations=1000).solve(batch)
    assert solution.solved.all()
    np.testing.assert_allclose(semidefinite_matrix(np.asarray(solution.lambda_)), nearest, atol=1e-12)


def problem(seed, cones, shift):
    """A, b, mu, R, lo and hi of random numbers, A symmetric and positive definite."""
    rng = np.random.default_rng(seed)
    n = sum(rows for _, rows in cones)
    G = rng.normal(size=(n, n))
    A = G @ G.T / n + shift * np.eye(n)
    kind_of_row = np.concatenate([[kind] * rows for kind, rows in cones])
    lo, hi = np.where(kind_of_row == "box", -rng.uniform(size=n), 0.0), np.where(kind_of_row == "box", rng.uniform(size=n), 0)
    return A, 2 * rng.normal(size=n), rng.uniform(0.2, 1, size=n), np.full(n, 0.01), lo, hi


def by_clarabel(cones, A, b, mu, R, lo, hi):
    """The minimiser of 1/2 l'(A + R)l + b'l with l in the cones, and by how much its value may be off."""
    clarabel = pytest.importorskip("clarabel", reason="Clarabel is not installed: its answers are not compared")
    sparse = pytest.importorskip("scipy.sparse", reason="SciPy is not installed: Clarabel's answers are not compared")
    n = len(b)
    rows, offsets, kinds, first = [], [], [], 0
    for kind, size in cones:
        unit = np.eye(n)[first:first + size]
        if kind == "friction":
            unit[1:] /= mu[first + 1:first + size, None]
            kinds.append(clarabel.SecondOrderConeT(size))
        elif kind == "semidefinite":
            kinds.append(clarabel.PSDTriangleConeT(2 if size == 3 else 3))
        elif kind == "unilateral":
            kinds.append(clarabel.NonnegativeConeT(1))
        elif kind == "box":
            kinds.append(clarabel.NonnegativeConeT(2))
            unit = np.concatenate([unit, -unit])
            offsets += [-lo[first], hi[first]]
        if kind != "free":
            rows.append(-unit)
            if kind != "box":
                offsets += [0.0] * size
        first += size
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-12
    answer = clarabel.DefaultSolver(sparse.triu(sparse.csc_matrix(A + np.diag(R)), format="csc"), b,
                                    sparse.csc_matrix(np.concatenate(rows)), np.array(offsets), kinds, settings).solve()
    assert str(answer.status) in ("Solved", "AlmostSolved")
    return np.array(answer.x), max(abs(answer.obj_val - answer.obj_val_dual), 1e-13)


MIXES = {"one of order 2": [("semidefinite", 3)],
         "one of order 3": [("semidefinite", 6)],
         "matrices": [("semidefinite", 6), ("semidefinite", 3), ("semidefinite", 6)],
         "all kinds": [("friction", 3), ("semidefinite", 6), ("box", 1), ("friction", 4), ("semidefinite", 3), ("free", 1),
                       ("unilateral", 1), ("semidefinite", 6)],
         "more than 64 rows": [("semidefinite", 6), ("friction", 3), ("semidefinite", 3), ("box", 1)] * 6}


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("mix", MIXES)
def test_solutions_are_clarabels(mix, solver):
    cones = MIXES[mix]
    problems = [problem(seed, cones, 0.2) for seed in range(3)]
    A, b, mu, R, lo, hi = (list(arrays) for arrays in zip(*problems))
    solution = Solver(solver=solver, tolerance=1e-10, max_iterations=50000).solve(
        Batch.from_delassus(A, b, cones=cones, mu=mu, R=R, lo=lo, hi=hi))
    assert solution.solved.all()
    single = [[np.asarray(array, np.float32) for array in own] for own in (A, b, mu, R, lo, hi)]
    narrow = Solver(solver=solver, tolerance=1e-5, max_iterations=50000).solve(
        Batch.from_delassus(*single[:2], cones=cones, mu=single[2], R=single[3], lo=single[4], hi=single[5]))
    assert narrow.solved.all()
    # The smallest eigenvalue of A is 0.2 at least. Hence 0.1 |l - l*|^2 is less than the error of l's value. And an
    # answer is off by five times its residual at most.
    for own, found, rough in zip(problems, np.split(np.ravel(solution.lambda_), 3), np.split(np.ravel(narrow.lambda_), 3)):
        expected, gap = by_clarabel(cones, *own)
        assert gap < 1e-7
        np.testing.assert_allclose(found, expected, rtol=0, atol=np.sqrt(10 * gap) + 5e-9)
        np.testing.assert_allclose(rough, expected, rtol=0, atol=1e-3)
        A, b, R = own[0], own[1], own[3]
        value = [0.5 * l @ (A @ l + R * l) + b @ l for l in (found, expected)]
        assert abs(value[0] - value[1]) < 2 * gap + 1e-9


def test_other_solvers_say_who_takes_it():
    batch = Batch.from_delassus(np.eye(3)[None], np.ones((1, 3)), cones="semidefinite")
    with pytest.raises(stiction.Error, match="choose jacobi, apgd, admm or auto"):
        Solver(solver="npgs").solve(batch)


def test_a_file_keeps_it(tmp_path):
    batch = Batch.from_delassus(np.eye(6)[None], np.arange(6.0)[None] - 3, cones=[("semidefinite", 6)])
    batch.save(tmp_path / "matrices.h5")
    again = Batch.from_file(tmp_path / "matrices.h5")
    assert Solver(tolerance=1e-10).solve(again).hash() == Solver(tolerance=1e-10).solve(batch).hash()


def test_guesses_that_are_not_finite_are_dropped():
    """NumPy finds no eigenvalues of NaN, and raises."""
    A, b = np.tile(np.eye(6), (2, 1, 1)), np.tile([-1.0, 0.0, -2.0, 0.5, 0.0, 3.0], (2, 1))
    batch = Batch.from_delassus(A, b, cones=[("semidefinite", 6)])
    guess, ids = Guess([lambda step: np.r_[np.full(6, np.nan), np.ones(6)], "last"]), np.array([[1], [2]])
    for _ in range(2):
        solution = Solver(tolerance=1e-9).solve(batch, guess=guess, ids=ids)
        assert solution.solved.all() and guess.chosen[0] == 1
    assert guess.stats()["dropped"] == {"<lambda>": 2, "last": 0}


def test_a_loop_on_a_device_has_room_for_matrices_where_it_is_told_to():
    A, b = np.tile(np.eye(6), (2, 1, 1)), np.tile([-1.0, 0.0, -2.0, 0.5, 0.0, 3.0], (2, 1))
    batch, ids = Batch.from_delassus(A, b, cones=[("semidefinite", 6)]), np.array([[1], [2]])
    hashes = set()
    for device, options in (("cpu", {}), ("emulated", {"semidefinite": True})):
        solver = stiction.SteppingSolver(2, device, max_rows=6, **options)
        solution = solver.step(batch, ids, 0.01)
        assert solution.solved.all()
        hashes.add(solution.hash())
    assert len(hashes) == 1
    with pytest.raises(ValueError, match="construct the solver with semidefinite=True"):
        stiction.SteppingSolver(2, "emulated", max_rows=6).step(batch, ids, 0.01)
