"""MuJoCo's noslip by stiction, on MuJoCo Warp's arrays, against the solution that its sweeps aim at."""

import numpy as np
import pytest

from mujoco_warp_worlds import (CREEPING, disturbed, mujoco, mujoco_warp, numbers, sweep_to_the_end, worlds_of,
                                zoo_worlds)

import stiction.mujoco_warp as drop_in

pytestmark = pytest.mark.warp


@pytest.mark.parametrize("jacobian", ["dense", "sparse"])
@pytest.mark.parametrize("cone", ["pyramidal", "elliptic"])
def test_noslip_goes_to_the_end_of_the_sweeps(cone, jacobian):
    """Against the solution in double: a box that sticks, one that slides, and a joint with friction."""
    model = mujoco.MjModel.from_xml_string(CREEPING.format(cone=cone, jacobian=jacobian))
    m, d = worlds_of(model, [disturbed(model, 0, steps=1, speed=0.02)] * 2)
    mujoco_warp.forward(m, d)
    expected, left = sweep_to_the_end(model, d)
    assert left < 1e-7
    force, softly = numbers(d, "force", "qacc")
    solution = drop_in.noslip(m, d)
    assert solution.solved.all(), solution.status
    qacc, found, qfrc, Ma = numbers(d, "qacc", "force", "qfrc_constraint", "Ma")
    assert np.abs(softly[0] - expected).max() > 0.2
    assert np.abs(qacc[0] - expected).max() < 1e-4
    # Normal forces are as they were, friction within its cone, and the rest of the data agrees.
    n, kind = int(d.nefc.numpy()[0]), d.efc.type.numpy()[0]
    still = np.isin(kind[:n], (0, 3, 4, 5))
    np.testing.assert_array_equal(found[0, :n][still], force[0, :n][still])
    if cone == "pyramidal":
        pairs = lambda values: values[0, :n][kind[:n] == 6].reshape(-1, 2).sum(axis=1)  # noqa: E731
        np.testing.assert_allclose(pairs(found), pairs(force), rtol=1e-6)
        assert (found[0, :n][kind[:n] == 6] >= 0).all()
    else:
        first = d.contact.efc_address.numpy()[:, 0]
        normals = [row for row in range(n) if kind[row] == 7 and row == first[d.efc.id.numpy()[0, row]]]
        np.testing.assert_array_equal(found[0, normals], force[0, normals])
    np.testing.assert_allclose(Ma, d.qfrc_smooth.numpy() + qfrc, rtol=0, atol=1e-4 * np.abs(Ma).max())


def test_noslip_is_part_of_a_solve_that_asks_for_it():
    _, _, m, d = zoo_worlds(count=2)
    mujoco_warp.forward(m, d)
    drop_in.solve(m, d)
    iterations = numbers(d, "solver_niter")[0]
    drop_in.noslip(m, d)
    expected, counted = numbers(d, "qacc", "solver_niter")
    assert (counted > iterations).all()
    m.opt.noslip_iterations = 1
    drop_in.solve(m, d)
    assert numbers(d, "qacc")[0].tobytes() == expected.tobytes()
