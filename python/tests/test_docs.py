"""The README, docs/reference/python.md and the table of mistakes show real output."""

import re
import runpy

import pytest
from conftest import ROOT

import stiction

PAGE = (ROOT / "docs" / "reference" / "python.md").read_text(encoding="utf-8")
MISTAKES = (ROOT / "examples" / "python" / "MISTAKES.md").read_text(encoding="utf-8")


def test_the_quickstart_runs():
    block = re.search(r"```python\n(.*?)```", PAGE, re.DOTALL).group(1)
    names = {}
    exec(compile(block, "docs/reference/python.md", "exec"), names)
    assert names["solution"].solved.all()
    assert abs(names["solution"].lambda_[1, 1] + 0.5 * 9.81) < 1e-3


def test_the_worlds_of_the_page_about_stepping_run():
    page = (ROOT / "docs" / "howto" / "stepping.md").read_text(encoding="utf-8")
    names = {}
    exec(compile(re.search(r"```python\n(.*?)```", page, re.DOTALL).group(1), "docs/howto/stepping.md", "exec"), names)
    assert names["gradients"].valid.all() and names["gradients"].wrench.any()


def test_the_six_lines_of_the_readme_step_ants():
    pytest.importorskip("gymnasium", reason="README's first lines are NOT tested: pip install gymnasium mujoco")
    pytest.importorskip("mujoco", reason="README's first lines are NOT tested: pip install gymnasium mujoco")
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    block = re.search(r"```python\n(.*?)```", readme, re.DOTALL).group(1)
    assert len(block.splitlines()) == 6
    assert len(readme.split()) <= 700
    names = {}
    exec(compile(block.replace("1024", "16"), "README.md", "exec"), names)
    simulation = names["ants"].simulation
    assert len(simulation.data) == 16
    assert all(0 < data.qpos[2] < 2 for data in simulation.data)  # [m]: neither through the floor nor away
    assert simulation.solved.all()


def test_the_table_of_mistakes_is_what_is_said():
    said = runpy.run_path(str(ROOT / "examples" / "python" / "05_mistakes.py"))["rows"]()
    rows = {f"| {mistake} | {kind} | `{message}` |" for mistake, kind, message in said}
    shown = set(re.findall(r"^\| .+ \| .+ \| `.+` \|$", MISTAKES, re.MULTILINE))
    assert len(shown) >= 30
    assert not rows - shown, "said, but not in MISTAKES.md: paste what examples/python/05_mistakes.py prints"
    silent = shown - rows
    assert all("gradient asked of" in row for row in silent), silent  # of PyTorch, which may be missing


def test_a_gpu_that_is_not_there_is_refused_as_shown():
    reports = [report for report in stiction.devices() if report["device"].startswith("cuda")]
    if any(report["usable"] for report in reports) or "no CUDA machine" not in str(reports):
        pytest.skip("there is a GPU, or a build that could use one")
    with pytest.raises(stiction.Error) as caught:
        stiction.Solver(device="cuda")
    begins = str(caught.value)[:len("device 'cuda' is not usable: this build has no CUDA machine")]
    assert f"`{begins}`" in MISTAKES
