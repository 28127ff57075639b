"""Walls of thousands of rows as J and M: the velocities are those that Clarabel finds, which knows nothing of ours."""

import numpy as np
import pytest

from stiction import Batch, Solver

MU, R = 0.5, 1e-3


def wall(courses, bricks):
    """J as (rows, columns, values), M (bodies, 6, 6) and v_free of bricks under weight that are pushed along."""
    half = np.array([1.0, 0.5, 0.5])
    centres = np.array([[2.0 * k + i % 2, 0.0, 0.5 + i] for i in range(courses) for k in range(bricks)])
    contacts = []
    for b, centre in enumerate(centres):
        course, brick = divmod(b, bricks)
        left = brick - (course % 2 == 0)
        below = [-1] if course == 0 else [(course - 1) * bricks + k for k in (left, left + 1) if 0 <= k < bricks]
        for a in below:
            low, high = centre - half, centre + half
            if a >= 0:
                low, high = np.maximum(low, centres[a] - half), np.minimum(high, centres[a] + half)
            contacts += [(a, b, (x, y, centre[2] - 0.5)) for x in (low[0], high[0]) for y in (low[1], high[1])]
    rows, columns, values = [], [], []
    for c, (a, b, at) in enumerate(contacts):
        for k, axis in enumerate(np.eye(3)[[2, 0, 1]]):
            for body, sign in ((a, -1.0), (b, 1.0)):
                if body >= 0:
                    twist = np.concatenate([axis, np.cross(np.subtract(at, centres[body]), axis)])
                    rows += [3 * c + k] * 6
                    columns += range(6 * body, 6 * body + 6)
                    values += list(sign * twist)
    inertia = [(half @ half - h * h) / 3 for h in half]
    M = np.tile(np.diag([1.0, 1.0, 1.0, *inertia]), (len(centres), 1, 1))
    v_free = np.tile([0.0, 0.02, -0.05, 0.0, 0.0, 0.0], (len(centres), 1))
    v_free[:, 0] = 0.05 * np.sin(np.arange(len(centres)))
    return np.array(rows), np.array(columns), np.array(values), M, v_free.reshape(-1)


def batch_of(rows, columns, values, M, v_free):
    n = rows[-1] + 1
    return Batch.from_jacobian(values, M.reshape(-1), v_free, offsets=np.array([0, n]),
                               dof_offsets=np.array([0, len(v_free)]),
                               indptr=np.concatenate([[0], np.cumsum(np.bincount(rows))]),
                               indices=columns.astype(np.int32), mass_block=6, mu=np.full(n, MU),
                               R=np.tile([R, R / MU**2, R / MU**2], n // 3), law="convex")


def test_a_wall_has_the_velocities_that_clarabel_finds():
    clarabel = pytest.importorskip("clarabel", reason="Clarabel is not installed: walls are not compared with it")
    sparse = pytest.importorskip("scipy.sparse", reason="SciPy is not installed: walls are not compared with Clarabel")
    system = wall(12, 12)
    rows, columns, values, M, v_free = system
    n, dofs = rows[-1] + 1, len(v_free)
    solver = Solver(solver="auto", tolerance=1e-9)
    found = solver.solve(batch_of(*system))
    assert solver.stats()["solvers"] == {"velocity_newton": 1}
    assert found.solved.all()
    # min q'Mq/2 + l'Rl/2 + b'l with M q = J'l and l in its cones.
    J = sparse.csr_matrix((values, (rows, columns)), shape=(n, dofs))
    mass = sparse.block_diag(list(M)).tocsc()
    compliance = sparse.diags(np.tile([R, R / MU**2, R / MU**2], n // 3))
    scale = sparse.diags(np.tile([1.0, 1 / MU, 1 / MU], n // 3))
    equations = sparse.hstack([mass, -J.T])
    cones = sparse.hstack([sparse.csr_matrix((n, dofs)), -scale])
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-12
    answer = clarabel.DefaultSolver(
        sparse.block_diag([mass, compliance]).tocsc(), np.concatenate([np.zeros(dofs), J @ v_free]),
        sparse.vstack([equations, cones]).tocsc(), np.zeros(dofs + n),
        [clarabel.ZeroConeT(dofs)] + [clarabel.SecondOrderConeT(3)] * (n // 3), settings).solve()
    x = np.array(answer.x)
    np.testing.assert_allclose(found.velocities, v_free + x[:dofs], atol=1e-8)
    # A reaction answers to a motion by 1 / R.
    np.testing.assert_allclose(found.lambda_, x[dofs:], atol=1e-8 / R)
