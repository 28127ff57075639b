"""Derivatives of stiction.jax.solve over twelve decades of mu squared, in both precisions: against finite differences, and single
precision against double. Skipped, and says so, without JAX."""

import numpy as np
import pytest

from frameworks import framework

CONTACTS = 3
LAWS = pytest.mark.parametrize("law", ["convex", "coulomb"])
FRICTIONS = pytest.mark.parametrize("mu", 10.0 ** np.arange(-6, 1))
LOSS = np.random.default_rng(3).normal(size=3 * CONTACTS)
OPTIONS = {np.float64: {"tolerance": 1e-13}, np.float32: {"tolerance": 1e-6}}


@pytest.fixture(scope="module")
def jax():
    jax = framework("jax")
    jax.config.update("jax_enable_x64", True)
    import stiction.jax  # noqa: F401 - after the switch
    yield jax
    jax.config.update("jax_enable_x64", False)


def problem(mu, law, slides):
    """A, b and mu whose solution is known: all contacts press with 1. Contacts in `slides` move at 0.5, others stick
    with a third of the friction that they may have."""
    J = np.random.default_rng(1).normal(size=(3 * CONTACTS, 3 * CONTACTS + 2))
    A = J @ J.T / (3 * CONTACTS) + 0.2 * np.eye(3 * CONTACTS)
    lambda_, w = np.zeros((2, CONTACTS, 3))
    for k in range(CONTACTS):
        along = np.array([np.cos(k + 0.5), np.sin(k + 0.5)])
        lambda_[k] = 1, *(-(1 if k in slides else 0.33) * mu * along)
        if k in slides:
            w[k] = 0.5 * mu if law == "convex" else 0, *(0.5 * along)
    return A, w.ravel() - A @ lambda_.ravel(), np.tile([0, mu, mu], CONTACTS)


def slopes(jax, numbers, dtype, law):
    """Derivatives of the loss by A, b and mu, and whether they are flagged as sound."""
    import stiction.jax
    numbers = tuple(part.astype(dtype) for part in numbers)
    options = {"law": law, "solver": "npgs", "max_iterations": 20000, **OPTIONS[dtype]}
    answer = stiction.jax.solve(*numbers, **options)
    assert stiction.jax.status(answer[2])["code"] == 0
    pulled = jax.grad(lambda *numbers: (stiction.jax.solve(*numbers, **options)[0] * LOSS.astype(dtype)).sum(), (0, 1, 2))
    found = [np.asarray(part) for part in pulled(*numbers)]
    assert all(part.dtype == dtype for part in found)
    return found, bool(stiction.jax.has_derivative(answer, *numbers, law=law))


@LAWS
@FRICTIONS
@pytest.mark.parametrize("slides", [(), (0, 2), (0, 1, 2)], ids=["stick", "both", "slide"])
def test_derivatives_are_those_of_finite_differences_and_the_same_in_both_precisions(jax, law, mu, slides):
    import stiction.jax
    A, b, friction = numbers = problem(mu, law, slides)
    wide, has = slopes(jax, numbers, np.float64, law)
    assert has
    step = 1e-3 * mu  # no contact changes its mode within it
    ends = [stiction.jax.solve(np.tile(A, (len(b), 1, 1)), b + sign * step * np.eye(len(b)), friction, law=law, solver="npgs",
                               tolerance=1e-15, max_iterations=20000)[0] @ LOSS for sign in (1, -1)]
    by_b = np.asarray(ends[0] - ends[1]) / (2 * step)
    # Rounding of the differences grows as the step falls.
    np.testing.assert_allclose(wide[1], by_b, atol=(1e-6 + 1e-12 / step) * np.abs(by_b).max())
    narrow, has = slopes(jax, numbers, np.float32, law)
    assert has
    for name, single, double in zip(("A", "b", "mu"), narrow, wide):
        # By mu of a contact that slides: friction itself is known to about 1e-7 of the normal force.
        tolerance = 1e-4 + (1e-6 / mu if name == "mu" else 0)
        np.testing.assert_allclose(single, double, atol=tolerance * np.abs(double).max(), err_msg=name)


@LAWS
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_axes_of_friction_that_differ_by_six_decades(jax, law, dtype):
    from stiction.jax.derivative import tangents
    A, _, friction = problem(1.0, law, ())
    friction[2::3] = 1e-6
    lambda_ = np.tile([1, 0.3, 0.3e-6], CONTACTS)  # all contacts stick
    change = np.random.default_rng(4).normal(size=len(lambda_))
    zeros, wide = np.zeros_like(lambda_), np.zeros_like(A)
    numbers = A, -A @ lambda_, friction, zeros, zeros, zeros
    changes = wide, change, np.ones_like(friction), zeros, zeros, zeros
    numbers, changes = ([jax.numpy.asarray(part, dtype) for part in parts] for parts in (numbers, changes))
    moved, w = tangents(np.full(CONTACTS, 3), np.full(CONTACTS, 3), law, numbers, changes,
                        jax.numpy.asarray(lambda_, dtype), jax.numpy.asarray(zeros, dtype), jax.numpy.asarray(True))
    np.testing.assert_allclose(moved, -np.linalg.solve(A, change), rtol=2e-5 if dtype is np.float32 else 1e-12)
    np.testing.assert_allclose(w, 0, atol=1e-5)


@LAWS
def test_what_is_not_determined_or_not_solved_is_told(jax, law):
    import stiction.jax
    good = problem(1e-4, law, ())
    twice = np.kron(np.ones((2, 2)), np.eye(3)), np.tile([-1.0, 1e-5, 0], 2), np.full(6, 1e-4)
    shared = np.tile([0.5, -0.5e-5, 0], 2), np.zeros(6), np.zeros(32, np.uint8)  # of two contacts in one place
    for dtype in (np.float32, np.float64):
        numbers, answer = [part.astype(dtype) for part in twice], (*(part.astype(dtype) for part in shared[:2]), shared[2])
        assert not stiction.jax.has_derivative(answer, *numbers, law=law)
        assert stiction.jax.has_derivative(answer, *numbers, np.full(6, 0.1, dtype), law=law)  # R distinguishes them
        numbers = [part.astype(dtype) for part in good]
        answer = stiction.jax.solve(*numbers, law=law, max_iterations=0)
        assert not stiction.jax.has_derivative(answer, *numbers, law=law)
    many = jax.numpy.stack([good[0], good[0]]), jax.numpy.stack([good[1], np.full(9, np.nan)]), good[2]
    answer = stiction.jax.solve(*many, law=law, solver="npgs", tolerance=1e-12)
    assert stiction.jax.has_derivative(answer, *many, law=law).tolist() == [True, False]
