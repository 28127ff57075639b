"""Bodies that are given as J and M, for the solvers of bodies: the velocities are those of the rows."""

import numpy as np
import pytest
from test_velocity_blocks import wall

import stiction
from stiction import Batch, Solver


def batch_of(system, R=1e-3, mass_block=6, dtype=np.float64):
    rows, columns, values, M, v_free = system
    n = rows[-1] + 1
    return Batch.from_jacobian(values.astype(dtype), M.reshape(-1).astype(dtype), v_free.astype(dtype),
                               offsets=np.array([0, n]), dof_offsets=np.array([0, len(v_free)]),
                               indptr=np.concatenate([[0], np.cumsum(np.bincount(rows))]),
                               indices=columns.astype(np.int32), mass_block=mass_block, mu=np.full(n, 0.5, dtype),
                               R=np.full(n, R, dtype), law="convex")


@pytest.mark.parametrize("solver", ["multigrid", "newton", "npgs"])
def test_bodies_move_as_their_rows_do(solver):
    batch = batch_of(wall(4, 4))
    bodies = batch.as_bodies()
    assert (bodies.batch.form, len(bodies.batch), bodies.batch.rows) == ("bodies", 1, batch.rows)
    expected = Solver(solver="auto", tolerance=1e-10).solve(batch)
    found = Solver(solver=solver, tolerance=1e-10, max_iterations=100000).solve(bodies.batch)
    assert expected.solved.all() and found.solved.all()
    np.testing.assert_allclose(found.velocities.reshape(-1), expected.velocities, atol=1e-8)
    # R is alike on all rows, so reactions are unique: a motion over R.
    np.testing.assert_allclose(bodies.to_rows(found.lambda_), expected.lambda_, atol=1e-5)
    np.testing.assert_allclose(bodies.to_contacts(expected.lambda_), found.lambda_, atol=1e-5)


def test_rows_and_contacts_are_inverse_and_keep_normals():
    bodies = batch_of(wall(3, 3), dtype=np.float32).as_bodies()
    rows = np.random.default_rng(1).standard_normal(bodies.batch.rows).astype(np.float32)
    contacts = bodies.to_contacts(rows)
    assert contacts.dtype == np.float32 and contacts.shape == (len(rows) // 3, 3)
    np.testing.assert_array_equal(contacts[:, 0], rows[::3])
    np.testing.assert_allclose(bodies.to_rows(contacts), rows, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(contacts, axis=1), np.linalg.norm(rows.reshape(-1, 3), axis=1), rtol=1e-6)


def test_arrays_outlive_the_batch_they_came_from_and_do_not_follow_it():
    batch = batch_of(wall(3, 3))
    twists = batch.v_free.copy()
    bodies = batch.as_bodies().batch
    batch.v_free[:] = np.nan
    del batch
    np.testing.assert_array_equal((bodies.twist + bodies.twist_change).reshape(-1), twists)
    assert Solver(solver="npgs", tolerance=1e-4).solve(bodies).solved.all()


def test_what_is_no_body_is_refused_by_name():
    rows, columns, values, M, v_free = wall(2, 2)
    M = M.copy()
    M[1, 4, 0] = M[1, 0, 4] = 0.1
    with pytest.raises(stiction.Error, match="environment 0: body 1") as error:
        batch_of((rows, columns, values, M, v_free)).as_bodies()
    assert error.value.code == "unsupported"
    with pytest.raises(ValueError, match="as_bodies: expected a batch of form 'jacobian', got 'delassus'"):
        Batch.from_delassus([np.eye(3)], [np.zeros(3)], cones=[[("friction", 3)]]).as_bodies()
    bodies = batch_of(wall(2, 2)).as_bodies()
    with pytest.raises(stiction.Error, match="by_contact"):
        bodies.to_rows(np.zeros(4))
    with pytest.raises(stiction.Error, match="by_row"):
        bodies.to_contacts(np.zeros(bodies.batch.rows + 3))


def test_offsets_edited_after_the_batch_was_made_are_looked_at():
    batch = batch_of(wall(2, 2))
    batch.dof_offsets[1] = 10**9
    with pytest.raises((stiction.Error, ValueError)):
        batch.as_bodies()
