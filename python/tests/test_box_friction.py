"""Boxed friction from Python: answers by hand, lists, padded arrays, files and PyTorch; refusals."""

import numpy as np
import pytest
from frameworks import framework

import stiction
from stiction import Batch, Solver

# A contact pressed with 2 on mu = 1/2, pushed beyond both bounds: its corner, which no cone has.
A, B, CORNER = np.eye(3)[None], np.array([[-2.0, 3.0, -4.0]]), [2.0, -1.0, 1.0]


@pytest.mark.parametrize("law", ["convex", "coulomb"])
@pytest.mark.parametrize("solver", ["auto", "pgs", "npgs", "nsgs", "jacobi", "subspace", "lemke"])
def test_each_axis_has_its_own_bound(solver, law):
    batch = Batch.from_delassus(A, B, cones="box_friction", mu=0.5, law=law)
    solution = Solver(solver=solver, tolerance=1e-10).solve(batch)
    assert solution.solved.all()
    np.testing.assert_allclose(np.ravel(solution.lambda_), CORNER, atol=1e-9)


def test_kinds_by_number_and_lists_are_alike():
    one = Batch.from_delassus([A[0]], [B[0]], cones=[("box_friction", 3)], mu=0.5)
    by_number = Batch.from_delassus(A, B, kinds=np.full((1, 1), 4, np.uint8), dims=np.full((1, 1), 3, np.uint8), mu=0.5)
    for batch in (one, by_number):
        np.testing.assert_allclose(np.ravel(Solver(tolerance=1e-10).solve(batch).lambda_), CORNER, atol=1e-9)


def test_a_file_keeps_it(tmp_path):
    batch = Batch.from_delassus(A, B, cones="box_friction", mu=0.5)
    batch.save(tmp_path / "boxed.h5")
    again = Batch.from_file(tmp_path / "boxed.h5")
    assert Solver(tolerance=1e-10).solve(again).hash() == Solver(tolerance=1e-10).solve(batch).hash()


def violation(A, b, mu, lambda_):
    """Distance of reactions of contacts of three rows from boxed friction, by products that must vanish."""
    w, worst = A @ lambda_ + b, 0.0
    for first in range(0, len(b), 3):
        normal = lambda_[first]
        worst = max(worst, -normal, -w[first], abs(normal * w[first]))
        for k in (first + 1, first + 2):
            bound = mu * normal
            worst = max(worst, abs(lambda_[k]) - bound, (bound - lambda_[k]) * max(-w[k], 0), (bound + lambda_[k]) * max(w[k], 0))
    return worst


@pytest.mark.parametrize("device", ["cpu", "emulated"])
def test_auto_pivots_where_sweeps_fall_short(device):
    rng = np.random.default_rng(8)
    spread = np.exp(rng.uniform(0, np.log(100), (150, 9)))
    turned = np.linalg.qr(rng.standard_normal((150, 9, 9)))[0]
    A, b = (turned * spread[:, None]) @ turned.transpose(0, 2, 1), rng.uniform(-1, 1, (150, 9))
    A = (A + A.transpose(0, 2, 1)) / 2
    batch = Batch.from_delassus(A, b, cones="box_friction", mu=2.5)
    swept = Solver(solver="subspace", tolerance=1e-10, max_iterations=4096).solve(batch).solved
    solution = Solver(solver="auto", tolerance=1e-10, max_iterations=4096, device=device).solve(batch)
    pivoted = np.array(solution.status["solver"]) == list(stiction.SOLVERS).index("lemke")
    for env in np.flatnonzero(pivoted & solution.solved):
        assert violation(A[env], b[env], 2.5, solution.lambda_[env]) < 1e-8
    assert swept.sum() + 5 < solution.solved.sum()


def test_a_solver_of_cones_says_that_it_cannot():
    solution = Solver(solver="admm").solve(Batch.from_delassus(A, B, cones="box_friction", mu=0.5))
    assert not solution.solved.any()
    assert int(solution.status["flags"][0]) & 1 << stiction.FLAGS.index("unsupported_cone")


def test_pytorch_takes_the_kind():
    torch = framework("torch")
    from stiction.torch import solve

    lambda_ = solve(torch.tensor(A), torch.tensor(B), mu=0.5, cones="box_friction", tolerance=1e-10)[0]
    np.testing.assert_allclose(np.ravel(lambda_), CORNER, atol=1e-9)
