"""stiction.jax.solve with kappa and with derivative="unrolled": against the equations of the relaxed problem, which JAX
differentiates, against differences of sweeps and against the library's bits. Skipped, and says so, without JAX."""

import functools

import numpy as np
import pytest

import stiction
from test_framework_derivatives import CONES, EXACT, NAMES, problem
from frameworks import framework

LAWS = pytest.mark.parametrize("law", ["convex", "coulomb"])
#: By custom call, where the package was built beside JAX, and by host callback.
WAYS = pytest.mark.parametrize("allow_ffi", [True, False])
SWEEPS = {"derivative": "unrolled", "solver": "pgs", "tolerance": 0}


@pytest.fixture
def jax():
    jax = framework("jax")
    jax.config.update("jax_enable_x64", True)
    import stiction.jax  # noqa: F401 - after the switch
    yield jax
    jax.config.update("jax_enable_x64", False)


@pytest.fixture
def solve(jax):
    import stiction.jax
    return stiction.jax.solve


def contacts(seed, count=2):
    """A, b, mu, R of friction cones of three rows."""
    rng = np.random.default_rng(seed)
    n = 3 * count
    J = rng.normal(size=(n, n + 2))
    return J @ J.T / n, rng.normal(size=n) - 0.3, rng.uniform(0.2, 1, n), rng.uniform(0.05, 0.2, n)


class Relaxed:
    """x o y = kappa (1, 0) of friction cones (docs/math/derivative.md, (22)), as the equations stand, in JAX."""

    def __init__(self, jax, law, numbers):
        self.np, self.law = jax.numpy, law
        A, b, mu, R = numbers
        self.is_normal = np.arange(len(b)) % 3 == 0
        self.weight, self.largest = (np.diagonal(A) + R).reshape(-1, 3).mean(axis=1), np.abs(b).max()
        self.jacobian = jax.jit(jax.jacfwd(self.products))
        self.products_now = jax.jit(self.products)

    def motion(self, x, numbers):
        """(reactions, w, motion of the unit cones without De Saxce's term)"""
        A, b, mu, R = numbers
        scale = self.np.where(self.is_normal, 1.0, mu)
        w = A @ (scale * x) + R * scale * x + b
        return scale * x, w, scale * w

    def cones(self, x, numbers, kappa):
        x_, y = x.reshape(-1, 3), self.motion(x, numbers)[2].reshape(-1, 3)
        if self.law == "coulomb":
            radius = self.np.minimum(self.weight * kappa / self.largest, self.np.sqrt(self.weight * kappa))
            speed = self.np.sqrt((y[:, 1:] ** 2).sum(axis=1) + radius ** 2) - radius
            y = self.np.concatenate([(y[:, 0] + speed)[:, None], y[:, 1:]], axis=1)
        return x_, y

    def products(self, x, numbers, kappa):
        x, y = self.cones(x, numbers, kappa)
        along = x[:, :1] * y[:, 1:] + y[:, :1] * x[:, 1:]
        return self.np.concatenate([(x * y).sum(axis=1)[:, None] - kappa, along], axis=1).reshape(-1)

    def is_inside(self, x, numbers, kappa):
        return all((part[:, 0] > np.linalg.norm(part[:, 1:], axis=1)).all()
                   for part in map(np.asarray, self.cones(x, numbers, kappa)))

    def solve(self, numbers, kappa):
        """Newton's method inside the cones: first along A from its diagonal, then along falling kappa."""
        A, x = numbers[0], np.where(self.is_normal, 30.0, 0.0)
        path = [(300.0, share) for share in np.linspace(0, 1, 20)]
        path += [(level, 1.0) for level in np.geomspace(300, kappa, 40)]
        for level, share in path:
            part = (np.diag(np.diagonal(A)) * (1 - share) + share * A, *numbers[1:])
            for _ in range(30):
                value = np.asarray(self.products_now(x, part, level))
                if np.abs(value).max() < 1e-12 * (1 + level):
                    break
                step = np.linalg.solve(np.asarray(self.jacobian(x, part, level)), value)
                while not self.is_inside(x - step, part, level):
                    step = step / 2
                x = x - step
        assert np.abs(self.products_now(x, numbers, kappa)).max() < 1e-11
        return x


@LAWS
def test_relaxed_is_that_of_the_equations_that_jax_differentiates(jax, solve, law):
    """A step of Newton's method from the relaxed answer, by a matrix that rests, has that answer's derivative."""
    for seed, kappa in enumerate((0.1, 0.01)):
        numbers = contacts(seed)
        relaxed = Relaxed(jax, law, numbers)
        at = relaxed.solve(numbers, kappa)
        inverse = np.linalg.inv(relaxed.jacobian(at, numbers, kappa))

        def wanted(*numbers, relaxed=relaxed, at=at, inverse=inverse):
            return relaxed.motion(at - inverse @ relaxed.products(at, numbers, kappa), numbers)[:2]

        def answer(A, b, mu, R, kappa=kappa):
            return solve(A, b, mu, R, law=law, kappa=kappa, **EXACT)[:2]

        by = tuple(np.random.default_rng(seed + 9).normal(size=(2, len(at))))
        exact, pull = jax.vjp(answer, *numbers)
        _, pull_wanted = jax.vjp(wanted, *numbers)
        for name, ours, theirs in zip(("A", "b", "mu", "R"), pull(by), pull_wanted(by)):
            if name == "mu":  # of a normal row it is not part of the problem
                ours, theirs = (np.where(relaxed.is_normal, 0, part) for part in (ours, theirs))
            np.testing.assert_allclose(ours, theirs, atol=1e-8 * (1 + np.abs(theirs).max()), err_msg=name)
        for found, plain in zip(exact, functools.partial(answer, kappa=0.0)(*numbers)):
            np.testing.assert_array_equal(found, plain)


@LAWS
def test_kappa_tells_of_a_contact_that_is_open(jax, solve, law):
    """b = 0.2 on A = 2, open: the answer stays 0, its derivative is that of (sqrt(b^2 + 4 A kappa) - b) / 2A."""
    A, b = np.full((1, 1), 2.0), 0.2
    for kappa in (0.0, 0.03):
        slope = jax.grad(lambda b, kappa=kappa: solve(A, b, cones="unilateral", law=law, kappa=kappa, **EXACT)[0].sum())
        wanted = (b / np.sqrt(b ** 2 + 8 * kappa) - 1) / 4 if kappa else 0.0
        assert float(slope(np.array([b]))[0]) == pytest.approx(wanted, abs=1e-14)


@LAWS
def test_sweeps_of_all_cones_are_those_of_differences(jax, solve, law):
    numbers, start = problem(3), np.random.default_rng(1).normal(size=sum(rows for _, rows in CONES))

    def run(start, *numbers):
        return solve(*numbers, cones=CONES, law=law, max_iterations=5, warm_start=start, **SWEEPS)[:2]

    rng = np.random.default_rng(4)
    by = tuple(rng.normal(size=(2, len(start))))
    _, pull = jax.vjp(run, start, *numbers)
    for place, (slope, part) in enumerate(zip(pull(by), (start, *numbers))):
        change = rng.normal(size=part.shape)
        if place == 1:
            change = change + change.T
        ends = [run(*(x + step * change if k == place else x for k, x in enumerate((start, *numbers))))
                for step in (1e-6, -1e-6)]
        wanted = sum(float((bar * (above - below)).sum()) for bar, above, below in zip(by, *ends)) / 2e-6
        assert float((slope * change).sum()) == pytest.approx(wanted, rel=1e-5, abs=1e-6), place


def of_the_library(law, kappa, numbers, start, by):
    """Answer and derivatives of relaxed problems, or of five sweeps where kappa is 0."""
    A, b, mu, R, lo, hi = numbers
    batch = stiction.Batch.from_delassus(A, b, mu=mu, R=R, lo=lo, hi=hi, cones=list(CONES), law=law)
    if kappa == 0:
        solution = stiction.Solver(solver="pgs", tolerance=0, max_iterations=5, stall_window=0).solve(batch, warm_start=start)
        found = stiction.Derivative().unrolled_vjp(batch, 5, warm_start=start, lambda_=by[0], w=by[1])
    else:
        solution = stiction.Solver(tolerance=1e-5).solve(batch)
        found = stiction.Derivative(kappa=kappa).vjp(batch, solution, lambda_=by[0], w=by[1])
    names = (*NAMES, "warm_start")[:6 + (kappa == 0)]
    return (solution.lambda_, solution.w), [getattr(found, name) for name in names], found.valid


@LAWS
@WAYS
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("kappa", [0.05, 0.0], ids=["relaxed", "unrolled"])
def test_bits_are_those_of_the_library_and_nan_stays_where_it_is(jax, solve, law, allow_ffi, dtype, kappa):
    rng = np.random.default_rng(8)
    numbers = [np.stack(parts).astype(dtype) for parts in zip(*(problem(seed) for seed in range(5)))]
    start, *by = (rng.normal(size=numbers[1].shape).astype(dtype) for _ in range(3))
    numbers[1][2, 3] = np.nan
    options = {"kappa": kappa, "tolerance": 1e-5} if kappa else {"max_iterations": 5, "warm_start": start, **SWEEPS}

    @jax.jit
    def pulled(numbers, start, by):
        def run(*numbers_and_start):
            own = options if kappa else options | {"warm_start": numbers_and_start[6]}
            return solve(*numbers_and_start[:6], cones=CONES, law=law, allow_ffi=allow_ffi, **own)[:2]
        answer, pull = jax.vjp(run, *numbers, *(() if kappa else (start,)))
        return answer, pull(tuple(by))

    answer, slopes = pulled(numbers, start, by)
    wanted, gradients, valid = of_the_library(law, kappa, numbers, start, by)
    assert valid.tolist() == [True, True, False, True, True]
    for ours, theirs in zip((*answer, *slopes), (*wanted, *gradients), strict=True):
        assert ours.dtype == dtype
        np.testing.assert_array_equal(ours, theirs)
    assert not any(np.asarray(slope[2]).any() for slope in slopes), "NaN has derivatives of zero"
    others = [0, 1, 3, 4]
    alone = pulled([part[others] for part in numbers], start[others], [part[others] for part in by])
    for ours, theirs in zip((*answer, *slopes), (*alone[0], *alone[1]), strict=True):
        np.testing.assert_array_equal(np.asarray(ours)[others], theirs)


@WAYS
def test_sweeps_are_all_run_though_they_stall(jax, solve, allow_ffi):
    import stiction.jax
    A, b, mu, R = (part.astype(np.float32) for part in contacts(1))
    answer = solve(A, b, mu, R, max_iterations=4500, allow_ffi=allow_ffi, **SWEEPS)
    assert stiction.jax.status(answer[2])["iterations"] == 4500
    stalled = solve(A, b, mu, R, max_iterations=4500, allow_ffi=allow_ffi, solver="pgs", tolerance=0)
    assert stiction.jax.status(stalled[2])["iterations"] < 4500


@WAYS
def test_cones_are_all_rows(jax, solve, allow_ffi):
    """Rows behind the last cone got what was in memory, and all others derivatives of zero."""
    A, b, mu, R = contacts(0)
    for how in ({}, {"kappa": 0.05}, {"max_iterations": 3, **SWEEPS}):
        for cones, rows in ((("friction", 3),), 3), (("friction",) * 3, 9):
            with pytest.raises(ValueError, match=f"cones: expected cones of 6 rows together, got {rows}"):
                solve(A, b, mu, R, cones=cones, allow_ffi=allow_ffi, **how)


@LAWS
@pytest.mark.parametrize("how", [{"kappa": 0.05, **EXACT}, {"max_iterations": 7, **SWEEPS}])
def test_jit_and_vmap_change_no_bit(jax, solve, law, how):
    numbers = problem(2)

    def loss(b, A=numbers[0]):
        lambda_, w, _ = solve(A, b, *numbers[2:], cones=CONES, law=law, **how)
        return (lambda_ ** 2).sum() + w.sum()

    many = np.stack([scale * numbers[1] for scale in (0.5, 1.0, -1.0)])
    together = jax.jit(jax.vmap(jax.grad(loss)))(many)
    alone = np.stack([jax.grad(loss)(b) for b in many])
    assert alone.any()
    np.testing.assert_array_equal(together, alone)
    by_matrix = jax.vmap(jax.grad(lambda A, b: loss(b, A)), (None, 0))(numbers[0], many)
    assert by_matrix.shape == (3, *numbers[0].shape)


def test_single_precision_stays_single(jax, solve):
    numbers = [np.asarray(part, np.float32) for part in contacts(1)]
    for how in ({"kappa": 0.05}, {"max_iterations": 7, **SWEEPS}):
        slope = jax.grad(lambda b, how=how: solve(numbers[0], b, *numbers[2:], **how)[0].sum())(numbers[1])
        assert slope.dtype == np.float32 and np.asarray(slope).any()


def test_what_there_is_not_is_refused(jax, solve):
    A, b, mu, R = contacts(0)
    with pytest.raises(ValueError, match="expected solver='pgs', tolerance=0"):
        solve(A, b, derivative="unrolled")
    with pytest.raises(ValueError, match="derivative: expected 'implicit' or 'unrolled', got 'explicit'"):
        solve(A, b, derivative="explicit")
    with pytest.raises(ValueError, match="warm_start: expected None"):
        solve(A, b, warm_start=b)
    for how in ({"kappa": 0.05}, {"max_iterations": 3, **SWEEPS}):
        loss = lambda b, how=how: (solve(A, b, mu, R, **how)[0] ** 2).sum()  # noqa: E731
        with pytest.raises(TypeError, match="custom_vjp"):
            jax.jvp(loss, (b,), (b,))
        with pytest.raises((ValueError, TypeError)):
            jax.hessian(loss)(b)
        option = "kappa=0.05" if "kappa" in how else "derivative='unrolled'"
        with pytest.raises(ValueError, match=f"{option}: expected one derivative, in reverse, got a further one: use kappa=0"):
            jax.jacrev(jax.grad(loss))(b)


def test_options_are_refused_before_anything_is_solved(jax, solve):
    """A value beside its derivative, too: it used to be returned for any kappa."""
    A, b, mu, R = contacts(0)
    for kind, message, options in (
            (ValueError, "kappa: expected a finite number of at least 0, got -1.0", {"kappa": -1}),
            (ValueError, "kappa: expected a finite number of at least 0, got nan", {"kappa": np.nan}),
            (ValueError, "kappa: expected a finite number of at least 0, got inf", {"kappa": np.inf}),
            (TypeError, "kappa: expected a number, got 'small'", {"kappa": "small"}),
            (ValueError, "tolerance: expected a finite number of at least 0, got nan", {"tolerance": np.nan}),
            (TypeError, "max_iterations: expected an integer, got 2.5", {"max_iterations": 2.5}),
            (TypeError, "max_iterations: expected an integer, got '3'", {"max_iterations": "3"}),
            (ValueError, "max_iterations: expected an integer of at least 0, got -1", {"max_iterations": -1}),
            (ValueError, "max_iterations: expected an integer from .* got 4294967301", {"max_iterations": 2**32 + 5})):
        with pytest.raises(kind, match=message):
            solve(A, b, mu, R, **options)


def test_numbers_of_another_kind_are_refused(jax, solve):
    """They used to be read as floats, halves beyond their end, and the answer was any bytes in memory."""
    A, b, mu, R = contacts(0)
    for kind in (int, np.float16, complex):
        with pytest.raises(TypeError, match=f"A: expected float32 or float64, got {np.dtype(kind)}"):
            solve(A.astype(kind), b, mu, R)
    with pytest.raises(TypeError, match="b: expected real numbers, got complex128"):
        solve(A, b + 0j, mu, R)
    assert np.asarray(solve(A, np.arange(len(b)) - 3, mu, R)[0]).any(), "b is taken to A's precision"


@WAYS
def test_environments_of_both_arrays_broadcast(jax, solve, allow_ffi):
    """One A for many b used to be read beyond its end, without a word."""
    A, b, mu, R = contacts(0)
    alone = solve(A, b, mu, R, allow_ffi=allow_ffi)[0]
    for many_A, many_b, shape in ((A, np.stack([b] * 3), (3,)), (np.stack([A] * 3), b, (3,)), (A[None], np.stack([b] * 3), (3,)),
                                  (np.stack([A] * 2)[:, None], np.stack([b] * 3), (2, 3))):
        answer = solve(many_A, many_b, mu, R, allow_ffi=allow_ffi)[0]
        assert answer.shape == (*shape, len(b))
        np.testing.assert_array_equal(answer, np.broadcast_to(alone, answer.shape))
    slope = jax.grad(lambda A: solve(A, np.stack([b] * 3), mu, R, allow_ffi=allow_ffi)[0].sum())(A)
    once = jax.grad(lambda A: solve(A, b, mu, R, allow_ffi=allow_ffi)[0].sum())(A)
    np.testing.assert_allclose(slope, 3 * once, rtol=1e-12)
    with pytest.raises(ValueError, match=r"A: expected environments that broadcast with those of b \(2, 6\), got \(3, 6, 6\)"):
        solve(np.stack([A] * 3), np.stack([b] * 2), mu, R, allow_ffi=allow_ffi)
    with pytest.raises(ValueError, match="b: expected .* got a number"):
        solve(1.0, 1.0)


@pytest.mark.parametrize("kind", ["box_friction", "semidefinite"])
def test_cones_without_a_derivative_do_not_pass_zeros_for_one(jax, solve, kind):
    """Under kappa they did. Semidefinite cones have no sweeps to unroll."""
    b = np.array([-1.0, 0.2, 0.1])
    for how in ({"kappa": 0.05}, {"max_iterations": 3, **SWEEPS}):
        if kind == "semidefinite" and "derivative" in how:
            continue
        loss = lambda b, how=how: solve(np.eye(3), b, 0.5, cones=((kind, 3),), **how)[0].sum()  # noqa: E731
        assert loss(b) != 0
        with pytest.raises(ValueError, match=f"cones: {kind} has no derivatives"):
            jax.grad(loss)(b)


def test_poison_that_is_infinite_gets_zeros(jax, solve):
    A, b, mu, R = contacts(0)
    poisoned = np.stack([A, A])
    poisoned[1, 0, 0] = np.inf
    by_A, by_b = jax.grad(lambda A, b: solve(A, b, mu, R)[0].sum(), (0, 1))(poisoned, np.stack([b, b]))
    alone = jax.grad(lambda b: solve(A, b, mu, R)[0].sum())(b)
    assert not np.asarray(by_A[1]).any() and not np.asarray(by_b[1]).any()
    np.testing.assert_allclose(by_b[0], alone, rtol=1e-12)


def test_environments_that_were_not_solved_get_zeros(jax, solve):
    """By their status: a residual of 1e-3 and less would do for a derivative."""
    A, b, mu, R = contacts(0)
    how = {"kappa": 0.05, "solver": "npgs", "tolerance": 1e-12, "max_iterations": 16}
    import stiction.jax
    record = stiction.jax.status(solve(A, b, mu, R, **how)[2])
    assert record["code"] != 0 and 1e-12 < record["residual"] < 1e-3
    assert not np.asarray(jax.grad(lambda b: solve(A, b, mu, R, **how)[0].sum())(b)).any()
