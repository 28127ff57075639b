"""Derivatives beside NumPy's: that of the central path, and over a rollout finite differences."""

import numpy as np
import pytest

import stiction

N = 12


def lcp():
    """Unilateral rows, some open and some pressed: A, b and a loss by the reactions."""
    rng = np.random.default_rng(1)
    J = rng.normal(size=(N, N + 4))
    return J @ J.T / N + 0.05 * np.eye(N), rng.normal(size=N), rng.normal(size=N)


def on_central_path(A, b, kappa):
    """lambda with lambda * (A lambda + b) = kappa, both positive: damped Newton on the way down."""
    x, w = np.ones(N), np.ones(N)
    for level in np.concatenate([10.0 ** np.arange(1, np.log10(kappa), -0.5), [kappa] * 3]):
        for _ in range(60):
            defect = np.concatenate([A @ x + b - w, x * w - level])
            if np.abs(defect).max() < 1e-13:
                break
            step = np.linalg.solve(np.block([[A, -np.eye(N)], [np.diag(w), np.diag(x)]]), -defect)
            size = 1.0
            while (np.concatenate([x, w]) + size * step).min() <= 0:
                size *= 0.5
            x, w = x + size * 0.999 * step[:N], w + size * 0.999 * step[N:]
    return x, w


@pytest.mark.parametrize("kappa", [1e-1, 1e-3, 1e-5])
def test_kappas_derivative_is_that_of_the_central_path(kappa):
    A, b, loss = lcp()
    x, w = on_central_path(A, b, kappa)
    nu = -np.linalg.solve((A + np.diag(w / x)).T, loss)
    batch = stiction.Batch.from_delassus(A[None], b[None], cones="unilateral", law="convex")
    solution = stiction.Solver(solver="lemke", tolerance=1e-12).solve(batch)
    assert solution.solved.all() and 0 < (solution.lambda_ > 0).sum() < N
    found = stiction.Derivative(kappa=kappa).vjp(batch, solution.lambda_, lambda_=loss[None])
    assert found.valid.all() and found.status["unknowns"][0] == N
    np.testing.assert_allclose(found.b[0], nu, rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(found.A[0], np.outer(nu, x), rtol=1e-7, atol=1e-9)
    np.testing.assert_allclose(found.R[0], nu * x, rtol=1e-7, atol=1e-9)
    with pytest.raises(stiction.Error, match="kappa = -1"):
        stiction.Derivative(kappa=-1)


@pytest.mark.parametrize("law", ["convex", "coulomb"])
def test_a_rollouts_derivative_is_that_of_differences(law):
    """32 steps of velocities through contacts that yield, J and M fixed: by the first velocities and all forces."""
    rng = np.random.default_rng(21)
    dofs, contacts, envs, steps, dt = 8, 3, 4, 32, 0.01
    J = rng.normal(size=(envs, 3 * contacts, dofs))
    half = rng.normal(size=(envs, dofs, dofs))
    M = half @ half.transpose(0, 2, 1) + dofs * np.eye(dofs)
    first, by_velocity = rng.normal(size=(2, envs, dofs))
    force = 20 * rng.normal(size=(steps, envs, dofs))
    solver = stiction.Solver(solver="npgs", tolerance=1e-13, absolute_tolerance=1e-14, max_iterations=20000)

    def step(v, push):
        free = v + dt * np.linalg.solve(M, push[..., None])[..., 0]
        batch = stiction.Batch.from_jacobian(J, M, free, mu=0.5, R=np.full((envs, 3 * contacts), 0.02), law=law)
        solution = solver.solve(batch)
        return batch, solution

    def rollout(first, force):
        v, kept = first, []
        for push in force:
            kept.append(step(v, push))
            v = kept[-1][1].velocities.copy()
        return v, kept

    end, kept = rollout(first, force)
    bar, by_force = by_velocity, np.zeros_like(force)
    for k in reversed(range(steps)):
        found = stiction.Derivative().vjp(*kept[k], velocities=np.ascontiguousarray(bar))
        assert found.valid.all()
        bar = found.v_free
        by_force[k] = dt * np.linalg.solve(M, bar[..., None])[..., 0]
    size = 1e-6
    for gradient, at, call in ((bar, first, lambda x: rollout(x, force)[0]), (by_force, force, lambda x: rollout(first, x)[0])):
        along = rng.normal(size=at.shape)
        ends = [(call(at + sign * size * along) * by_velocity).sum() for sign in (1, -1)]
        terms = gradient * along
        assert abs((ends[0] - ends[1]) / (2 * size) - terms.sum()) < 1e-3 * np.abs(terms).sum()
