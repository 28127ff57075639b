"""First guesses: weighed as NumPy weighs them, known by id, harmless, the same bits alone and among others."""

import sys
import types

import numpy as np
import pytest

from conftest import ROOT

import stiction
from stiction import Batch, Solver
from stiction.learning import Dense, Guess, Ridge

sys.path.insert(0, str(ROOT / "tools"))
judge = pytest.importorskip("check_law")  # needs h5py

CONES = (("friction", 3), ("unilateral", 1), ("box", 1), ("free", 1), ("friction", 4))
KINDS = np.array([{"free": 0, "unilateral": 1, "box": 2, "friction": 3}[kind] for kind, _ in CONES], np.uint8)
DIMS = np.array([dim for _, dim in CONES], np.int64)
ROWS = int(DIMS.sum())
FIRST = np.concatenate([[0], np.cumsum(DIMS)])


def problem(rng, dtype="float64"):
    """Cones of every kind: A, b, mu, R, lo, hi of one environment."""
    J = rng.normal(size=(ROWS, ROWS + 2))
    mu, lo, hi = np.zeros((3, ROWS))
    mu[[1, 2, 7, 8, 9]] = rng.uniform(0.2, 1, 5)
    lo[4], hi[4] = -0.1, 0.2
    return types.SimpleNamespace(A=(J @ J.T / ROWS).astype(dtype), b=(rng.normal(size=ROWS) - 0.3).astype(dtype),
                                 mu=mu.astype(dtype), R=rng.uniform(0.02, 0.1, ROWS).astype(dtype), lo=lo.astype(dtype),
                                 hi=hi.astype(dtype))


def batch_of(problems, law="convex", form="delassus"):
    part = {name: np.stack([getattr(p, name) for p in problems]) for name in ("A", "b", "mu", "R", "lo", "hi")}
    A, b = part.pop("A"), part.pop("b")
    if form == "delassus":
        return Batch.from_delassus(A, b, cones=list(CONES), law=law, **part)
    half = np.linalg.cholesky(A)  # J = half, M = 1
    free = np.stack([np.linalg.solve(h, x) for h, x in zip(half, b)])
    return Batch.from_jacobian(half, np.ones(b.shape), free, cones=list(CONES), law=law, **part)


def ids_of(envs):
    return np.tile(np.array([7, 3, 11, 5, 2**63 + 1], np.uint64), (envs, 1))


def cones(p):
    """(kind, rows) of each cone."""
    return [(kind, slice(FIRST[i], FIRST[i + 1])) for i, (kind, _) in enumerate(CONES)]


def projected(p, x):
    """By the definition: the nearest point of the circular unit cone, after its tangents were divided by mu."""
    out = np.array(x, float)
    for kind, rows in cones(p):
        if kind == "unilateral":
            out[rows] = max(x[rows][0], 0)
        elif kind == "box":
            out[rows] = np.clip(x[rows], p.lo[rows], p.hi[rows])
        elif kind == "friction":
            scale = np.concatenate([[1], p.mu[rows][1:]])
            y = x[rows] / scale
            out[rows] = scale * on_unit_cone(y)
    return out


def on_unit_cone(y):
    length = np.linalg.norm(y[1:])
    if length <= y[0]:
        return y
    if length <= -y[0]:
        return 0 * y
    on = (y[0] + length) / 2
    return np.concatenate([[on], on * y[1:] / length])


def energy(p, x):
    B = p.A.astype(float) + np.diag(p.R.astype(float))
    return 0.5 * x @ B @ x + p.b.astype(float) @ x


def residual(p, x):
    """The largest error over cones (docs/math/residual.md), by the judge that shares no code with the library."""
    B = p.A.astype(float) + np.diag(p.R.astype(float))
    rows = {"cone_kind": KINDS, "cone_row_ptr": FIRST, "row_param": p.mu, "row_lo": p.lo, "row_hi": p.hi}
    return float(judge.Cones(rows).errors(x, B @ x + p.b.astype(float), np.diag(B), "coulomb").max())


def scattered(seed, dtype="float64"):
    """Candidates of all sizes, as callables."""
    def candidate(k):
        return lambda step: np.random.default_rng([seed, k]).normal(size=step.b.shape) * 10.0 ** (k - 2)
    return ["zero", *(candidate(k) for k in range(4))]


@pytest.mark.parametrize("form", ["delassus", "jacobian"])
@pytest.mark.parametrize("dtype", ["float64", "float32"])
@pytest.mark.parametrize("law", ["convex", "coulomb"])
def test_the_best_candidate_is_taken_as_numpy_weighs_them(law, dtype, form):
    if form == "jacobian" and dtype == "float32":
        pytest.skip("the Jacobian form is weighed in the same code")
    rng = np.random.default_rng(3)
    problems = [problem(rng, dtype) for _ in range(20)]
    batch = batch_of(problems, law, form)
    guess = Guess(scattered(1))
    start = guess.start(batch, ids_of(20))
    assert start.shape == (20, ROWS) and start.dtype == dtype
    raw = [np.zeros(20 * ROWS)] + [np.random.default_rng([1, k]).normal(size=20 * ROWS) * 10.0 ** (k - 2) for k in range(4)]
    for env, p in enumerate(problems):
        wanted = [projected(p, value.reshape(20, ROWS)[env]) for value in raw]
        weights = [(energy if law == "convex" else residual)(p, value.astype(dtype).astype(float)) for value in wanted]
        np.testing.assert_allclose(guess.weights[:, env], weights, rtol=1e-5 if dtype == "float32" else 1e-9, atol=1e-12)
        assert guess.chosen[env] == np.argmin(weights)
        np.testing.assert_allclose(start[env], wanted[np.argmin(weights)], rtol=1e-6 if dtype == "float32" else 1e-12,
                                   atol=1e-7 if dtype == "float32" else 1e-14)
    assert len(set(guess.chosen.tolist())) >= 3 and sum(guess.stats()["taken"].values()) == 20


def test_ties_go_to_the_first_and_what_is_not_finite_is_dropped():
    batch = batch_of([problem(np.random.default_rng(0))])

    def same(step):
        return np.full(step.b.shape, 0.01)

    def poisoned(step):
        return np.where(np.arange(ROWS) == 5, np.nan, 0.01)

    def huge(step):
        return np.full(step.b.shape, 1e200)

    for candidates, chosen in (([poisoned, same, same, "zero"], None), (["last", "zero"], 0), ([huge, poisoned], -1)):
        guess = Guess(candidates)
        start = guess.start(batch, ids_of(1))
        assert np.isfinite(start).all()
        if chosen is not None:
            assert guess.chosen[0] == chosen
        else:
            assert guess.chosen[0] in (1, 3) and guess.weights[1] == guess.weights[2] and guess.weights[0] == np.inf
    assert not start.any() and guess.stats()["dropped"] == {"huge": 1, "poisoned": 1}


def drift(rng, problems, size):
    """The next step's problems: another b and a little of A."""
    return [types.SimpleNamespace(**vars(p) | {"b": p.b + size * rng.normal(size=ROWS), "A": p.A * (1 + 0.1 * size)})
            for p in problems]


@pytest.mark.parametrize("law", ["convex", "coulomb"])
def test_the_active_set_predicts_what_stays_in_its_modes(law):
    """A step that changes no mode is predicted to second order: a tenth of the step errs by a hundredth."""
    rng = np.random.default_rng(8)
    problems, errors = [problem(rng) for _ in range(40)], []
    for size in (1e-3, 1e-4):
        guess, solver = Guess(["active_set"]), Solver(tolerance=1e-13, max_iterations=20000)
        first = batch_of(problems, law)
        solver.solve(first, guess=guess, ids=ids_of(40))
        after = batch_of(drift(np.random.default_rng(2), problems, size), law)
        start, wanted = guess.start(after, ids_of(40)), solver.solve(after).lambda_
        assert (guess.chosen == 0).mean() > 0.9
        far = np.abs(start - wanted).max(1)[guess.chosen == 0]
        errors.append(np.median(far))
        assert np.median(far) < 0.05 * np.median(np.abs(wanted - solver.solve(first).lambda_).max(1))
    assert errors[1] < 0.03 * errors[0]


@pytest.mark.parametrize("law", ["convex", "coulomb"])
def test_a_guess_changes_how_long_a_solve_takes_and_not_what_is_solved(law):
    rng = np.random.default_rng(4)
    problems, solver = [problem(rng) for _ in range(30)], Solver(solver="npgs", tolerance=1e-10, max_iterations=5000)
    guess, sweeps = Guess(), []
    for _ in range(5):
        batch = batch_of(problems, law)
        guessed, cold = solver.solve(batch, guess=guess, ids=ids_of(30)), solver.solve(batch)
        assert guessed.solved.all() and stiction.verify(batch, guessed)[:, 0].max() < 1e-9
        np.testing.assert_allclose(guessed.w, cold.w, atol=1e-7)
        sweeps.append((guessed.iterations.sum(), cold.iterations.sum()))
        problems = drift(rng, problems, 1e-3)
    assert sweeps[0][0] == sweeps[0][1] and all(warm < 0.8 * cold for warm, cold in sweeps[1:])
    assert guess.stats()["taken"]["active_set"] > 100


def test_contacts_are_known_by_their_ids_wherever_they_stand():
    """Environments of other numbers of contacts, in another order, some gone and some new."""
    rng = np.random.default_rng(5)
    ids = [np.array([5, 9, 2], np.uint64), np.array([2, 7, 5], np.uint64)]
    matrices = [np.tile(np.eye(9) + 0.1, (2, 1, 1)) for _ in ids]
    counts, b = np.array([2, 3], np.int32), rng.normal(size=(2, 9)) - 1
    first = Batch.from_delassus(matrices[0], b, cone_counts=counts, mu=0.5)
    guess, solver = Guess(["last"]), Solver(tolerance=1e-12)
    solution = solver.solve(first, guess=guess, ids=np.stack([ids[0]] * 2))
    counts[:] = [3, 3]
    start = guess.start(first, np.stack([ids[1]] * 2)).reshape(2, 3, 3)
    was = solution.lambda_.reshape(2, 3, 3)
    np.testing.assert_array_equal(start[0, 2], was[0, 0])       # 5
    assert not start[0, 0].any() and not start[0, 1].any()      # 2 was beyond the count, 7 is new
    np.testing.assert_array_equal(start[1, 0], was[1, 2])       # 2
    np.testing.assert_array_equal(start[1, 2], was[1, 0])       # 5


def test_of_equal_ids_the_first_is_served_and_other_cones_are_not():
    A, b = np.eye(6)[None], np.array([[-1.0, 0, 0, -2.0, 0, 0]])
    guess, solver = Guess(["last"]), Solver(tolerance=1e-12)
    batch = Batch.from_delassus(A, b, mu=0.5)
    solver.solve(batch, guess=guess, ids=np.array([[4, 4]]))
    start = guess.start(batch, np.array([[4, 4]]))
    np.testing.assert_allclose(start, [[1, 0, 0, 0, 0, 0]])
    other = Batch.from_delassus(A, b, cones=["unilateral"] * 6)
    assert not guess.start(other, np.array([[4, 1, 2, 3, 5, 6]])).any()
    rows = {"R": np.full((1, 6), 0.1), "hi": np.ones((1, 6))}
    ids = np.arange(6)[None]
    solver.solve(Batch.from_delassus(A, b, cones="unilateral", **rows), guess=guess, ids=ids)
    assert guess.start(Batch.from_delassus(A, b, cones="unilateral", **rows), ids).any()
    assert not guess.start(Batch.from_delassus(A, b, cones="box", **rows), ids).any()


def test_environments_start_over_where_they_are_told_to():
    rng = np.random.default_rng(6)
    batch, solver = batch_of([problem(rng) for _ in range(4)]), Solver(tolerance=1e-10)
    for how in ({"ids": [0, 2]}, {"mask": np.array([1, 0, 1, 0])}, {}):
        guess = Guess(["last"])
        solver.solve(batch, guess=guess, ids=ids_of(4))
        guess.reset(**how)
        start = guess.start(batch, ids_of(4))
        assert not start[[0, 2]].any() and start[[1, 3]].any(1).all() == bool(how)


def test_a_poisoned_environment_is_forgotten_and_spoils_no_other_one():
    rng = np.random.default_rng(7)
    problems, solver = [problem(rng) for _ in range(4)], Solver(tolerance=1e-10)
    runs = []
    for poison in (False, True):
        guess = Guess()
        batch = batch_of(problems)
        for step in range(3):
            batch.b[2, 3] = np.nan if poison and step == 1 else problems[2].b[3]
            solution = solver.solve(batch, guess=guess, ids=ids_of(4))
        runs.append((solution.lambda_.copy(), solution.iterations.copy()))
    for clean, poisoned in zip(*runs):
        np.testing.assert_array_equal(clean[[0, 1, 3]], poisoned[[0, 1, 3]])
    assert runs[1][1][2] > runs[0][1][2] == 0  # it began from zero again


def learned(ridge, problems, solver, steps=120, size=0.02, deterministic=True, seed=0):
    rng, guess = np.random.default_rng(seed), Guess(["zero", "last", ridge], deterministic=deterministic)
    batch = batch_of(problems)
    base = batch.b.copy()
    for _ in range(steps):
        batch.b[:] = base + size * rng.normal(size=base.shape)
        solver.solve(batch, guess=guess, ids=ids_of(len(problems)))
    return guess


def test_ridge_learns_a_linear_map_and_is_offered_when_it_is_frozen(tmp_path):
    p, solver = problem(np.random.default_rng(11)), Solver(tolerance=1e-10, max_iterations=5000)
    ridge = Ridge()
    guess = learned(ridge, [p] * 4, solver)
    assert guess.stats()["taken"]["ridge"] == 0 and guess.stats()["dropped"]["ridge"] == 480 and len(ridge) == 1
    with pytest.raises(ValueError, match="save: expected a frozen Ridge"):
        ridge.save(tmp_path / "early.npz")
    ridge.freeze().save(tmp_path / "table.npz")
    loaded = Ridge.load(tmp_path / "table.npz")
    assert loaded.frozen and len(loaded) == 1
    guesses = [learned(table, [p] * 4, solver, steps=20, seed=1) for table in (ridge, loaded)]
    assert guesses[0].stats() == guesses[1].stats() and guesses[0].stats()["taken"]["ridge"] > 60
    assert learned(Ridge(), [p] * 4, solver, deterministic=False).stats()["taken"]["ridge"] > 100
    # It learned the least-squares map of its samples: as good as lstsq on other samples of its own.
    batch, rng = batch_of([p] * 100), np.random.default_rng(2)
    batch.b[:] += 0.02 * rng.normal(size=batch.b.shape)
    alone = Guess([loaded])
    start = alone.start(batch, ids_of(100))
    wanted = solver.solve(batch).lambda_
    assert np.abs(start - wanted).mean() < 0.2 * np.abs(wanted - wanted.mean(0)).mean()


def test_a_frozen_table_has_the_same_bits_alone_and_among_others(tmp_path):
    rng = np.random.default_rng(12)
    table = rng.normal(size=(ROWS, 3 * ROWS + 1)).astype(np.float32) * 0.1
    problems = [problem(rng) for _ in range(6)]
    net = Dense([(rng.normal(size=(16, 3 * ROWS)), rng.normal(size=16)), (rng.normal(size=(ROWS, 16)) * 0.1, np.zeros(ROWS))])
    net.save(tmp_path / "net.npz")
    net = Dense.load(tmp_path / "net.npz")
    ridge = Ridge().freeze()
    ridge._tables = {topology(problems): table}
    together = [Guess([c]).start(batch_of(problems), ids_of(6)) for c in (ridge, net)]
    alone = [Guess([c]).start(batch_of([problems[4]]), ids_of(1)) for c in (ridge, net)]
    for several, one in zip(together, alone):
        np.testing.assert_array_equal(several[4], one[0])
        assert one.any()
    # By NumPy's own products: b, last b and last reactions in the order of ids (3, 5, 7, 11, 2^63 + 1).
    order = np.concatenate([np.arange(FIRST[c], FIRST[c + 1]) for c in (1, 3, 0, 2, 4)])
    x = np.concatenate([problems[4].b[order], np.zeros(2 * ROWS)])
    hidden = np.maximum(net.layers[0][0] @ x + net.layers[0][1], 0)
    for found, raw in zip(alone, (table @ np.append(x, 1), net.layers[1][0] @ hidden + net.layers[1][1])):
        value = np.zeros(ROWS)
        value[order] = raw
        np.testing.assert_allclose(found[0], projected(problems[4], value), atol=1e-6)


def topology(problems):
    seen = []
    Guess([lambda step: seen.extend(key for key, _, _ in step.groups())]).start(batch_of(problems), ids_of(len(problems)))
    return seen[0]


def test_a_loops_bits_do_not_depend_on_neighbours():
    rng = np.random.default_rng(13)
    problems, solver = [problem(rng) for _ in range(5)], Solver(solver="npgs", tolerance=1e-6)
    hashes = []
    for envs in ([3], [0, 1, 2, 3, 4], [4, 3, 3]):
        guess, moving = Guess(), [problems[env] for env in envs]
        for step in range(4):
            solution = solver.solve(batch_of(moving), guess=guess, ids=ids_of(len(envs)))
            moving = [types.SimpleNamespace(**vars(p) | {"b": p.b + 0.01 * np.random.default_rng(step).normal(size=ROWS)})
                      for p in moving]
        hashes.append(solution.lambda_[envs.index(3)].tobytes())
    assert len(set(hashes)) == 1


def test_empty_batches_have_empty_guesses():
    guess, solver = Guess(), Solver()
    none = Batch.from_delassus(np.zeros((0, 6, 6)), np.zeros((0, 6)))
    bare = Batch.from_delassus(np.zeros((2, 6, 6)), np.zeros((2, 6)), counts=np.zeros(2, np.int32))
    for batch, ids in ((none, np.zeros((0, 2), np.int64)), (bare, np.zeros((2, 2), np.int64))):
        for _ in range(2):
            solver.solve(batch, guess=guess, ids=ids)
    assert guess.chosen.tolist() == [0, 0]


def simple(envs=1):
    return Batch.from_delassus(np.tile(np.eye(6), (envs, 1, 1)), np.full((envs, 6), -1.0), mu=0.5)


IDS = np.array([[1, 2]])
MISTAKES = {
    "no candidates": (lambda _: Guess([]), ValueError, "candidates: expected at least one"),
    "a candidate that there is not": (lambda _: Guess(["luck"]), ValueError, r"candidates\[0\]: expected one of zero"),
    "beta of 0": (lambda _: Guess(beta=0), ValueError, r"beta: expected a number in \(0, 1\], got 0"),
    "a penalty of 0": (lambda _: Ridge(regularisation=0), ValueError, "regularisation: expected a number > 0"),
    "no ids": (lambda _: Solver().solve(simple(), guess=Guess()), ValueError, "ids: expected the ids of contacts"),
    "two starts": (lambda _: Solver().solve(simple(), guess=Guess(), ids=IDS, warm_start=np.zeros((1, 6))), ValueError,
                   "warm_start: expected None beside a guess, got both"),
    "ids of rows": (lambda _: Guess().start(simple(), np.zeros((1, 6), np.int64)), ValueError, "ids: expected int64"),
    "ids that are not whole": (lambda _: Guess().start(simple(), IDS * 0.5), TypeError, "ids: expected uint64"),
    "not a batch": (lambda _: Guess().start(3, IDS), TypeError, "batch: expected a stiction.Batch, got int"),
    "another batch's solution": (lambda _: wrong_solution(), ValueError, "solution: expected that of the batch whose"),
    "reactions of another length": (lambda _: Guess([lambda step: np.zeros(5)]).start(simple(), IDS), ValueError,
                                    r"candidates\[0\]: expected reactions \(6,\), got \(5,\)"),
    "both ways to start over": (lambda _: Guess().reset(ids=[0], mask=[1]), ValueError, "ids: expected ids or mask"),
    "no layers": (lambda _: Dense([]), ValueError, "layers: expected layers from 3 n numbers to n, got none"),
    "layers of another width": (lambda _: Dense([(np.zeros((4, 9)), np.zeros(4)), (np.zeros((3, 5)), np.zeros(3))]),
                                ValueError, r"layers\[1\]: expected weights \(out, 4\)"),
    "layers to another size": (lambda _: Dense([(np.zeros((4, 9)), np.zeros(4))]), ValueError, "got 9 to 4"),
    "layers with NaN": (lambda _: Dense([(np.full((3, 9), np.nan), np.zeros(3))]), ValueError, "expected finite"),
    "a file that is not there": (lambda folder: Ridge.load(folder / "no.npz"), FileNotFoundError, "no.npz"),
    "a file of words": (lambda folder: Ridge.load(written(folder, b"words")), ValueError, "cannot be read"),
    "half a file": (lambda folder: Ridge.load(written(folder, saved(folder)[:100])), ValueError, "cannot be read"),
    "a file of layers": (lambda folder: Ridge.load(folder_with_layers(folder)), ValueError, "a table of kind 'ridge'"),
}


def wrong_solution():
    guess = Guess()
    guess.start(simple(), IDS)
    guess.remember(Solver().solve(simple()))


def written(folder, content):
    (folder / "table.npz").write_bytes(content)
    return folder / "table.npz"


def saved(folder):
    Ridge().freeze().save(folder / "good.npz")
    return (folder / "good.npz").read_bytes()


def folder_with_layers(folder):
    Dense([(np.zeros((3, 9)), np.zeros(3))]).save(folder / "net.npz")
    return folder / "net.npz"


@pytest.mark.parametrize("mistake", MISTAKES, ids=lambda name: name.replace(" ", "_"))
def test_mistakes_are_named(mistake, tmp_path):
    make, error, message = MISTAKES[mistake]
    with pytest.raises(error, match=message):
        make(tmp_path)
