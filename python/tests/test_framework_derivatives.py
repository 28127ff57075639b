"""Derivatives through PyTorch's operator and JAX's function: against finite differences of solves, against the library's own
derivative and against each other. Each is skipped, and says so, where the framework is not installed."""

import numpy as np
import pytest

import stiction
from frameworks import framework
from worlds import heap

CONES = (("friction", 3), ("free", 1), ("friction", 4), ("unilateral", 1), ("box", 1), ("friction", 3), ("friction", 2),
         ("box", 1))
ROWS = sum(rows for _, rows in CONES)
NAMES = ("A", "b", "mu", "R", "lo", "hi")
EXACT = {"tolerance": 1e-13, "max_iterations": 20000}


def problem(seed):
    """Cones of every kind, of which some are open, stick, slide or stand at a bound: A, b, mu, R, lo, hi."""
    rng = np.random.default_rng(seed)
    J = rng.normal(size=(ROWS, ROWS + 2))
    mu, lo, hi = np.zeros((3, ROWS))
    row = 0
    for kind, rows in CONES:
        if kind == "friction":
            mu[row + 1:row + rows] = rng.uniform(0.2, 1, rows - 1)
        if kind == "box":
            lo[row], hi[row] = -rng.uniform(0.05, 0.4), rng.uniform(0.05, 0.4)
        row += rows
    return J @ J.T / ROWS, rng.normal(size=ROWS) - 0.3, mu, rng.uniform(0.02, 0.1, ROWS), lo, hi


def cotangents(seed):
    return np.random.default_rng(seed + 50).normal(size=(2, ROWS))


def own_derivative(numbers, law, by_lambda, by_w):
    """By the C++ library."""
    A, b, mu, R, lo, hi = (part[None] for part in numbers)
    batch = stiction.Batch.from_delassus(A, b, mu=mu, R=R, lo=lo, hi=hi, cones=list(CONES), law=law)
    solution = stiction.Solver(**EXACT).solve(batch)
    assert solution.solved.all()
    found = stiction.Derivative().vjp(batch, solution, lambda_=by_lambda[None], w=by_w[None])
    assert found.valid.all() and not found.flagged("subgradient").any()
    return [getattr(found, name)[0] for name in NAMES]


def expect_close(found, wanted, tolerance):
    for name, a, b in zip(NAMES, found, wanted):
        np.testing.assert_allclose(np.asarray(a), np.asarray(b), atol=tolerance * (1 + np.abs(b).max()), err_msg=name)


@pytest.mark.parametrize("law", ["convex", "coulomb"])
class TestJax:
    @pytest.fixture(autouse=True)
    def _jax(self):
        self.jax = framework("jax")
        self.jax.config.update("jax_enable_x64", True)
        import stiction.jax
        self.solve = stiction.jax.solve
        yield
        self.jax.config.update("jax_enable_x64", False)

    def answer(self, law, **options):
        return lambda *numbers: self.solve(*numbers, cones=CONES, law=law, **(EXACT | options))[:2]

    def test_forward_is_that_of_finite_differences_and_reverse_that_of_the_library(self, law):
        answer = self.answer(law)
        for seed in range(6):
            numbers, rng = problem(seed), np.random.default_rng(seed + 100)
            changes = [rng.normal(size=part.shape) for part in numbers]
            changes[0] = changes[0] + changes[0].T
            _, moved = self.jax.jvp(answer, numbers, tuple(changes))
            ends = [answer(*(part + step * change for part, change in zip(numbers, changes))) for step in (1e-6, -1e-6)]
            for found, above, below in zip(moved, *ends):
                slope = np.asarray(above - below) / 2e-6
                np.testing.assert_allclose(found, slope, atol=1e-7 * np.abs(slope).max())
            by = cotangents(seed)
            _, pull = self.jax.vjp(answer, *numbers)
            expect_close(pull(tuple(by)), own_derivative(numbers, law, *by), 1e-10)

    def test_unrolled_is_that_of_sweeps_that_jax_differentiates(self, law):
        """Sweeps written here from docs/math/local_solve.md, step lengths included, by JAX's own reverse mode."""
        contacts, sweeps = 2, 4
        n, np_ = 3 * contacts, self.jax.numpy

        def onto_cone(z, share):
            length = np_.sqrt((z[1:] ** 2).sum())
            middle = share * length + (1 - share) * z[0]
            edge = np_.concatenate([middle[None], z[1:] / length * middle])
            return np_.where(length <= z[0], z, np_.where(middle <= 0, 0.0, edge))

        def bound(B):
            B = 0.5 * (B + B.T)
            return np_.trace(np_.linalg.matrix_power(B, 16)) ** (1 / 16)

        def visit(x, y, B):
            one, two = 1 / B[0, 0], 1 / bound(B[1:, 1:])
            if law == "coulomb":
                normal = np_.maximum(x[0] - one * y[0], 0.0)
                z = x[1:] - two * (y[1:] + B[1:, 0] * (normal - x[0]))
                length = np_.sqrt((z ** 2).sum())
                return np_.concatenate([normal[None], np_.where(length <= normal, z, z / length * normal)])
            coupling = 0.5 * (B[0, 1:] + B[1:, 0])
            step = np_.array([one, two, two]) / (1 + np_.sqrt((coupling ** 2).sum() * one * two))
            share = one / (one + two)
            moved = onto_cone(x - step * y, share)
            return onto_cone(moved - step * (y + B @ (moved - x)), share)

        def swept(A, b, mu, R, start):
            scale = np_.where(np_.arange(n) % 3 == 0, 1.0, mu)
            scaled = scale[:, None] * (A + np_.diag(R)) * scale
            x = np_.concatenate([onto_cone(part, 0.5) for part in np_.split(start / scale, contacts)])
            for _ in range(sweeps):
                for c in range(contacts):
                    own = slice(3 * c, 3 * c + 3)
                    x = x.at[own].set(visit(x[own], scaled[own] @ x + scale[own] * b[own], scaled[own, own]))
            return scale * x

        @self.jax.jit
        def answer(numbers, by):
            lambda_, pull = self.jax.vjp(swept, *numbers)
            return lambda_, pull(by)

        for seed in range(4):
            rng = np.random.default_rng(seed)
            J = rng.normal(size=(n, n + 2))
            mu, R = np.repeat(rng.uniform(0.2, 1, contacts), 3), np.repeat(rng.uniform(0.05, 0.2, contacts), 3)
            numbers = J @ J.T / n, rng.normal(size=n) - 0.3, mu, R, 0.3 * rng.normal(size=n)
            friction = (np.diag(numbers[0]) + R).reshape(contacts, 3)[:, 1:]
            assert (friction.max(1) < 4 * friction.min(1)).all()  # axes alike: they step together
            by = rng.normal(size=n)
            lambda_, slopes = answer(numbers, by)
            A, b, mu, R, start = (part[None] for part in numbers)
            batch = stiction.Batch.from_delassus(A, b, mu=mu, R=R, cones="friction", law=law)
            found = stiction.Derivative().unrolled_vjp(batch, sweeps, warm_start=start, lambda_=by[None])
            np.testing.assert_allclose(found.lambda_[0], lambda_, atol=1e-13)
            for name, wanted in zip(("A", "b", "mu", "R", "warm_start"), slopes):
                wanted = np.asarray(wanted)
                np.testing.assert_allclose(getattr(found, name)[0], wanted, atol=1e-11 * (1 + np.abs(wanted).max()),
                                           err_msg=name)

            def run(A, b, mu, R, start):
                return self.solve(A, b, mu, R, law=law, solver="pgs", tolerance=0, max_iterations=sweeps,
                                  derivative="unrolled", warm_start=start)[0]

            lambda_, pull = self.jax.vjp(run, *numbers)
            np.testing.assert_allclose(lambda_, found.lambda_[0], atol=1e-13)
            for name, ours in zip(("A", "b", "mu", "R", "warm_start"), pull(by)):
                np.testing.assert_array_equal(ours, getattr(found, name)[0], err_msg=name)

    def test_second_derivatives_are_those_of_finite_differences(self, law):
        numbers, weights = problem(3), cotangents(3)[0]
        answer = self.answer(law)

        def loss(b, mu):
            lambda_, w = answer(numbers[0], b, mu, *numbers[3:])
            return (weights * lambda_ ** 2).sum() + self.jax.numpy.sin(w).sum()

        slope = self.jax.grad(loss)
        hessian = self.jax.hessian(loss)(*numbers[1:3])
        steps = 1e-6 * np.eye(ROWS)
        wanted = np.array([(slope(numbers[1] + step, numbers[2]) - slope(numbers[1] - step, numbers[2])) / 2e-6
                           for step in steps])
        np.testing.assert_allclose(hessian, wanted, atol=1e-7 * np.abs(wanted).max())
        np.testing.assert_allclose(hessian, hessian.T, atol=1e-10 * np.abs(wanted).max())

    def test_jit_and_vmap_change_nothing(self, law):
        numbers, np_ = problem(2), self.jax.numpy
        loss = lambda b: (self.answer(law)(numbers[0], b, *numbers[2:])[0] ** 2).sum()  # noqa: E731
        many = np_.stack([scale * numbers[1] for scale in (0.5, 1.0, -1.0)])
        together = self.jax.jit(self.jax.vmap(self.jax.grad(loss)))(many)
        alone = np_.stack([self.jax.grad(loss)(b) for b in many])
        np.testing.assert_allclose(together, alone, rtol=1e-10, atol=1e-12)

    def test_what_has_no_derivative_gets_zeros(self, law):
        numbers, np_ = problem(2), self.jax.numpy
        unsolved = self.jax.grad(lambda b: self.answer(law, max_iterations=0)(numbers[0], b, *numbers[2:])[0].sum())
        assert not np.asarray(unsolved(numbers[1])).any()
        hard = self.jax.grad(lambda b: self.solve(np_.ones((6, 6)), b, 0.5, law=law)[0].sum())
        assert not np.asarray(hard(np_.array([-1.0, 0, 0, -1, 0, 0]))).any()
        assert not np.asarray(hard(np_.array([-1.0, np.nan, 0, -1, 0, 0]))).any()
        none = self.jax.grad(lambda b: self.solve(np_.zeros((0, 0)), b, law=law)[0].sum())
        assert none(np_.zeros(0)).shape == (0,)

    def test_axes_without_friction_stay_without(self, law):
        numbers = list(problem(4))
        numbers[2] = np.zeros(ROWS)
        by = cotangents(4)
        _, pull = self.jax.vjp(self.answer(law), *numbers)
        found = pull(tuple(by))
        expect_close(found, own_derivative(numbers, law, *by), 1e-10)
        assert not np.asarray(found[2]).any()


@pytest.mark.parametrize("law", ["convex", "coulomb"])
class TestTorch:
    @pytest.fixture(autouse=True)
    def _torch(self):
        self.torch = framework("torch")
        import stiction.torch
        self.module = stiction.torch

    def tensors(self, numbers, wants=True):
        return [self.torch.from_numpy(part.copy()).requires_grad_(wants) for part in numbers]

    def answer(self, law, **options):
        def run(*numbers):
            return self.module.solve(*numbers, cones=list(CONES), law=law, **(EXACT | options))[:2]
        return run

    def test_gradcheck(self, law):
        A, *rows = self.tensors(problem(3))
        root = self.torch.linalg.cholesky(A.detach()).requires_grad_()
        answer = self.answer(law)
        assert self.torch.autograd.gradcheck(lambda root, *rows: answer(root @ root.T, *rows), [root, *rows], eps=1e-6,
                                             atol=1e-6, rtol=1e-5)

    def test_reverse_is_that_of_the_library(self, law):
        for seed in range(4):
            numbers, (by_lambda, by_w) = problem(seed), self.tensors(cotangents(seed), False)
            tensors = self.tensors(numbers)
            lambda_, w = self.answer(law)(*tensors)
            ((lambda_ * by_lambda).sum() + (w * by_w).sum()).backward()
            expect_close([part.grad for part in tensors], own_derivative(numbers, law, by_lambda.numpy(), by_w.numpy()),
                         1e-12)

    def test_kappa_tells_of_a_contact_that_is_open(self, law):
        """b = 0.2 on A = 2, open: the answer stays 0, its derivative is that of (sqrt(b² + 4 A kappa) - b) / 2A."""
        A, b = self.torch.full((1, 1), 2.0, dtype=self.torch.float64), 0.2
        for kappa in (0.0, 0.03):
            at = self.torch.tensor([b], dtype=self.torch.float64, requires_grad=True)
            lambda_, _, _ = self.module.solve(A, at, cones="unilateral", law=law, kappa=kappa, **EXACT)
            lambda_.sum().backward()
            assert lambda_.item() == 0.0
            wanted = (b / np.sqrt(b ** 2 + 8 * kappa) - 1) / 4 if kappa else 0.0
            assert at.grad.item() == pytest.approx(wanted, abs=1e-14)

    def test_unrolled_is_that_of_so_many_sweeps(self, law):
        """PyTorch's own check by differences, of five sweeps that are far from an answer."""
        numbers = self.tensors(problem(3))
        start = self.torch.from_numpy(np.random.default_rng(1).normal(size=ROWS)).requires_grad_()

        def sweeps(root, start, *rows):
            return self.module.solve(root @ root.T, *rows, warm_start=start, cones=list(CONES), law=law, solver="pgs",
                                     tolerance=0, max_iterations=5, derivative="unrolled")[:2]

        root = self.torch.linalg.cholesky(numbers[0].detach()).requires_grad_()
        assert self.torch.autograd.gradcheck(sweeps, [root, start, *numbers[1:]], eps=1e-6, atol=1e-6, rtol=1e-5)
        with pytest.raises(ValueError, match="expected solver='pgs', tolerance=0"):
            self.module.solve(*(part.detach() for part in numbers), cones=list(CONES), derivative="unrolled")

    def test_the_operator_keeps_pytorchs_rules(self, law):
        tensors = [self.torch.stack([part, part]).requires_grad_() for part in self.tensors(problem(1), False)]
        arguments = (*tensors, None, None, self.module._text_of(list(CONES)), law, "auto", 1e-10, 2000)
        found = self.torch.library.opcheck(self.torch.ops.stiction.solve, arguments)
        assert set(found.values()) == {"SUCCESS"}

    def test_compiled_and_batched_it_is_the_same(self, law):
        A, b, *rest = self.tensors(problem(2), False)
        answer = self.answer(law)
        loss = lambda b: (answer(A, b, *rest)[0] ** 2).sum()  # noqa: E731
        wanted, = self.torch.autograd.grad(loss(b.requires_grad_()), b)
        compiled = self.torch.compile(loss, fullgraph=True, backend="aot_eager")
        found, = self.torch.autograd.grad(compiled(b), b)
        assert self.torch.equal(found, wanted)
        if not hasattr(self.torch.library, "register_vmap"):
            pytest.skip("PyTorch before 2.5 has no rule for vmap: batched derivatives are NOT tested")
        lambda_ = answer(A, b, *rest)[0]
        many, = self.torch.autograd.grad(lambda_, b, self.torch.eye(ROWS).double(), is_grads_batched=True,
                                         retain_graph=True)
        one, = self.torch.autograd.grad(lambda_, b, self.torch.eye(ROWS).double()[3])
        assert self.torch.equal(many[3], one)
        scaled = self.torch.stack([0.5 * b, b]).detach()
        assert self.torch.equal(self.torch.func.vmap(loss)(scaled)[1], loss(b).detach())

    def test_padding_and_what_was_not_solved_get_zeros(self, law):
        numbers = [np.stack([part, part]) for part in problem(0)]
        tensors = self.tensors(numbers)
        counts = self.torch.tensor([ROWS, 0], dtype=self.torch.int32)
        lambda_, _, _ = self.module.solve(*tensors, counts=counts, cones=list(CONES), law=law, **EXACT)
        lambda_[0].sum().backward()
        assert all(not part.grad[1].any() for part in tensors) and tensors[1].grad[0].any()
        b = tensors[1].detach().requires_grad_()
        self.answer(law, max_iterations=0)(tensors[0].detach(), b, *tensors[2:])[0].sum().backward()
        assert not b.grad.any()

    def test_a_second_derivative_is_refused(self, law):
        A, b, *rest = self.tensors(problem(0))
        slope, = self.torch.autograd.grad(self.answer(law)(A, b, *rest)[0].sum(), b, create_graph=True)
        with pytest.raises(RuntimeError, match="solve_backward"):
            slope.sum().backward()


class TestWorldsInPyTorch:
    @pytest.fixture(autouse=True)
    def _torch(self):
        self.torch = framework("torch")
        import stiction.torch
        self.step = stiction.torch.step_world
        self.make, begin, _ = heap(envs=2)
        self.world = self.make()
        self.begin = {name: self.torch.from_numpy(part) for name, part in vars(begin).items()}

    def test_a_step_passes_gradcheck(self):
        begin = self.begin
        inputs = tuple(begin[name].clone().requires_grad_() for name in ("twist", "wrench"))

        def step(twist, wrench):
            after = self.step(self.world, begin["position"], begin["orientation"], twist, wrench)
            return after.position, after.twist

        assert self.torch.autograd.gradcheck(step, inputs, eps=1e-6, atol=1e-6, rtol=1e-5)

    def test_a_rollout_is_the_chain_of_its_steps(self):
        state = [self.begin[name].clone() for name in ("position", "orientation", "twist")]
        push = self.torch.zeros(3, 2, 4, 6, dtype=self.torch.float64, requires_grad=True)
        state[2].requires_grad_()
        after, kept, world = tuple(state), [], self.make()
        for k in range(3):
            after = self.step(self.world, *after, push[k])
        (after.position[..., 0].sum() + 2 * after.twist[..., 5].sum()).backward()
        now = [part.detach().numpy() for part in state]
        for k in range(3):
            world.reset(*(None, *now))
            kept.append(stiction.WorldStep(world))
            now = list(world.state())
        by_position, by_twist = np.zeros((2, 4, 3)), np.zeros((2, 4, 6))
        by_position[..., 0], by_twist[..., 5] = 1, 2
        for k in (2, 1, 0):
            found = kept[k].vjp(position=by_position, twist=by_twist)
            by_position, by_twist = found.position, found.twist
            np.testing.assert_array_equal(push.grad[k].numpy(), found.wrench)
        np.testing.assert_array_equal(state[2].grad.numpy(), by_twist)
        assert not after.orientation.requires_grad and np.abs(by_twist).max() > 0

    def test_second_derivatives_are_refused(self):
        twist = self.begin["twist"].clone().requires_grad_()
        after = self.step(self.world, self.begin["position"], self.begin["orientation"], twist)
        first, = self.torch.autograd.grad(after.twist.sum(), twist, create_graph=True)
        with pytest.raises(RuntimeError, match="step_world: expected a derivative once"):
            first.sum().backward()

    def test_mistakes_are_named(self):
        begin = self.begin
        with pytest.raises(TypeError, match="twist: expected float64"):
            self.step(self.world, begin["position"], begin["orientation"], begin["twist"].float())
