"""Batches of J and M and of bodies in files: the command line's answers are those of the solver here."""

import json
import subprocess

import h5py
import numpy as np
import pytest

import stiction
from stiction import Batch, Solver

DTYPES = pytest.mark.parametrize("dtype", ["float32", "float64"])


def jacobian(dtype="float64", mass="dense", law="coulomb", **given):
    rng = np.random.default_rng(2)
    J, v_free, target = rng.normal(size=(4, 9, 12)), rng.normal(size=(4, 12)) - 1, 0.1 * rng.normal(size=(4, 9))
    spread = rng.normal(size=(4, 12, 12))
    M = {"dense": np.eye(12) + 0.1 * spread @ spread.swapaxes(1, 2), "diagonal": rng.uniform(0.5, 2, (4, 12)),
         "blocks": np.tile(2 * np.eye(3) + 0.3, (4, 4, 1, 1))}[mass]
    arrays = (part.astype(dtype) for part in (J, M, v_free, target))
    return Batch.from_jacobian(*arrays, mu=np.full((4, 9), 0.7, dtype), R=np.full((4, 9), 0.01, dtype), law=law, **given)


def flat(dtype="float64"):
    """Two environments of unlike size, J by its entries; M as a factor."""
    rng = np.random.default_rng(3)
    sizes, dofs = np.array([6, 3]), np.array([7, 4])
    indices = np.concatenate([np.sort(rng.choice(dofs[e], 3, replace=False)) for e in (0, 1) for _ in range(sizes[e])])
    factors = [np.tril(np.eye(n) + 0.2 * rng.normal(size=(n, n))) for n in dofs]
    return Batch.from_jacobian(
        rng.normal(size=len(indices)).astype(dtype), np.concatenate([f.reshape(-1) for f in factors]).astype(dtype),
        rng.normal(size=11).astype(dtype) - 1, offsets=np.array([0, 6, 9]), dof_offsets=np.array([0, 7, 11]),
        indptr=3 * np.arange(10), indices=indices.astype(np.int32), mass_block=0, mass_form="factor", mu=0.5,
        R=np.full(9, 0.05, dtype), law="convex")


def bodies(dtype="float64", **options):
    """Two environments: boxes that press on each other, on a belt, on the world, on a hinge and on a body that cannot move."""
    rng = np.random.default_rng(5)
    count, contacts = 5, 7
    spread = rng.normal(size=(2, count, 3, 3))
    inertia = np.eye(3) + 0.2 * spread @ spread.swapaxes(2, 3)
    inertia = inertia[..., [0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]]
    inertia[:, 3] = 0, 0, 0, 0, 0, 1.5  # turns about z alone
    inv_mass = rng.uniform(0.5, 2, (2, count))
    inv_mass[:, 3:] = 0
    inertia[:, 4] = 0
    normal = rng.normal(size=(2, contacts, 3))
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    a, b = np.array([-1, 0, 1, 2, 3, 0, 4]), np.array([0, 1, 2, 0, 1, -1, 1])
    kinematic = np.zeros((2, count), np.uint8)
    kinematic[:, 2] = 1
    numbers = dict(inv_mass=inv_mass, inv_inertia=inertia, twist=rng.normal(size=(2, count, 6)),
                   twist_change=0.1 * rng.normal(size=(2, count, 6)), arm_a=rng.normal(size=(2, contacts, 3)),
                   arm_b=rng.normal(size=(2, contacts, 3)), normal=normal, mu=rng.uniform(0.2, 1, (2, contacts)),
                   depth=0.01 * rng.normal(size=(2, contacts)), restitution=rng.choice([0, 0.5], (2, contacts)))
    return Batch.from_bodies(**{name: np.ascontiguousarray(part, dtype) for name, part in numbers.items()}, kinematic=kinematic,
                             body_a=np.tile(a, (2, 1)).astype(np.int32), body_b=np.tile(b, (2, 1)).astype(np.int32),
                             **{"dt": 0.01, "slop": 0.001, "cfm": 1e-4} | options)


def by_command_line(cli, path, folder, *words, form="jacobian"):
    """Reactions and their hash, of J and M."""
    report, output = folder / "report.json", folder / "output.h5"
    done = subprocess.run([cli, "solve", path, "--form", form, "--json", report, "-o", output, *words],
                          capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    with h5py.File(output) as file:
        return file["lambda"][:], json.loads(report.read_text())["hash"]


@DTYPES
@pytest.mark.parametrize("mass", ["dense", "diagonal", "blocks"])
def test_the_command_line_finds_the_bits_of_a_saved_batch_of_j_and_m(cli, tmp_path, mass, dtype):
    batch = jacobian(dtype, mass)
    batch.save(tmp_path / "batch.h5")
    solution = Solver(tolerance=1e-4).solve(batch)
    assert solution.solved.all()
    _, found = by_command_line(cli, tmp_path / "batch.h5", tmp_path, "--tolerance", "1e-4", "--precision",
                               {"float32": "f32", "float64": "f64"}[dtype])
    assert found == solution.hash()
    again = Batch.from_file(tmp_path / "batch.h5")
    assert (len(again), again.law) == (4, "coulomb")
    np.testing.assert_array_equal(again.extras["J"].reshape(4, 9, 12), batch.J)
    np.testing.assert_array_equal(again.extras["v_free"].reshape(4, 12), batch.v_free)
    np.testing.assert_array_equal(again.extras["target"].reshape(4, 9), batch.target)


def test_rows_that_are_not_in_use_are_left_out(cli, tmp_path):
    counts = np.array([9, 3, 0, 6], np.int32)
    batch = jacobian(counts=counts)
    batch.save(tmp_path / "batch.h5")
    counts[1] = 6  # read at every call
    batch.save(tmp_path / "later.h5")
    for name, rows in (("batch", 18), ("later", 21)):
        again = Batch.from_file(tmp_path / f"{name}.h5")
        assert (again.rows, len(again.extras["J_offsets"]), len(again.extras["v_free"])) == (rows, rows + 1, 48)
    solution = Solver(tolerance=1e-9).solve(batch)
    found, _ = by_command_line(cli, tmp_path / "later.h5", tmp_path, "--tolerance", "1e-9")
    used = np.concatenate([solution.lambda_[env, :count] for env, count in enumerate(counts)])
    np.testing.assert_array_equal(found, used)


@DTYPES
def test_entries_of_j_and_a_factor_of_m_come_through(cli, tmp_path, dtype):
    batch = flat(dtype)
    batch.save(tmp_path / "batch.h5")
    solution = Solver(tolerance=1e-4).solve(batch)
    found, _ = by_command_line(cli, tmp_path / "batch.h5", tmp_path, "--tolerance", "1e-4")
    np.testing.assert_allclose(found, solution.lambda_, atol=2e-3)
    again = Batch.from_file(tmp_path / "batch.h5")
    np.testing.assert_array_equal(again.extras["J"], batch.J)
    np.testing.assert_array_equal(again.extras["J_column"], batch.indices)
    factor = batch.M[:49].reshape(7, 7).astype(float)
    np.testing.assert_allclose(again.extras["M"][:49].reshape(7, 7), factor @ factor.T, rtol=1e-14)


@pytest.mark.parametrize("law", ["coulomb", "convex"])
@pytest.mark.parametrize("solver", ["npgs", "newton"])
def test_bodies_move_as_their_rows_of_j_and_m(law, solver):
    batch = bodies(law=law)
    rows = batch.as_jacobian()
    found = Solver(solver=solver, tolerance=1e-12, max_iterations=100000).solve(batch)
    expected = Solver(solver="auto", tolerance=1e-12, max_iterations=100000).solve(rows)
    assert found.solved.all() and expected.solved.all()
    assert (found.lambda_[:, :, 0] > 0).any(axis=1).all()
    np.testing.assert_allclose(found.velocities.reshape(-1), expected.velocities, atol=1e-8)
    np.testing.assert_allclose(found.w.reshape(-1), expected.w, atol=1e-8)
    np.testing.assert_allclose(found.lambda_.reshape(-1), expected.lambda_, atol=1e-6)


def test_boxed_friction_of_bodies_is_that_of_their_rows():
    batch = bodies(law="boxed")
    rows = batch.as_jacobian()
    found = Solver(solver="npgs", tolerance=1e-10, max_iterations=100000).solve(batch)
    assert found.solved.all()
    assert stiction.verify(rows, found.lambda_.reshape(-1))[:, 0].max() < 1e-8


def test_bodies_of_environments_that_differ_and_of_none():
    batch = bodies()
    parts = {name: np.concatenate([array[0], array[1, :2]]) if array.shape[1] == 5 else array.reshape(-1, *array.shape[2:])[:7]
             for name, array in batch.arrays.items()}
    flat_batch = Batch.from_bodies(**parts, body_offsets=np.array([0, 5, 7, 7]), contact_offsets=np.array([0, 7, 7, 7]),
                                   dt=0.01, slop=0.001, cfm=1e-4)
    rows, whole = flat_batch.as_jacobian(), batch.as_jacobian()
    assert (len(rows), rows.rows, len(rows.v_free)) == (3, 21, 42)
    np.testing.assert_array_equal(rows.J, whole.J[:len(rows.J)])
    np.testing.assert_array_equal(rows.target, whole.target[:21])


@DTYPES
def test_the_command_line_solves_saved_bodies(cli, tmp_path, dtype):
    batch = bodies(dtype)
    batch.save(tmp_path / "bodies.h5")
    expected = Solver(solver="auto", tolerance=1e-4).solve(batch.as_jacobian())
    _, found = by_command_line(cli, tmp_path / "bodies.h5", tmp_path, "--tolerance", "1e-4", "--precision",
                               {"float32": "f32", "float64": "f64"}[dtype])
    assert found == expected.hash()


def test_bodies_are_found_again_in_a_saved_file(cli, tmp_path):
    box = dict(inv_mass=np.ones((1, 2)), inv_inertia=np.tile([6.0, 0, 0, 6, 0, 6], (1, 2, 1)), twist=np.zeros((1, 2, 6)),
               twist_change=np.tile([0, 0, -0.1, 0, 0, 0], (1, 2, 1)), body_a=np.array([[-1, 1]], np.int32),
               body_b=np.array([[1, 0]], np.int32), arm_a=np.tile([0, 0, 0.5], (1, 2, 1)), mu=np.full((1, 2), 0.5),
               arm_b=np.tile([0, 0, -0.5], (1, 2, 1)), normal=np.tile([0.0, 0, 1], (1, 2, 1)), depth=np.zeros((1, 2)))
    batch = Batch.from_bodies(**box)
    batch.save(tmp_path / "bodies.h5")
    found, _ = by_command_line(cli, tmp_path / "bodies.h5", tmp_path, "--tolerance", "1e-8", form="bodies")
    np.testing.assert_allclose(found, [0.2, 0, 0, 0.1, 0, 0], atol=1e-7)  # one box carries the other
    np.testing.assert_allclose(batch.as_jacobian().as_bodies().to_rows(found.reshape(-1, 3)), found, atol=1e-12)


def test_what_has_no_rows_of_one_instant_is_refused(tmp_path):
    with pytest.raises(ValueError, match="substeps: expected 1, got 2"):
        bodies(substeps=2).save(tmp_path / "bodies.h5")
    with pytest.raises(ValueError, match="max_contacts_per_env: expected room for all contacts, got 3 and .* up to 7: give 0"):
        bodies(max_contacts_per_env=3).as_jacobian()
    with pytest.raises(ValueError, match="as_jacobian: expected a batch of form 'bodies', got 'jacobian'"):
        jacobian().as_jacobian()
    solver = Solver(solver="npgs", record_failures=tmp_path / "failures")
    with pytest.raises(ValueError, match="record_failures: bodies are written as J and M; substeps: expected 1, got 2"):
        solver.solve(bodies(substeps=2))
    assert not list(tmp_path.iterdir())


@DTYPES
@pytest.mark.parametrize("solver", ["auto", "npgs"])
def test_failures_of_j_and_m_are_replayed_and_solved_by_j_and_m(cli, tmp_path, dtype, solver):
    batch = jacobian(dtype)
    solver = Solver(solver=solver, tolerance=1e-16, max_iterations=1, record_failures=tmp_path / "failures")
    guess = np.full((4, 9), 0.1, dtype)
    first = solver.solve(batch, warm_start=guess)
    second = solver.solve(batch)
    failed = int((~first.solved).sum()) + int((~second.solved).sum())
    assert failed > 1 and solver.stats()["recorded"] == failed
    (file,) = (tmp_path / "failures").glob("*jacobian*.h5")
    replayed = subprocess.run([cli, "replay", file], capture_output=True, text=True, check=False)
    assert replayed.returncode == 0, replayed.stdout + replayed.stderr
    found, _ = by_command_line(cli, file, tmp_path, "--tolerance", "1e-4")
    once = Solver(tolerance=1e-4).solve(jacobian()).lambda_[~first.solved].reshape(-1)
    np.testing.assert_allclose(found[:len(once)], once, atol=1e-2)


def test_failures_of_matrices_and_of_j_and_m_are_in_files_of_their_own(tmp_path):
    solver = Solver(solver="npgs", tolerance=1e-14, max_iterations=2, record_failures=tmp_path)
    batch = jacobian()
    A = np.einsum("erd,edk,esk->ers", batch.J, np.linalg.inv(batch.M), batch.J)
    solver.solve(Batch.from_delassus(A, np.einsum("erd,ed->er", batch.J, batch.v_free), mu=0.7, law="coulomb"))
    solver.solve(batch)
    held = {}
    for path in tmp_path.glob("*.h5"):
        with h5py.File(path) as file:
            held["J" in file] = file["solve/form"][0].decode() if "form" in file["solve"] else None
    assert held == {False: None, True: "jacobian"}


def test_failures_of_bodies_are_written_as_j_and_m(cli, tmp_path):
    batch = bodies()
    solver = Solver(solver="npgs", tolerance=1e-14, max_iterations=2, record_failures=tmp_path / "failures")
    solution = solver.solve(batch)
    assert not solution.solved.any() and solver.stats()["recorded"] == 2
    (file,) = (tmp_path / "failures").glob("*bodies*.h5")
    found, _ = by_command_line(cli, file, tmp_path, "--tolerance", "1e-6")
    expected = Solver(tolerance=1e-6).solve(batch.as_jacobian())
    np.testing.assert_array_equal(found, expected.lambda_)
    with h5py.File(file) as kept:
        np.testing.assert_array_equal(kept["solve/lambda"][:], solution.lambda_.reshape(-1))
    replayed = subprocess.run([cli, "replay", file], capture_output=True, text=True, check=False)
    assert replayed.returncode == 2 and "solved as bodies" in replayed.stderr and "--form bodies" in replayed.stderr


def test_a_body_that_is_no_number_is_written_as_such(tmp_path):
    batch = bodies()
    batch.arrays["inv_inertia"][1, 0] = np.nan
    solver = Solver(solver="npgs", tolerance=1e-3, record_failures=tmp_path / "failures")
    solution = solver.solve(batch)
    assert solution.status["code"][1] != 0
    assert solver.stats()["recorded"] == int((~solution.solved).sum())
    (file,) = (tmp_path / "failures").glob("*bodies*.h5")
    assert np.isnan(Batch.from_file(file).extras["M"]).any()
