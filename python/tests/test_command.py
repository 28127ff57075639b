"""The command `stiction` of the package: its own commands, and that it hands others to the C++ program."""

import json
import os
import pathlib
import subprocess
import sys

import pytest
from conftest import DATA

from stiction import __main__ as command


def run(*arguments, path=""):
    """Returns the output of `python -m stiction` with that path; the interpreter is not looked for there."""
    return subprocess.run([sys.executable, "-m", "stiction", *map(str, arguments)], capture_output=True, text=True,
                          env={**os.environ, "PATH": path})


@pytest.fixture
def report(tmp_path):
    values = {"schema_version": 2, "environments": 2, "unconverged": 1, "seconds": {"solve": 0.5}, "iterations": None,
              "residual": {"min": 0, "median": 1e-9, "p90": 1e-8, "max": 1e-7}}
    (tmp_path / "run.json").write_text(json.dumps(values), encoding="utf-8")
    return tmp_path / "run.json"


def test_a_report_becomes_a_page(report):
    done = run("report", report)
    assert (done.returncode, done.stdout, done.stderr) == (0, f"report: {report.with_suffix('.html')}\n", "")
    assert "not solved" in report.with_suffix(".html").read_text(encoding="utf-8")


@pytest.mark.parametrize("name", ["view", "report"])
def test_help_names_the_command_as_it_was_called(name):
    assert run(name, "--help").stdout.startswith(f"usage: stiction {name} [-h]")


def test_without_the_compiled_program_other_commands_are_refused(tmp_path):
    (tmp_path / "stiction").write_text("#!/bin/sh\necho a script of that name, as pip makes one\n")
    (tmp_path / "stiction").chmod(0o755)
    done = run("solve", "x.h5", path=str(tmp_path))
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == ("stiction: solve: expected view or report; other commands are the C++ program's, which is not on "
                           "the path\n")
    done = run(path=str(tmp_path))
    assert done.returncode == 0 and done.stdout.startswith("usage: stiction COMMAND ...") and not done.stderr


def test_other_commands_are_the_compiled_programs(cli, tmp_path):
    folder = str(pathlib.Path(cli).parent)
    for arguments in (["--version"], ["inspect", DATA / "pile.h5", "--json"], ["inspect", tmp_path / "none.h5"]):
        ours, theirs = run(*arguments, path=folder), subprocess.run([cli, *map(str, arguments)], capture_output=True, text=True)
        assert (ours.returncode, ours.stdout, ours.stderr) == (theirs.returncode, theirs.stdout, theirs.stderr)
    assert theirs.returncode == 2


def test_the_compiled_program_runs_the_packages_commands(cli, report, tmp_path):
    """By the python3 on the path: here one that runs this interpreter."""
    (tmp_path / "python3").write_text(f'#!/bin/sh\nexec {sys.executable} "$@"\n')
    (tmp_path / "python3").chmod(0o755)

    def hand_over(*arguments, **environment):
        return subprocess.run([cli, *map(str, arguments)], capture_output=True, text=True, env={**os.environ, **environment})

    done = hand_over("report", report, "-o", tmp_path / "of it.html", PATH=f"{tmp_path}:/bin:/usr/bin")
    assert (done.returncode, done.stdout, done.stderr) == (0, f"report: {tmp_path / 'of it.html'}\n", "")
    assert (tmp_path / "of it.html").is_file()
    done = hand_over("report", tmp_path / "none.json", PATH=f"{tmp_path}:/bin:/usr/bin")
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
    done = hand_over("view", "x.h5", PATH="")
    assert (done.returncode, done.stderr) == (2, "stiction: view, report and step of a model need python3, which is not on the path\n")
    model = tmp_path / "robot.xml"
    model.write_text("<mujoco><worldbody><body><freejoint/><geom size='1'/></body></worldbody></mujoco>", encoding="utf-8")
    done = hand_over("step", "--envs", 3, model, "--steps", 2, PATH=f"{tmp_path}:/bin:/usr/bin")
    assert done.returncode == 0 and done.stdout.startswith("robot.xml: 3 simulations, 2 steps, float64\n")
    assert hand_over("step", model, "--help", PATH=f"{tmp_path}:/bin:/usr/bin").stdout.startswith("usage: stiction step [-h]")
    done = hand_over("step", tmp_path / "none.xml", PATH=f"{tmp_path}:/bin:/usr/bin")
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1) and done.stderr.startswith("stiction: ")
    (tmp_path / "python3").write_text(f'#!/bin/sh\nexec {sys.executable} -I -S "$@"\n')  # without any package
    done = hand_over("view", "x.h5", PATH=f"{tmp_path}:/bin:/usr/bin")
    assert (done.returncode, done.stdout) == (2, "") and "need the Python package" in done.stderr


def test_a_program_that_may_not_be_run_is_passed_over(tmp_path, monkeypatch):
    for name, mode in (("closed", 0o644), ("open", 0o755)):
        (tmp_path / name).mkdir()
        (tmp_path / name / "stiction").write_bytes(b"\x7fELF and so on")
        (tmp_path / name / "stiction").chmod(mode)
    monkeypatch.setenv("PATH", os.pathsep.join(str(tmp_path / name) for name in ("none", "closed", "open")))
    assert command._compiled() == str(tmp_path / "open" / "stiction")
