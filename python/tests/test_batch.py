"""One problem given in every way has one answer, to the bit, and arrays are read where they are."""

import numpy as np
import pytest

import stiction
from stiction import Batch, Solver

TIGHT = {"solver": "npgs", "tolerance": 1e-10}


def answer(batch, **options):
    return Solver(**{**TIGHT, **options}).solve(batch)


@pytest.fixture
def listed(scenes):
    return Batch.from_delassus([s.A for s in scenes], [s.b for s in scenes], mu=0.7, law="coulomb")


def test_lists_padded_and_flat_arrays_have_the_same_bits(scenes, padded, listed):
    want = answer(listed)
    offsets = np.cumsum([0] + [s.rows for s in scenes])
    flat_A = np.concatenate([s.A.reshape(-1) for s in scenes])
    flat_b = np.concatenate([s.b for s in scenes])
    indptr = np.concatenate([[0], np.cumsum(np.repeat([s.rows for s in scenes], [s.rows for s in scenes]))])
    indices = np.concatenate([np.tile(np.arange(s.rows), s.rows) for s in scenes]).astype(np.int32)
    options = {"mu": 0.7, "law": "coulomb"}
    ways = {
        "padded, rows counted": Batch.from_delassus(padded.A, padded.b, counts=padded.counts, **options),
        "padded, cones counted": Batch.from_delassus(padded.A, padded.b, cone_counts=padded.counts // 3, **options),
        "padded, kinds": Batch.from_delassus(padded.A, padded.b, counts=padded.counts,
                                             kinds=np.full((4, 3), 3, np.uint8), **options),
        "flat, dense": Batch.from_delassus(flat_A, flat_b, offsets=offsets, **options),
        "flat, CSR": Batch.from_delassus(flat_A, flat_b, offsets=offsets, indptr=indptr, indices=indices, **options),
        "flat, kinds": Batch.from_delassus(flat_A, flat_b, offsets=offsets, kinds=np.full(6, 3, np.uint8), **options),
    }
    for way, batch in ways.items():
        assert answer(batch).hash() == want.hash(), way
        assert len(batch) == 4


def test_coulombs_law_holds_for_the_answer(scenes, listed):
    """Signorini and Coulomb, checked by hand on every contact: no code of the library decides here."""
    solution = answer(listed)
    assert solution.solved.all()
    touching = 0
    for env, scene in enumerate(scenes):
        one = solution[env]
        w = scene.A @ one.lambda_ + scene.b
        np.testing.assert_allclose(one.w, w, atol=1e-12)
        for c in range(0, scene.rows, 3):
            force, motion = one.lambda_[c:c + 3], w[c:c + 3]
            scale = np.abs(scene.b).max()
            assert force[0] >= 0 and motion[0] > -1e-8 * scale
            assert np.hypot(*force[1:]) <= 0.7 * force[0] + 1e-12
            assert abs(force[0] * motion[0]) < 1e-7 * scale
            if np.hypot(*motion[1:]) > 1e-6 * scale and force[0] > 1e-6:
                touching += 1
                slip = motion[1:] / np.hypot(*motion[1:])
                np.testing.assert_allclose(force[1:], -0.7 * force[0] * slip, atol=1e-5 * force[0])
    assert touching > 0


def test_friction_per_cone_per_row_and_as_a_number_agree(padded):
    per_row = np.full((4, 9), 0.7)
    per_cone = np.full((4, 3), 0.7)
    hashes = {answer(Batch.from_delassus(padded.A, padded.b, counts=padded.counts, mu=mu)).hash()
              for mu in (0.7, per_row, per_cone)}
    assert len(hashes) == 1


def test_every_kind_of_cone_does_what_it_says():
    """Diagonal A: each row has its answer alone."""
    kinds = ["free", "unilateral", "unilateral", "box", "box"]
    b = np.array([[-2.0, -3.0, 4.0, -9.0, 9.0]])
    lo, hi = np.array([[0, 0, 0, -1.0, -1.0]]), np.array([[0, 0, 0, 5.0, 5.0]])
    batch = Batch.from_delassus(2 * np.eye(5)[None], b, cones=kinds, lo=lo, hi=hi, R=np.zeros((1, 5)))
    solution = answer(batch)
    np.testing.assert_allclose(solution.lambda_[0], [1.0, 1.5, 0.0, 4.5, -1.0], atol=1e-9)


def test_compliance_is_added_to_the_diagonal(scenes):
    scene = scenes[0]
    R = np.linspace(0.1, 0.5, scene.rows)
    soft = answer(Batch.from_delassus([scene.A], [scene.b], mu=0.7, R=[R]))
    stiff = answer(Batch.from_delassus([scene.A + np.diag(R)], [scene.b], mu=0.7))
    np.testing.assert_allclose(soft.lambda_, stiff.lambda_, rtol=1e-7)


def test_arrays_are_read_where_they_are(padded):
    batch = Batch.from_delassus(padded.A, padded.b, counts=padded.counts, mu=np.full((4, 9), 0.7))
    assert batch.A is padded.A and batch.b is padded.b
    assert batch._seen["A"].pointer == padded.A.ctypes.data
    assert batch._seen["b"].pointer == padded.b.ctypes.data
    solver = Solver(**TIGHT)
    before = solver.solve(batch).hash()
    padded.b[0, :6] *= 2
    changed = solver.solve(batch).hash()
    fresh = answer(Batch.from_delassus(padded.A.copy(), padded.b.copy(), counts=padded.counts, mu=0.7)).hash()
    assert before != changed == fresh


def test_counts_are_read_anew_at_every_solve(padded):
    batch = Batch.from_delassus(padded.A, padded.b, counts=padded.counts, mu=0.7)
    solver = Solver(**TIGHT)
    whole = solver.solve(batch)
    padded.counts[2] = 3
    fewer = solver.solve(batch)
    alone = answer(Batch.from_delassus([padded.A[2, :3, :3].copy()], [padded.b[2, :3].copy()], mu=0.7))
    np.testing.assert_array_equal(fewer[2].lambda_, alone.lambda_)
    np.testing.assert_array_equal(fewer[0].lambda_, whole[0].lambda_)


@pytest.mark.parametrize("dtype", [np.uint8, np.int32, np.int64])
def test_cones_alike_are_counted_as_cones_of_ones_own_are(dtype):
    """Two ways to count: by one list that all environments share, and environment by environment."""
    cones = [("friction", 3), ("unilateral", 1), ("friction", 4), ("box", 1)]
    kinds = np.array([[3, 1, 3, 2]] * 7, np.uint8)
    A, b = np.tile(np.eye(300), (7, 1, 1)), np.ones((7, 300))  # more room than a byte counts to
    wanted = np.array([0, 1, 2, 3, 4, 5, 250], dtype)
    for counts in ({"cone_counts": wanted}, {"counts": np.array([0, 3, 4, 8, 9, 0, 9], dtype)}, {}):
        alike = Batch.from_delassus(A, b, cones=cones, **counts).layout.integers
        own = Batch.from_delassus(A, b, kinds=kinds, dims=np.array([[3, 1, 4, 1]] * 7), **counts).layout.integers
        for name, integers in own.items():
            np.testing.assert_array_equal(alike[name], integers, err_msg=f"{name}, {list(counts)}")
    for wrong in (2, 5, 10):
        with pytest.raises(ValueError, match=r"counts\[env 1\]: expected rows of whole cones, got"):
            Batch.from_delassus(A, b, cones=cones, counts=np.array([3, wrong, 0, 0, 0, 0, 0], dtype))


def test_contacts_beyond_the_room_are_flagged_and_the_others_solved(padded, scenes):
    wanted = padded.counts // 3
    wanted[0] = 5
    padded.A[0], padded.b[0] = padded.A[2], padded.b[2]
    solution = answer(Batch.from_delassus(padded.A, padded.b, cone_counts=wanted, mu=0.7))
    flag = 1 << stiction.FLAGS.index("contacts_dropped")
    assert solution.status["flags"].tolist() == [flag, 0, 0, 0]
    np.testing.assert_array_equal(solution[0].lambda_, solution[2].lambda_)


def test_what_lies_behind_an_environments_rows_is_not_written(padded):
    out = {"lambda_": np.full((4, 9), 42.0), "status": np.zeros(4, stiction.STATUS_DTYPE)}
    Solver(**TIGHT).solve(Batch.from_delassus(padded.A, padded.b, counts=padded.counts, mu=0.7), out=out)
    for env, rows in enumerate(padded.counts):
        assert (out["lambda_"][env, rows:] == 42).all() and (out["lambda_"][env, :rows] != 42).all()


def test_a_csr_matrix_of_scipy_is_a_list_entry(scenes):
    sparse = pytest.importorskip("scipy.sparse", reason="SciPy is not installed: its matrices are not tested")
    want = answer(Batch.from_delassus([s.A for s in scenes], [s.b for s in scenes], mu=0.7))
    got = answer(Batch.from_delassus([sparse.csr_matrix(s.A) for s in scenes], [s.b for s in scenes], mu=0.7))
    assert got.hash() == want.hash()


def test_narrow_numbers_are_solved_in_narrow_arithmetic(scenes):
    narrow = Batch.from_delassus([s.A.astype(np.float32) for s in scenes], [s.b.astype(np.float32) for s in scenes], mu=0.7)
    solution = answer(narrow, tolerance=1e-4)
    assert solution.lambda_.dtype == np.float32 and narrow.dtype == "float32"
    wide = answer(Batch.from_delassus([s.A for s in scenes], [s.b for s in scenes], mu=0.7))
    # Reactions move by the residual (1e-4 of max b, at most 10 here) over the smallest eigenvalue of A, some 0.05.
    np.testing.assert_allclose(solution.lambda_, wide.lambda_, atol=2e-2)


@pytest.mark.parametrize("counted", ["rows", "cones"])
def test_counts_in_device_memory_lead_to_the_same_integers(monkeypatch, counted):
    """If counts cannot be read, the framework computes with them: here NumPy plays that framework."""
    from stiction.core import layout

    class Elsewhere:
        @staticmethod
        def from_numpy(array, device):
            return array.copy()

    monkeypatch.setattr(layout, "take", lambda *arguments, **options: None)
    cones = np.array([2, 0, 3, 1], np.int32)
    given = {"counts": 3 * cones} if counted == "rows" else {"cone_counts": cones}
    host = layout.Padded(4, 9, "cpu", None, **given)
    device = layout.Padded(4, 9, "cuda:0", Elsewhere, **given)
    for change in (0, 1):
        next(iter(given.values()))[1] += 3 * change
        host.refresh()
        device.refresh()
        for name, integers in host.integers.items():
            np.testing.assert_array_equal(device.integers[name], integers, err_msg=name)


@pytest.mark.parametrize("mass", ["dense", "factor", "diagonal", "blocks"])
def test_jacobians_give_reactions_and_velocities(mass):
    rng = np.random.default_rng(3)
    envs, rows, dofs = 5, 6, 8
    J, v_free = rng.normal(size=(envs, rows, dofs)), rng.normal(size=(envs, dofs)) - 1
    half = rng.normal(size=(envs, 2, 4, 4))
    blocks = half @ half.transpose(0, 1, 3, 2) + 4 * np.eye(4)
    M = np.zeros((envs, dofs, dofs))
    if mass == "diagonal":
        given = rng.uniform(1, 3, size=(envs, dofs))
        M[:, np.arange(dofs), np.arange(dofs)] = given
    else:
        M[:, :4, :4], M[:, 4:, 4:] = blocks[:, 0], blocks[:, 1]
        given = {"dense": M, "factor": np.linalg.cholesky(M), "blocks": blocks}[mass]
    target = rng.normal(size=(envs, rows))
    batch = Batch.from_jacobian(J, np.ascontiguousarray(given), v_free, target, mu=0.5,
                                mass_form="factor" if mass == "factor" else "matrix")
    solution = answer(batch)
    assert solution.solved.all() and solution.velocities.shape == (envs, dofs)
    for env in range(envs):
        moved = v_free[env] + np.linalg.solve(M[env], J[env].T @ solution.lambda_[env])
        np.testing.assert_allclose(solution.velocities[env], moved, rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(solution.w[env], J[env] @ moved - target[env], atol=1e-10)


def test_a_solver_counts_what_was_solved_in_velocities():
    # A mass of 2 that would fall with 1, on a plane that gives way: lambda (1/2 + R) = 1.
    batch = Batch.from_jacobian(np.full((5, 1, 1), 1.0), np.full((5, 1, 1), 2.0), np.full((5, 1), -1.0),
                                R=np.full((5, 1), 0.5), cones="unilateral")
    solver = stiction.Solver()
    solution = solver.solve(batch)
    np.testing.assert_allclose(solution.lambda_, 1.0, rtol=1e-12)
    np.testing.assert_allclose(solution.velocities, -0.5, rtol=1e-12)
    assert solver.stats()["solvers"] == {"velocity_newton": 5}
    with pytest.raises(ValueError, match="solver"):
        stiction.Solver(solver="velocity_newton")


def test_jacobians_of_many_sizes_come_as_lists(scenes):
    batch = Batch.from_jacobian([s.J for s in scenes], [s.M for s in scenes], [s.v_free for s in scenes], mu=0.7,
                                law="coulomb")
    solution = answer(batch)
    dense = answer(Batch.from_delassus([s.A for s in scenes], [s.b for s in scenes], mu=0.7, law="coulomb"))
    np.testing.assert_allclose(solution.lambda_, dense.lambda_, atol=1e-8)
    np.testing.assert_allclose(stiction.verify(batch, solution)[:, 0], solution.residual, atol=1e-15)
    assert (stiction.verify(batch, solution.lambda_ + 1)[:3, 0] > 1e-2).all()
    assert answer(batch, device="emulated").hash() == solution.hash()
    assert [len(solution[env].velocities) for env in range(4)] == [8, 5, 12, 3]
    np.testing.assert_array_equal(solution[3].velocities, scenes[3].v_free)


def bodies(envs=2, **options):
    """A ball of 1 kg on the floor, falling for a step and pushed sideways."""
    one = np.ones((envs, 1))
    down = np.zeros((envs, 1, 6))
    down[..., 2], down[..., 0] = -0.05, 0.01
    return Batch.from_bodies(one, np.tile([1.0, 0, 0, 1, 0, 1], (envs, 1, 1)), np.zeros((envs, 1, 6)),
                             np.full((envs, 1), -1, np.int32), np.zeros((envs, 1), np.int32), np.zeros((envs, 1, 3)),
                             np.zeros((envs, 1, 3)), np.tile([0.0, 0, 1], (envs, 1, 1)), 0.5 * one, 0 * one,
                             twist_change=down, **options)


@pytest.mark.parametrize("solver", ["auto", "pgs", "newton", "multigrid"])
def test_bodies_rest_and_stick(solver):
    solution = Solver(solver=solver, tolerance=1e-9, max_iterations=100).solve(bodies())
    np.testing.assert_allclose(solution.lambda_[:, 0], [[0.05, -0.01, 0]] * 2, atol=1e-8)
    np.testing.assert_allclose(solution.velocities, np.zeros((2, 1, 6)), atol=1e-8)
    assert solution[1].lambda_.shape == (1, 3) and solution[1].velocities.shape == (1, 6)


def test_bodies_may_follow_one_another():
    padded, offsets = bodies(), np.array([0, 1, 2])
    flat = {name: array.reshape((2,) + array.shape[2:]) for name, array in padded.arrays.items()}
    batch = Batch.from_bodies(**flat, body_offsets=offsets, contact_offsets=offsets)
    assert Solver(max_iterations=50).solve(batch).hash() == Solver(max_iterations=50).solve(padded).hash()
