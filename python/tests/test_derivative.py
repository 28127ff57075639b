"""Derivatives of solutions: against finite differences of solves, their shapes, and refusals."""

import numpy as np
import pytest

import stiction

EXACT = {"solver": "newton", "tolerance": 1e-12, "max_iterations": 100}


def contacts(scenes, law="coulomb"):
    """Returns those scenes as a list of matrices, with compliance, so that every reaction is determined."""
    def batch(change=None):
        numbers = {"A": [scene.A for scene in scenes], "b": [scene.b for scene in scenes],
                   "R": [np.full(scene.rows, 0.05) for scene in scenes],
                   "mu": [np.full(scene.rows, 0.6) for scene in scenes]}
        for name, step in (change or {}).items():
            ends = np.cumsum([np.size(part) for part in numbers[name]])
            parts = np.split(step, ends[:-1])
            numbers[name] = [part + own.reshape(part.shape) for part, own in zip(numbers[name], parts)]
        return stiction.Batch.from_delassus(**numbers, law=law)
    return batch


@pytest.mark.parametrize("law", ["convex", "coulomb"])
def test_gradients_are_those_of_finite_differences(scenes, law):
    make = contacts(scenes, law)
    batch, solver = make(), stiction.Solver(**EXACT)
    solution = solver.solve(batch)
    assert solution.solved.all()
    rng = np.random.default_rng(1)
    lambda_bar, w_bar = rng.normal(size=(2, batch.rows))

    def loss(batch):
        moved = solver.solve(batch)
        return moved.lambda_ @ lambda_bar + moved.w @ w_bar

    gradients = stiction.Derivative().vjp(batch, solution, lambda_=lambda_bar, w=w_bar)
    assert gradients.valid.all() and not gradients.flagged("subgradient").any()
    assert (gradients.status["residual"] < 1e-9).all()
    for name in ("A", "b", "R", "mu"):
        direction = rng.normal(size=getattr(gradients, name).shape)
        if name == "A":  # a change that keeps A symmetric
            ends = np.cumsum([scene.rows ** 2 for scene in scenes])
            parts = [part.reshape(scene.rows, scene.rows) for part, scene in zip(np.split(direction, ends[:-1]), scenes)]
            direction = np.concatenate([((part + part.T) / 2).ravel() for part in parts])
        step = 1e-6
        difference = (loss(make({name: step * direction})) - loss(make({name: -step * direction}))) / (2 * step)
        assert difference == pytest.approx(np.sum(getattr(gradients, name) * direction), rel=1e-4, abs=1e-5), name


def test_forward_and_reverse_agree(scenes):
    batch = contacts(scenes)()
    solution = stiction.Solver(**EXACT).solve(batch)
    derivative, rng = stiction.Derivative(), np.random.default_rng(2)
    lambda_bar, b = rng.normal(size=(2, batch.rows))
    reverse = derivative.vjp(batch, solution, lambda_=lambda_bar).b @ b
    changes = derivative.jvp(batch, solution, b=b)
    assert changes.lambda_ @ lambda_bar == pytest.approx(reverse, rel=1e-10)


def test_several_losses_have_an_axis_in_front(scenes):
    batch = contacts(scenes)()
    solution = stiction.Solver(**EXACT).solve(batch)
    bars = np.random.default_rng(3).normal(size=(3, batch.rows))
    derivative = stiction.Derivative()
    together = derivative.vjp(batch, solution, lambda_=bars)
    assert together.b.shape == bars.shape and together.A.shape == (3,) + batch.A.shape
    for k, bar in enumerate(bars):
        alone = derivative.vjp(batch, solution.lambda_, lambda_=bar)
        assert np.array_equal(alone.b, together.b[k]) and np.array_equal(alone.A, together.A[k])


def test_padded_batches_keep_their_shapes_and_their_room(padded, scenes):
    padded.A[np.isnan(padded.A)] = 7
    batch = stiction.Batch.from_delassus(padded.A, padded.b, mu=0.6, R=np.full_like(padded.b, 0.05),
                                         counts=padded.counts, law="coulomb")
    solution = stiction.Solver(**EXACT).solve(batch)
    gradients = stiction.Derivative().vjp(batch, solution, lambda_=np.ones_like(padded.b))
    assert gradients.A.shape == padded.A.shape and gradients.b.shape == padded.b.shape
    flat = stiction.Derivative().vjp(contacts(scenes)(), stiction.Solver(**EXACT).solve(contacts(scenes)()),
                                     lambda_=np.ones(sum(scene.rows for scene in scenes)))
    used = np.concatenate([gradients.b[env, :scene.rows] for env, scene in enumerate(scenes)])
    assert used == pytest.approx(flat.b, rel=1e-6, abs=1e-9)
    for env, scene in enumerate(scenes):
        assert not gradients.b[env, scene.rows:].any() and not gradients.A[env, scene.rows:].any()


def test_jacobians_pass_derivatives_of_velocities_on(scenes):
    scene = scenes[2]
    solver, rng = stiction.Solver(**EXACT), np.random.default_rng(4)

    def batch(J=0.0, M=0.0, v_free=0.0):
        return stiction.Batch.from_jacobian((scene.J + J)[None], (scene.M + M)[None], (scene.v_free + v_free)[None],
                                            mu=0.6, R=np.full((1, scene.rows), 0.05), law="coulomb")

    solution = solver.solve(batch())
    bar = rng.normal(size=(1, scene.dofs))
    gradients = stiction.Derivative().vjp(batch(), solution, velocities=bar)
    assert gradients.valid.all()
    half = rng.normal(size=scene.M.shape)
    for name, direction in (("J", rng.normal(size=scene.J.shape)), ("M", half + half.T),
                            ("v_free", rng.normal(size=scene.dofs))):
        step = 1e-6
        up, down = (np.sum(solver.solve(batch(**{name: sign * step * direction})).velocities * bar) for sign in (1, -1))
        assert (up - down) / (2 * step) == pytest.approx(np.sum(getattr(gradients, name)[0] * direction), rel=1e-5,
                                                         abs=1e-7), name


def test_jacobians_push_changes_forward(scenes):
    scene = scenes[2]
    solver, rng = stiction.Solver(**EXACT), np.random.default_rng(5)
    changes = {"J": rng.normal(size=scene.J.shape), "M": rng.normal(size=scene.M.shape), "v_free": rng.normal(size=scene.dofs),
               "mu": rng.normal(size=scene.rows)}
    changes["M"] += changes["M"].T

    def batch(step=0.0):
        return stiction.Batch.from_jacobian((scene.J + step * changes["J"])[None], (scene.M + step * changes["M"])[None],
                                            (scene.v_free + step * changes["v_free"])[None],
                                            mu=(0.6 + step * changes["mu"])[None], R=np.full((1, scene.rows), 0.05),
                                            law="coulomb")

    solution, derivative, step = solver.solve(batch()), stiction.Derivative(), 1e-6
    forward = derivative.jvp(batch(), solution, **{name: change[None] for name, change in changes.items()})
    assert forward.valid.all()
    up, down = solver.solve(batch(step)), solver.solve(batch(-step))
    for name in ("lambda_", "w", "velocities"):
        difference = (getattr(up, name) - getattr(down, name)) / (2 * step)
        assert difference == pytest.approx(getattr(forward, name), rel=1e-5, abs=1e-6), name
    with pytest.raises(ValueError, match="A: expected None"):
        derivative.jvp(batch(), solution, A=np.zeros(3))


def test_environments_without_a_derivative_get_zeros_and_a_flag(scenes):
    A = [np.ones((2, 2)), np.eye(2)]
    batch = stiction.Batch.from_delassus(A, [np.array([-1.0, -1.0])] * 2, cones="free")
    solution = stiction.Solver(tolerance=1e-10).solve(batch)
    gradients = stiction.Derivative().vjp(batch, solution, lambda_=np.ones(4))
    assert gradients.flagged("singular").tolist() == [True, False]
    assert gradients.valid.tolist() == [False, True]
    assert gradients.b.tolist() == [0, 0, -1, -1]
    limited = stiction.Solver(solver="npgs", max_iterations=0).solve(batch)
    assert stiction.Derivative().vjp(batch, limited, lambda_=np.ones(4)).flagged("unconverged").all()


def test_mistakes_name_the_argument(scenes):
    batch = contacts(scenes)()
    solution = stiction.Solver(**EXACT).solve(batch)
    derivative = stiction.Derivative()
    with pytest.raises(ValueError, match="lambda_"):
        derivative.vjp(batch, solution, lambda_=np.ones(3))
    with pytest.raises(TypeError, match="w: expected float64"):
        derivative.vjp(batch, solution, w=np.ones(batch.rows, np.float32))
    with pytest.raises(ValueError, match="velocities"):
        derivative.vjp(batch, solution, velocities=np.ones(3))
    with pytest.raises(stiction.Error, match="sweeps.count = -1"):
        derivative.unrolled_vjp(batch, -1)
    with pytest.raises(ValueError, match="warm_start: expected"):
        derivative.unrolled_vjp(batch, 3, warm_start=np.ones(batch.rows + 1))
    with pytest.raises(TypeError, match="batch"):
        derivative.vjp(solution, solution)
    with pytest.raises(stiction.Error, match="tie_tolerance"):
        stiction.Derivative(tie_tolerance=-1)
