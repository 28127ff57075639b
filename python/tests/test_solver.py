"""The solver against recordings, the command line, and itself on the device that stands for a GPU."""

import json
import subprocess
import threading

import numpy as np
import pytest

import stiction
from stiction import Batch, Solver

FILES = ["hand_cube", "humanoid", "pile", "quadruped_rough", "trajectory"]


@pytest.mark.parametrize("name", FILES)
def test_recorded_scenes_have_mujocos_answer(data, name):
    """MuJoCo's own Newton wrote lambda_ref. The motion A lambda is unique; both are within their residuals."""
    batch = Batch.from_file(data / f"{name}.h5")
    solution = Solver(tolerance=1e-8).solve(batch)
    assert solution.solved.all()
    wrong = np.zeros_like(batch.b)
    for env in range(len(batch)):
        rows = batch.rows_of(env)
        for row in range(rows.start, rows.stop):
            entries = slice(int(batch.row_offsets[row]), int(batch.row_offsets[row + 1]))
            error = (solution.lambda_ - batch.extras["lambda_ref"])[rows]
            wrong[row] = batch.A[entries] @ error[batch.column[entries]] + batch.R[row] * error[row - rows.start]
    assert np.abs(wrong).max() < 1e-4 * np.abs(batch.b).max()


@pytest.mark.parametrize("precision", ["f32", "f64"])
@pytest.mark.parametrize("name", ["humanoid", "trajectory"])
def test_bits_are_those_of_the_command_line(data, cli, tmp_path, name, precision):
    report = tmp_path / "report.json"
    subprocess.run([cli, "solve", data / f"{name}.h5", "--solver", "npgs", "--tolerance", "1e-4", "--precision", precision,
                    "--json", report], check=True, stdout=subprocess.DEVNULL)
    batch = Batch.from_file(data / f"{name}.h5", dtype={"f32": "float32", "f64": "float64"}[precision])
    solution = Solver(solver="npgs", tolerance=1e-4).solve(batch)
    assert solution.hash() == json.loads(report.read_text())["hash"]


@pytest.mark.parametrize("blocks", ["pairs", "strong"])
def test_blocks_have_the_bits_of_the_command_line(data, cli, tmp_path, blocks):
    report = tmp_path / "report.json"
    subprocess.run([cli, "solve", data / "pile.h5", "--solver", "npgs", "--blocks", blocks, "--tolerance", "1e-6", "--json",
                    report], check=True, stdout=subprocess.DEVNULL)
    told = json.loads(report.read_text())
    solution = Solver(solver="npgs", tolerance=1e-6, blocks=blocks).solve(Batch.from_file(data / "pile.h5"))
    assert solution.solved.all() and told["blocks"] == blocks and solution.hash() == told["hash"]


def test_saved_batches_are_solved_alike_by_the_command_line(padded, cli, tmp_path):
    batch = Batch.from_delassus(padded.A, padded.b, counts=padded.counts, mu=0.7, law="coulomb")
    batch.save(tmp_path / "batch.h5")
    report = tmp_path / "report.json"
    subprocess.run([cli, "solve", tmp_path / "batch.h5", "--solver", "auto", "--tolerance", "1e-6", "--json", report],
                   check=True, stdout=subprocess.DEVNULL)
    assert Solver(tolerance=1e-6).solve(batch).hash() == json.loads(report.read_text())["hash"]
    again = Batch.from_file(tmp_path / "batch.h5")
    assert len(again) == 4 and again.law == "coulomb"


def test_the_device_that_stands_for_a_gpu_has_the_same_bits(padded):
    batch = Batch.from_delassus(padded.A, padded.b, counts=padded.counts, mu=0.7)
    hashes = {device: Solver(device=device, solver="npgs", tolerance=1e-9).solve(batch).hash()
              for device in ("cpu", "emulated")}
    assert hashes["cpu"] == hashes["emulated"]


def test_on_a_device_the_answer_is_there_when_it_was_waited_for(padded):
    """With a stream the call returns before anything was computed; status waits."""
    batch = Batch.from_delassus(padded.A, padded.b, counts=padded.counts, mu=0.7)
    solver = Solver(device="emulated", solver="npgs")
    solution = solver.solve(batch, stream=0)
    assert (solution.lambda_ == 0).all(), "the emulated device computed before it was waited for"
    assert solution.solved.all() and (solution.lambda_[0, 0::3] > 0).any()
    waited = solver.solve(batch)
    np.testing.assert_array_equal(waited.lambda_, solution.lambda_)


def test_queued_solves_keep_their_arrays_alive(padded):
    solver = Solver(device="emulated", solver="npgs")
    for _ in range(20):  # each batch and solution is dropped at once
        solver.solve(Batch.from_delassus(padded.A.copy(), padded.b.copy(), counts=padded.counts.copy(), mu=0.7), stream=0)
    last = solver.solve(Batch.from_delassus(padded.A, padded.b, counts=padded.counts, mu=0.7), stream=0)
    solver.synchronize()
    assert last.solved.all()


def test_answers_are_written_where_asked(padded):
    batch = Batch.from_delassus(padded.A, padded.b, counts=padded.counts, mu=0.7)
    for device in ("cpu", "emulated"):
        solver = Solver(device=device, solver="npgs")
        first = solver.solve(batch)
        lambda_, status = np.zeros((4, 9)), np.zeros((4, 32), np.uint8)
        into = solver.solve(batch, out={"lambda_": lambda_, "status": status})
        assert into.lambda_ is lambda_ and into.w is None
        np.testing.assert_array_equal(lambda_, first.lambda_)
        np.testing.assert_array_equal(status.view(stiction.STATUS_DTYPE)[:, 0], first.status)
        reused = solver.solve(batch, out=first)
        assert reused.lambda_ is first.lambda_
        other = solver.solve(Batch.from_delassus(padded.A, 2 * padded.b, counts=padded.counts, mu=0.7), out=first)
        assert other.lambda_ is first.lambda_ and other is not first


@pytest.mark.parametrize("form", ["padded", "flat"])
def test_a_call_that_is_repeated_sees_what_has_changed_in_place(padded, form):
    """The third call with the same objects takes a shorter way than the first: a fresh solver has none."""
    A, b, counts = padded.A.copy(), padded.b.copy(), padded.counts.copy()
    guess = np.zeros((4, 9))
    batch = Batch.from_delassus(A, b, counts=counts, mu=0.7)
    if form == "flat":
        blocks = [np.ascontiguousarray(A[env, :n, :n]) for env, n in enumerate(counts)]
        batch = Batch.from_delassus(blocks, [b[env, :n] for env, n in enumerate(counts)], mu=0.7)
        A, b, guess = batch.A, batch.b, np.zeros(len(batch.b))
    solver = Solver(solver="npgs", tolerance=1e-8)
    out = solver.solve(batch, warm_start=guess)

    def expect_as_by_a_fresh_one():
        for _ in range(3):
            assert solver.solve(batch, out=out, warm_start=guess) is out
        fresh = Solver(solver="npgs", tolerance=1e-8).solve(batch, warm_start=guess)
        assert out.hash() == fresh.hash()
        np.testing.assert_array_equal(out.status, fresh.status)

    expect_as_by_a_fresh_one()
    b *= -0.5
    expect_as_by_a_fresh_one()
    A *= 2
    expect_as_by_a_fresh_one()
    guess[...] = out.lambda_
    expect_as_by_a_fresh_one()
    assert out.iterations.max() == 0
    if form == "padded":
        counts[:] = 3
        expect_as_by_a_fresh_one()
        assert (out.lambda_[:, :3] != 0).any()
    stats = solver.stats()
    calls = 16 if form == "padded" else 13
    assert stats["solves"] == stats["warm_started"] == calls and stats["environments"] == 4 * calls
    assert sum(stats["codes"].values()) == 4 * calls
    other = Batch.from_delassus(padded.A, padded.b, counts=padded.counts, mu=0.2)
    assert solver.solve(other).hash() == Solver(solver="npgs", tolerance=1e-8).solve(other).hash()


def test_a_solution_is_a_warm_start(padded):
    batch = Batch.from_delassus(padded.A, padded.b, counts=padded.counts, mu=0.7)
    solver = Solver(solver="npgs", tolerance=1e-8)
    cold = solver.solve(batch)
    warm = solver.solve(batch, warm_start=cold)
    assert cold.iterations.max() > 0 and warm.iterations.max() == 0
    assert solver.stats()["warm_started"] == 1


def test_velocities_are_a_warm_start_of_j_and_m():
    rng = np.random.default_rng(3)
    J, M = rng.standard_normal((4, 9, 7)), np.tile(np.diag(np.linspace(1, 2, 7)), (4, 1, 1))
    batch = Batch.from_jacobian(J, M, rng.standard_normal((4, 7)), mu=0.6, R=np.full((4, 9), 0.01))
    solver = Solver(tolerance=1e-8)
    cold = Solver(tolerance=1e-11).solve(batch)
    assert cold.iterations.min() > 0 and cold.solved.all()
    for given in (dict(warm_velocities=cold.velocities), dict(warm_start=cold)):
        warm = solver.solve(batch, **given)
        assert warm.iterations.max() == 0 and warm.solved.all(), given
    # Given again and again, the answer's own array: the cached call reads its contents.
    answer = solver.solve(batch, warm_velocities=cold.velocities)
    for _ in range(2):
        answer.velocities[:] = 0.0
        solver.solve(batch, out=answer, warm_velocities=answer.velocities)
        assert answer.iterations.min() > 1
    solver.solve(batch, out=answer, warm_velocities=answer.velocities)
    assert answer.iterations.max() <= 1
    assert solver.stats()["warm_started"] == 6


def test_the_judge_agrees_with_the_record(padded):
    batch = Batch.from_delassus(padded.A, padded.b, counts=padded.counts, mu=0.7, law="coulomb")
    solution = Solver(tolerance=1e-3).solve(batch)
    judged = stiction.verify(batch, solution)
    np.testing.assert_allclose(judged[:, 0], solution.residual, rtol=1e-6)
    assert (stiction.verify(batch, solution.lambda_ + 1)[:3, 0] > 1e-2).all()


def test_a_poisoned_environment_spoils_no_other(padded):
    clean = Solver().solve(Batch.from_delassus(padded.A, padded.b, counts=padded.counts, mu=0.7))
    padded.A[1, 0, 0] = np.nan
    batch = Batch.from_delassus(padded.A, padded.b, counts=padded.counts, mu=0.7)
    solution = Solver().solve(batch)
    assert stiction.CODES[solution.status["code"][1]] == "invalid_input"
    assert (solution[1].lambda_ == 0).all()
    for env in (0, 2, 3):
        np.testing.assert_array_equal(solution[env].lambda_, clean[env].lambda_)


def test_threads_may_share_a_solver(padded):
    batches = [Batch.from_delassus(padded.A.copy(), padded.b * scale, counts=padded.counts, mu=0.7) for scale in (1, 2)]
    solver = Solver(solver="npgs")
    want = [solver.solve(batch).hash() for batch in batches]
    got = [[], []]

    def work(which):
        got[which].extend(solver.solve(batches[which]).hash() for _ in range(50))

    threads = [threading.Thread(target=work, args=(which,)) for which in (0, 1)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert [set(hashes) for hashes in got] == [{want[0]}, {want[1]}]


def test_presets_choose_what_was_not_said():
    solver = Solver(preset="locomotion")
    assert solver.tolerance == 1e-3 and solver.solver == "auto"
    assert Solver(preset="locomotion", tolerance=1e-5).tolerance == 1e-5


def test_options_reach_the_solver(padded):
    batch = Batch.from_delassus(padded.A, padded.b, counts=padded.counts, mu=0.7)
    solution = Solver(solver="pgs", tolerance=0, max_iterations=7).solve(batch)
    assert solution.iterations.max() == 7
    assert {stiction.SOLVERS[i] for i in solution.status["solver"]} == {"pgs"}
    convex, coulomb = (Solver(law=law, tolerance=1e-9).solve(batch).hash() for law in ("convex", "coulomb"))
    assert convex != coulomb


def test_devices_say_why_not():
    found = {report["device"]: report for report in stiction.devices()}
    assert found["cpu"]["usable"] and found["emulated"]["usable"]
    assert all(report["usable"] or report["reason"] for report in found.values())


def test_the_status_tells_how_many_islands_were_solved_apart():
    """Six rows in an environment: of which no two, two and two, or all are coupled."""
    couplings = [[], [(0, 4), (1, 2)], [(row, row + 1) for row in range(5)]]
    indptr, indices = [0], []
    for pairs in couplings:
        for row in range(6):
            indices += sorted({row} | {b for a, b in pairs if a == row} | {a for a, b in pairs if b == row})
            indptr.append(len(indices))
    rows = np.repeat(np.arange(18), np.diff(indptr)) % 6
    A = np.where(rows == np.array(indices), 2.0, 0.5)
    batch = stiction.Batch.from_delassus(A, -np.ones(18), offsets=np.arange(4) * 6, indptr=np.array(indptr),
                                         indices=np.array(indices, np.int32), cones="unilateral")
    assert Solver(islands="apart").solve(batch).status["islands"].tolist() == [6, 4, 0]
    assert Solver().solve(batch).status["islands"].tolist() == [0, 0, 0]


def test_a_large_environment_is_factorised_where_that_is_asked_for():
    rows = 1100
    batch = stiction.Batch.from_delassus(np.eye(rows)[None], np.ones((1, rows)), cones="unilateral")
    refused = stiction.Solver(solver="lemke").solve(batch)
    assert stiction.CODES[refused.status["code"][0]] == "unsupported"
    taken = stiction.Solver(solver="lemke", direct_rows=rows).solve(batch)
    assert taken.solved.all() and (taken.lambda_ == 0).all()
    with pytest.raises(stiction.Error, match="direct_rows = 7: must be from 1024 to 32768"):
        stiction.Solver(solver="lemke", direct_rows=7)


def test_solvers_are_chosen_by_the_spectrum():
    rows = 6
    operators = np.stack([np.eye(rows), np.diag(np.logspace(0, 4, rows)), np.ones((rows, rows)) + 0.01 * np.eye(rows)])
    batch = stiction.Batch.from_delassus(operators, -np.ones((3, rows)), cones="unilateral")
    rules = {"direct": "lemke", "preconditioned": "apgd", "otherwise": "ipm", "steps": 8.0}
    solution = stiction.Solver(choose="spectrum", spectrum=rules, tolerance=1e-8).solve(batch)
    assert solution.solved.all()
    assert [stiction.SOLVERS[number] for number in solution.status["solver"]] == ["lemke", "ipm", "apgd"]
    assert repr(stiction.Solver(choose="spectrum")).startswith("<stiction.Solver auto")
    for wrong, message in (({"choose": "best"}, "named, spectrum"), ({"choose": "spectrum", "solver": "pgs"}, "solver: "),
                           ({"spectrum": {"condition": 3}}, "direct_condition"), ({"spectrum": {"steps": 1}}, "steps = 1"),
                           ({"spectrum": {"direct": "fast"}}, "fast")):
        with pytest.raises((ValueError, stiction.Error), match=message):
            stiction.Solver(**wrong)
    bodies = stiction.Batch.from_bodies(np.ones((1, 1)), np.ones((1, 1, 6)), np.zeros((1, 1, 6)), **{
        side: np.full((1, 1), number, np.int32) for side, number in (("body_a", -1), ("body_b", 0))},
        arm_a=np.zeros((1, 1, 3)), arm_b=np.zeros((1, 1, 3)), normal=np.array([[[0.0, 0, 1]]]), mu=np.ones((1, 1)),
        depth=np.zeros((1, 1)))
    with pytest.raises(ValueError, match="choose: expected 'named' for bodies"):
        stiction.Solver(choose="spectrum").solve(bodies)
    with pytest.raises(stiction.Error, match="it reads numbers of A, and bodies have none; choose pairs"):
        stiction.Solver(solver="npgs", blocks="strong").solve(bodies)
    assert stiction.Solver(solver="npgs", blocks="pairs").solve(bodies).solved.all()
    with pytest.raises(stiction.Error, match="asynchronous = true with law = coulomb"):
        stiction.Solver(solver="npgs", law="coulomb", asynchronous=True).solve(bodies)
