"""The choice of solver that learns: against numbers known beforehand, the kill switch, files, mistakes."""

import json

import numpy as np
import pytest

import stiction
from stiction.learning import FEATURES, TunedSolver, Tuner, features

#: Logarithms of the costs of three choices in a context (1, s): the second is best below s = 0, the third above.
LINES = np.array([[0.0, 0.0], [-0.5, 1.0], [-0.5, -1.0]])


def contexts(count, seed=0):
    rng = np.random.default_rng(seed)
    return np.column_stack([np.ones(count), rng.uniform(-1, 1, count)])


def taught(tuner, count=400, noise=0.05, lines=LINES, seed=0):
    rng = np.random.default_rng(seed + 1)
    for x in contexts(count, seed):
        choice = tuner.choose(x)
        tuner.learn(x, choice, float(np.exp(lines[choice] @ x + noise * rng.normal())))
    return tuner


def batch(count=20, law="convex", dtype="float64"):
    one = np.eye(3) * 2
    return stiction.Batch.from_delassus(np.tile(one, (count, 1, 1)).astype(dtype),
                                        np.tile([-1.0, 0.5, 0.2], (count, 1)).astype(dtype),
                                        mu=np.full((count, 3), 0.5, dtype), law=law)


def test_it_finds_the_choice_that_costs_least_in_each_context():
    tuner = taught(Tuner(["a", "b", "c"]))
    assert tuner.stopped is None
    tuner.freeze()
    for x in contexts(200, seed=9):
        if abs(x[1]) > 0.1:
            assert tuner.choose(x) == np.argmin(LINES @ x)


def test_its_models_are_ridge_regressions_of_what_it_was_told():
    tuner = Tuner(["a", "b"])
    told = contexts(60), np.exp(np.random.default_rng(4).normal(size=60))
    for x, cost in zip(*told):
        tuner.learn(x, 1, cost)
    x = np.vstack([told[0], np.eye(2)])  # a ridge of one is two more rows, of zero
    weights, *_ = np.linalg.lstsq(x, np.append(-np.log(told[1]), [0, 0]), rcond=None)
    probe = np.array([1.0, 0.3])
    assert tuner._models[1].reward(probe) == pytest.approx(weights @ probe, rel=1e-12)
    assert tuner._models[1].doubt(probe) == pytest.approx(np.sqrt(probe @ np.linalg.inv(x.T @ x) @ probe), rel=1e-12)


def test_what_is_unknown_is_tried_and_less_so_without_exploration():
    tried = {tuner.exploration: {tuner.choose(x) for x in contexts(20) if not tuner.learn(x, tuner.choose(x), 0.5)}
             for tuner in (Tuner(list(range(6)), exploration=2.0), Tuner(list(range(6)), exploration=0.0))}
    assert tried[2.0] == set(range(6))
    assert len(tried[0.0]) < 6


def test_the_kill_switch_stops_a_tuner_that_costs_more_than_the_default():
    # Costs of the others change for the worse after they were learned.
    tuner = taught(Tuner(["a", "b", "c"], patience=50, control=5))
    assert tuner.stopped is None
    worse = LINES + np.array([[0, 0], [3.0, 0], [3.0, 0]])
    taught(tuner, 200, lines=worse, seed=5)
    assert "times what the default" in tuner.stopped
    assert {tuner.choose(x) for x in contexts(50)} == {0}
    before = tuner.decisions
    tuner.learn(contexts(1)[0], 1, 2.0)
    assert tuner.decisions == before, "a stopped tuner learns nothing"


def test_it_stops_by_hand_and_by_the_environment(monkeypatch):
    tuner = taught(Tuner(["a", "b", "c"]), 50)
    tuner.stop()
    assert tuner.stopped == "by hand" and tuner.choose([1.0, -0.9]) == 0
    monkeypatch.setenv("STICTION_TUNER", "off")
    assert Tuner(["a", "b"]).stopped == "STICTION_TUNER=off"


def test_a_saved_tuner_is_frozen_and_chooses_alike(tmp_path):
    tuner = taught(Tuner([{"solver": "auto"}, {"solver": "npgs"}, {"solver": "newton"}]))
    tuner.save(tmp_path / "tuner.json")
    loaded = Tuner.load(tmp_path / "tuner.json")
    assert loaded.frozen and loaded.choices == tuner.choices and loaded.decisions == tuner.decisions
    tuner.freeze()
    assert [loaded.choose(x) for x in contexts(100, 3)] == [tuner.choose(x) for x in contexts(100, 3)]
    assert len(list(tmp_path.iterdir())) == 1
    for text in ("", "[]", '{"format": "other", "version": 1}', json.dumps({"format": "stiction-tuner", "version": 1})):
        (tmp_path / "other.json").write_text(text)
        with pytest.raises(ValueError, match="expected a file of Tuner.save"):
            Tuner.load(tmp_path / "other.json")


def test_the_log_has_a_line_for_each_decision(tmp_path):
    tuner = taught(Tuner(["a", "b", "c"], log=tmp_path / "log.jsonl"), 30)
    lines = [json.loads(line) for line in (tmp_path / "log.jsonl").read_text().splitlines()]
    assert [line["decision"] for line in lines] == list(range(1, 31))
    assert lines[-1]["regret"] == tuner.regret > 0
    costs = np.log([line["cost"] for line in lines]) - [min(line["predicted"]) for line in lines]
    grown = np.diff([0.0, *(line["regret"] for line in lines)])
    begun = np.flatnonzero(grown)[0]  # once every choice is known a little
    np.testing.assert_allclose(grown[begun:], np.maximum(costs[begun:], 0), atol=1e-12)
    assert all(len(line["predicted"]) == 3 and len(line["context"]) == 2 for line in lines)


def test_a_tuned_solver_answers_as_the_solver_it_chose():
    choices = [{"solver": "npgs"}, {"solver": "jacobi", "max_iterations": 2}, {"solver": "newton"}]
    solver = TunedSolver(Tuner(choices, control=0, exploration=5.0), tolerance=1e-8)
    problem, seen = batch(), set()
    for _ in range(40):
        solution = solver.solve(problem)
        seen.add(solver.choice)
        alone = stiction.Solver(**{"tolerance": 1e-8} | choices[solver.choice]).solve(problem)
        assert solution.hash() == alone.hash()
    assert seen == {0, 1, 2}
    assert solver.tuner.decisions == 40
    frozen = TunedSolver(solver.tuner.freeze(), tolerance=1e-8)
    assert len({frozen.solve(problem).hash() for _ in range(3)}) == 1
    assert solver.tuner.decisions == 40


def test_a_solver_that_misses_the_tolerance_loses_to_one_that_reaches_it():
    # One sweep is quick; ten times its seconds are not.
    rng = np.random.default_rng(0)
    roots = rng.normal(size=(50, 60, 60))
    problem = stiction.Batch.from_delassus(roots @ roots.transpose(0, 2, 1) / 60 + 0.1 * np.eye(60),
                                           rng.normal(size=(50, 60)), mu=np.full((50, 60), 0.5))
    clock = iter(range(1, 10**6))  # every solve takes a second
    tuner = Tuner([{"solver": "newton"}, {"solver": "pgs", "max_iterations": 1}], control=2)
    solver = TunedSolver(tuner, tolerance=1e-6)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("stiction.learning.tuner.time.perf_counter", lambda: float(next(clock)))
        for _ in range(30):
            solver.solve(problem)
    assert tuner.freeze().choose(features(problem, 1e-6)) == 0
    assert tuner._models[1].count < 5


def test_features_are_of_extents_law_and_precision():
    assert len(features(batch(), 1e-4)) == len(FEATURES)
    x = features(batch(32), 1e-4)
    assert x[0] == 1 and x[1] == 2 and x[2] == 5 and x[6] == 4
    assert features(batch(32, law="coulomb"), 1e-4)[4] == 1
    assert features(batch(32, dtype="float32"), 1e-4)[5] == 0
    assert np.isfinite(features(batch(0), 0)).all()


@pytest.mark.parametrize(("call", "words"), [
    (lambda: Tuner([]), "choices: expected at least one"),
    (lambda: Tuner([object()]), r"choices\[0\]: expected something that JSON"),
    (lambda: Tuner(["a"], exploration=-1), "exploration"),
    (lambda: Tuner(["a"], margin=float("nan")), "margin"),
    (lambda: Tuner(["a"]).choose([1.0, float("nan")]), "context"),
    (lambda: Tuner(["a"]).choose([]), "context"),
    (lambda: Tuner(["a"]).learn([1.0], 1, 1.0), "choice: expected 0 to 0"),
    (lambda: Tuner(["a"]).learn([1.0], 0, 0.0), "cost"),
    (lambda: Tuner(["a"]).learn([1.0], 0, float("inf")), "cost"),
    (lambda: (tuner := Tuner(["a"])).learn([1.0], 0, 1.0) or tuner.choose([1.0, 2.0]), "expected 1 numbers as before"),
    (lambda: TunedSolver("tuner"), "tuner: expected a stiction.learning.Tuner"),
    (lambda: TunedSolver(Tuner(["npgs"])), r"choices\[0\]: expected a dict"),
    (lambda: TunedSolver(Tuner([{"solver": "none"}])), "solver"),
])
def test_mistakes_are_named(call, words):
    with pytest.raises((ValueError, TypeError), match=words):
        call()
