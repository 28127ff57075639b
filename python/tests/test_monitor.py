"""Reports of a solver about its work."""

import csv
import json
import subprocess

import numpy as np
import pytest

import stiction
from stiction import Batch, Solver


def test_totals_and_quantiles(padded):
    solver = Solver(solver="npgs", tolerance=0, max_iterations=9)
    batch = Batch.from_delassus(padded.A, padded.b, counts=padded.counts, mu=0.7)
    for _ in range(3):
        last = solver.solve(batch)
    stats = solver.stats()
    assert stats["solves"] == 3 and stats["environments"] == 12 and stats["seconds"] > 0
    assert sum(stats["codes"].values()) == 12 and stats["solvers"] == {"npgs": 12}
    assert stats["iterations"]["max"] == last.iterations.max()
    assert stats["residual"]["max"] == last.residual.max()


def test_quantiles_are_of_the_last_environments(monkeypatch):
    monkeypatch.setattr(stiction.core.statistics, "WINDOW", 5)
    statistics = stiction.core.statistics.Statistics(None)
    kept = []
    # Asked for after every solve, after several, and after one that is longer than the window.
    for sizes in ((3,), (3,), (1, 1), (2, 2, 2), (9,), (1,)):
        for size in sizes:
            records = np.zeros(size, stiction.STATUS_DTYPE)
            records["iterations"] = len(kept) + np.arange(size)
            kept += records["iterations"].tolist()
            statistics.keep(size, 0.0, False, records)
        last = np.array(kept[-5:])
        stats = statistics.stats()
        assert stats["environments"] == sum(stats["codes"].values()) == len(kept)
        assert stats["iterations"] == {"p50": np.quantile(last, 0.5, method="higher"), "p90": last[-1], "p99": last[-1], "max": last[-1]}


def test_flags_are_counted_by_name(padded):
    padded.b[1, 0] = np.inf
    solver = Solver()
    solver.solve(Batch.from_delassus(padded.A, padded.b, counts=padded.counts, mu=-1.0))
    assert solver.stats()["flags"] == {"non_finite_input": 1, "negative_friction": 3}
    assert solver.stats()["codes"]["invalid_input"] == 3


def test_dropped_contacts_are_counted(padded):
    """Four contacts are asked for where there is room for three."""
    solver = Solver()
    padded.A[0], padded.b[0] = padded.A[2], padded.b[2]
    solver.solve(Batch.from_delassus(padded.A, padded.b, cone_counts=np.array([4, 1, 3, 0], np.int32), mu=0.7))
    assert solver.stats()["flags"] == {"contacts_dropped": 1}


def test_loggers_write_a_line_for_every_solve(padded, tmp_path):
    batch = Batch.from_delassus(padded.A, padded.b, counts=padded.counts, mu=0.7)
    seen = []
    for callback in (stiction.monitor.CsvLogger(tmp_path / "log.csv"), stiction.monitor.JsonLogger(tmp_path / "log.json"),
                     seen.append):
        solver = Solver(callback=callback)
        solver.solve(batch)
        padded.b[0, 0] = np.nan
        solver.solve(batch)
        padded.b[0, 0] = -1.0
    rows = list(csv.DictReader(open(tmp_path / "log.csv", encoding="utf-8")))
    lines = [json.loads(line) for line in open(tmp_path / "log.json", encoding="utf-8")]
    for log in (rows, lines, seen):
        assert [float(entry["solved"]) for entry in log] == [1.0, 0.75]
        assert int(log[0]["environments"]) == 4
    assert lines[1]["residual_max"] is None and np.isinf(seen[1]["residual_max"])


@pytest.mark.parametrize("form", ["delassus", "jacobian"])
def test_failures_are_written_for_replay(padded, cli, tmp_path, form):
    if form == "delassus":
        batch = Batch.from_delassus(padded.A, padded.b, counts=padded.counts, mu=0.7, law="coulomb")
    else:
        rng = np.random.default_rng(2)
        J, mass, v_free = rng.normal(size=(4, 9, 12)), np.ones((4, 12)), rng.normal(size=(4, 12)) - 1
        batch = Batch.from_jacobian(J, mass, v_free, counts=padded.counts, mu=0.7, law="coulomb")
    solver = Solver(solver="npgs", tolerance=1e-12, max_iterations=4, record_failures=tmp_path / "failures")
    solution = solver.solve(batch, warm_start=np.full((4, 9), 0.1))
    failed = int((~solution.solved).sum())
    assert failed > 0 and solver.stats()["recorded"] == failed
    (file,) = (tmp_path / "failures").glob("*.h5")
    replayed = subprocess.run([cli, "replay", file], capture_output=True, text=True, check=False)
    assert replayed.returncode == 0, replayed.stdout + replayed.stderr
    assert len(Batch.from_file(file)) == failed


def test_nothing_is_written_where_nothing_failed(padded, tmp_path):
    solver = Solver(record_failures=tmp_path / "failures")
    solver.solve(Batch.from_delassus(padded.A, padded.b, counts=padded.counts, mu=0.7))
    assert not (tmp_path / "failures").exists()


@pytest.mark.parametrize("where", ["taken/failures", "taken"])
def test_a_folder_that_cannot_be_written_to_is_refused_at_once(tmp_path, where):
    (tmp_path / "taken").write_text("a file")
    with pytest.raises(ValueError, match="record_failures: expected a folder that can be written to, got .*taken"):
        Solver(record_failures=tmp_path / where)
    assert [path.name for path in tmp_path.iterdir()] == ["taken"]


def test_a_folder_that_is_writable_stays_as_it_is_until_something_fails(tmp_path):
    Solver(record_failures=tmp_path)
    Solver(record_failures=tmp_path / "a" / "b")
    assert not list(tmp_path.iterdir())


def test_a_callback_that_fails_is_heard(padded):
    def fail(stats):
        raise KeyError("logger")

    with pytest.raises(KeyError):
        Solver(callback=fail).solve(Batch.from_delassus(padded.A, padded.b, counts=padded.counts, mu=0.7))


@pytest.mark.parametrize("device", ["cpu", "emulated"])
def test_a_trace_says_where_the_time_went(padded, tmp_path, device):
    batch = Batch.from_delassus(padded.A, padded.b, counts=padded.counts, mu=0.7)
    solver = Solver(device=device, solver="npgs", trace=True)
    hashes = {solver.solve(batch).hash(), Solver(solver="npgs").solve(batch).hash()}
    spans = solver.stats()["spans"]
    assert len(hashes) == 1
    assert spans["host/solve" if device == "cpu" else "host/queue"]["count"] == 1
    assert any(kind.startswith("device/") for kind in spans) == (device == "emulated")
    solver.write_trace(tmp_path / "trace.json")
    assert len(json.loads((tmp_path / "trace.json").read_text())) >= sum(kind["count"] for kind in spans.values())
