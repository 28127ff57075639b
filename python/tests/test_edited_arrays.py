"""Arrays that a caller changes between solves, gives twice, or leaves empty; and processes that fork."""

import os
import subprocess
import sys

import numpy as np
import pytest

import stiction
from stiction import Batch, Solver


def flat(environments=4):
    """Environments of two contacts each, dense and one after another."""
    rng = np.random.default_rng(3)
    half = rng.normal(size=(environments, 6, 9))
    A = np.ascontiguousarray((half @ half.transpose(0, 2, 1)).reshape(-1))
    offsets = np.arange(environments + 1, dtype=np.int64) * 6
    return A, rng.normal(size=6 * environments), offsets


@pytest.mark.parametrize("invalid", ["isolate", "reject"])
@pytest.mark.parametrize("value", [5, 10 ** 9, -1, -2 ** 62])
def test_offsets_edited_between_solves_are_refused(invalid, value):
    A, b, offsets = flat()
    solver = Solver(invalid=invalid)
    batch = Batch.from_delassus(A, b, offsets=offsets, mu=0.5)
    out = solver.solve(batch)
    before = out.hash()
    offsets[1] = value
    with pytest.raises((ValueError, stiction.Error), match=r"offset|env"):
        solver.solve(batch, out=out)
    offsets[1] = 6
    assert solver.solve(batch, out=out).hash() == before


@pytest.mark.parametrize("value", [10 ** 9, -1, 6])
def test_columns_edited_between_solves_throw_or_stay_in_their_environment(value):
    A, b, offsets = flat()
    indptr = np.arange(25, dtype=np.int64) * 6
    indices = np.tile(np.arange(6, dtype=np.int32), 24)
    batch = Batch.from_delassus(A, b, offsets=offsets, indptr=indptr, indices=indices, mu=0.5)
    solver = Solver()
    whole = solver.solve(batch)
    kept = whole.lambda_.copy()
    indices[2 * 36 + 7] = value
    try:
        answer = solver.solve(batch)
    except stiction.Error as error:
        assert f"column[env 2, row 1] = {value}" in str(error)
    else:
        assert answer.status["code"][2] == stiction.CODES.index("invalid_input")
        np.testing.assert_array_equal(np.delete(answer.lambda_.reshape(4, 6), 2, 0), np.delete(kept.reshape(4, 6), 2, 0))
    with pytest.raises(stiction.Error, match=r"column\[env 2, row 1\]"):
        Solver(invalid="reject").solve(batch)


def padded():
    A, b, _ = flat()
    return Batch.from_delassus(A.reshape(4, 6, 6), b.reshape(4, 6), mu=0.5)


def test_an_output_over_an_input_or_over_another_output_is_refused():
    batch, solver = padded(), Solver()
    status = np.zeros(4, stiction.STATUS_DTYPE)
    kept = batch.b.copy()
    for out, one, other in (({"lambda_": batch.b, "status": status}, "lambda", "batch.b"),
                            ({"lambda_": np.zeros((4, 6)), "w": batch.A.reshape(-1)[3:27].reshape(4, 6), "status": status},
                             "w", "batch.A")):
        with pytest.raises(stiction.Error, match=rf"solution.{one} and {other} overlap in memory"):
            solver.solve(batch, out=out)
    both = np.zeros((4, 6))
    with pytest.raises(stiction.Error, match="solution.w and solution.lambda overlap"):
        solver.solve(batch, out={"lambda_": both, "w": both, "status": status})
    room = np.zeros(47)
    with pytest.raises(stiction.Error, match="solution.w and solution.lambda overlap"):
        solver.solve(batch, out={"lambda_": room[:24].reshape(4, 6), "w": room[23:].reshape(4, 6), "status": status})
    np.testing.assert_array_equal(batch.b, kept)


def test_a_warm_start_may_be_the_reactions_themselves():
    batch, solver = padded(), Solver(solver="npgs", max_iterations=7, tolerance=0)
    guess = np.full((4, 6), 0.25)
    apart = solver.solve(batch, warm_start=guess.copy())
    out = {"lambda_": guess, "status": np.zeros(4, stiction.STATUS_DTYPE)}
    together = solver.solve(batch, out=out, warm_start=guess)
    np.testing.assert_array_equal(together.lambda_, apart.lambda_)


@pytest.mark.parametrize("make", [
    lambda: Batch.from_delassus(np.zeros((0, 6, 6)), np.zeros((0, 6)), mu=0.5),
    lambda: Batch.from_delassus(np.zeros((0, 6, 6)), np.zeros((0, 6)), counts=np.zeros(0, np.int32)),
    lambda: Batch.from_delassus(np.zeros(0), np.zeros(0), offsets=np.zeros(1, np.int64)),
    lambda: Batch.from_delassus([], []),
    lambda: Batch.from_jacobian(np.zeros((0, 6, 4)), np.zeros((0, 4, 4)), np.zeros((0, 4)), mu=0.5),
    lambda: Batch.from_bodies(np.zeros((0, 2)), np.zeros((0, 2, 6)), np.zeros((0, 2, 6)), np.zeros((0, 3), np.int32),
                              np.zeros((0, 3), np.int32), np.zeros((0, 3, 3)), np.zeros((0, 3, 3)), np.zeros((0, 3, 3)),
                              np.zeros((0, 3)), np.zeros((0, 3))),
], ids=["padded", "counts", "flat", "list", "jacobian", "bodies"])
def test_a_batch_of_no_environments_has_an_empty_solution(make):
    batch = make()
    solver = Solver()
    solution = solver.solve(batch)
    assert len(batch) == 0 and len(solution) == 0
    assert solution.status.shape == (0,) and solution.solved.shape == (0,)
    assert solution.lambda_.size == 0
    assert solution.hash() == f"{0:016x}"
    solver.solve(batch, out=solution, warm_start=solution.lambda_)
    if batch.form != "bodies":
        assert stiction.verify(batch, solution).shape == (0, 2)


FORKS = """
import os
import sys

import numpy as np
from stiction import Batch, Solver

rng = np.random.default_rng(3)
half = rng.normal(size=(600, 6, 9))
batch = Batch.from_delassus(half @ half.transpose(0, 2, 1), rng.normal(size=(600, 6)), mu=0.5)
solver = Solver(threads=2)
expected = solver.solve(batch).hash()
child = os.fork()
if child == 0:
    sys.exit(3 if sys.argv[1] == "exits" or solver.solve(batch).hash() == expected else 4)
sys.exit(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system has no fork()")
@pytest.mark.parametrize("child", ["exits", "solves"])
def test_a_child_of_fork_exits_and_may_solve(child):
    ran = subprocess.run([sys.executable, "-W", "ignore", "-c", FORKS, child], timeout=120, check=False)
    assert ran.returncode == 3
