"""The derivative as the limit of two others, written here in NumPy. One is of the central path, as its parameter
vanishes, one of unrolled sweeps, as they become many. And over a rollout, against finite differences.
"""

import numpy as np
import pytest

import stiction

N = 12


def lcp(seed):
    """Unilateral rows, some open and some pressed: A, b and a loss by the reactions."""
    rng = np.random.default_rng(seed)
    J = rng.normal(size=(N, N + 4))
    return J @ J.T / N + 0.05 * np.eye(N), rng.normal(size=N), rng.normal(size=N)


def exact(A, b, loss, law="convex"):
    """Derivative of the loss by b, by the library."""
    batch = stiction.Batch.from_delassus(A[None], b[None], cones="unilateral", law=law)
    solution = stiction.Solver(solver="lemke", tolerance=1e-12).solve(batch)
    found = stiction.Derivative().vjp(batch, solution, lambda_=loss[None])
    assert solution.solved.all() and found.valid.all() and not found.flagged("subgradient").any()
    pressed = solution.lambda_[0] > 0
    assert 0 < pressed.sum() < N
    return found.b[0], solution.lambda_[0]


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


def relative(found, wanted):
    return np.linalg.norm(found - wanted) / np.linalg.norm(wanted)


@pytest.mark.parametrize("seed", range(4))
def test_the_central_paths_derivative_tends_to_it_in_proportion_to_kappa(seed):
    A, b, loss = lcp(seed)
    wanted, _ = exact(A, b, loss)
    errors = []
    for kappa in (1e-3, 1e-5, 1e-6, 1e-7):
        x, w = on_central_path(A, b, kappa)
        smooth = -np.linalg.solve((A + np.diag(w / x)).T, loss)
        if kappa == 1e-3:  # it is the derivative of that path
            along = np.random.default_rng(9).normal(size=N)
            ends = [on_central_path(A, b + sign * 1e-6 * along, kappa)[0] @ loss for sign in (1, -1)]
            assert (ends[0] - ends[1]) / 2e-6 == pytest.approx(smooth @ along, rel=1e-5)
        errors.append(relative(smooth, wanted))
    assert errors[0] > errors[1] and errors[2] < 1e-2
    # Slope one: the distance of b's part is linear in kappa where kappa is small against all that is not zero.
    assert errors[2] / errors[3] == pytest.approx(10, rel=0.2)


@pytest.mark.parametrize("kappa", [1e-1, 1e-3, 1e-5])
def test_kappas_derivative_is_that_of_the_central_path(kappa):
    A, b, loss = lcp(1)
    _, lambda_ = exact(A, b, loss)
    x, w = on_central_path(A, b, kappa)
    nu = -np.linalg.solve((A + np.diag(w / x)).T, loss)
    batch = stiction.Batch.from_delassus(A[None], b[None], cones="unilateral", law="convex")
    found = stiction.Derivative(kappa=kappa).vjp(batch, lambda_[None], lambda_=loss[None])
    assert found.valid.all() and found.status["unknowns"][0] == N
    np.testing.assert_allclose(found.b[0], nu, rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(found.A[0], np.outer(nu, x), rtol=1e-7, atol=1e-9)
    np.testing.assert_allclose(found.R[0], nu * x, rtol=1e-7, atol=1e-9)
    with pytest.raises(stiction.Error, match="kappa = -1"):
        stiction.Derivative(kappa=-1)


def unrolled(A, b, loss, sweeps):
    """Derivative of the loss of so many sweeps of projected Gauss-Seidel from zero, in reverse."""
    x, moved = np.zeros(N), []
    for _ in range(sweeps):
        for i in range(N):
            other = A[i] @ x - A[i, i] * x[i]
            x[i] = max(-(other + b[i]) / A[i, i], 0.0)
            moved.append(x[i] > 0)
    bar, by_b = loss.copy(), np.zeros(N)
    for k in reversed(range(len(moved))):
        i = k % N
        own, bar[i] = bar[i], 0.0
        if moved[k]:
            by_b[i] -= own / A[i, i]
            row = A[i].copy()
            row[i] = 0.0
            bar -= own / A[i, i] * row
    return by_b


@pytest.mark.parametrize("seed", range(4))
def test_unrolled_sweeps_tend_to_it_as_fast_as_the_sweeps(seed):
    A, b, loss = lcp(seed)
    wanted, lambda_ = exact(A, b, loss)
    pressed = np.flatnonzero(lambda_ > 0)
    part = A[np.ix_(pressed, pressed)]
    lower = np.tril(part)
    rate = np.abs(np.linalg.eigvals(np.eye(len(pressed)) - np.linalg.solve(lower, part))).max()
    few, many = (int(np.ceil(np.log(left) / np.log(rate))) + 5 for left in (1e-3, 1e-8))
    errors = [relative(unrolled(A, b, loss, sweeps), wanted) for sweeps in (few, many, many + 40)]
    assert errors[1] < 1e-5 and errors[2] <= errors[1] < errors[0]
    # What is left shrinks at least at the sweeps' own rate, up to polynomials beside it.
    assert np.log(errors[1] / errors[0]) / (many - few) < 0.75 * np.log(rate)


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
