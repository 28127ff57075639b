"""What docs/python.md shows is what happens."""

import re
import runpy

import pytest
from conftest import ROOT

import stiction

PAGE = (ROOT / "docs" / "python.md").read_text(encoding="utf-8")


def test_the_quickstart_runs():
    block = re.search(r"```python\n(.*?)```", PAGE, re.DOTALL).group(1)
    names = {}
    exec(compile(block, "docs/python.md", "exec"), names)
    assert names["solution"].solved.all()
    assert abs(names["solution"].lambda_[1, 1] + 0.5 * 9.81) < 1e-3


def test_the_worlds_of_the_page_about_stepping_run():
    page = (ROOT / "docs" / "stepping.md").read_text(encoding="utf-8")
    names = {}
    exec(compile(re.search(r"```python\n(.*?)```", page, re.DOTALL).group(1), "docs/stepping.md", "exec"), names)
    assert names["gradients"].valid.all() and names["gradients"].wrench.any()


ROBOT = """
<mujoco>
  <worldbody>
    <geom type="plane" size="5 5 1"/>
    <body pos="0 0 0.2"><freejoint/><geom type="sphere" size=".1"/>
      <body pos="0 0 0.2"><joint name="hip" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 .3 0 0" size=".04"/></body>
    </body>
  </worldbody>
  <actuator><motor joint="hip"/></actuator>
</mujoco>
"""


def test_the_first_lines_of_the_readme_step_a_robot(tmp_path, monkeypatch):
    pytest.importorskip("mujoco", reason="README's first lines are NOT tested: pip install mujoco")
    (tmp_path / "robot.xml").write_text(ROBOT, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    block = re.search(r"```python\n(.*?)```", readme, re.DOTALL).group(1)
    names = {}
    exec(compile(block.replace("1024", "16"), "README.md", "exec"), names)
    heights = [data.qpos[2] for data in names["robots"].data]
    assert len(heights) == 16 and all(0.05 < height < 0.5 for height in heights)
    assert abs(names["robots"].data[0].time - 100 * names["model"].opt.timestep) < 1e-9


def test_the_table_of_mistakes_is_what_is_said():
    said = runpy.run_path(str(ROOT / "examples" / "python" / "05_mistakes.py"))["rows"]()
    rows = {f"| {mistake} | {kind} | `{message}` |" for mistake, kind, message in said}
    shown = set(re.findall(r"^\| .+ \| .+ \| `.+` \|$", PAGE.partition("## Mistakes")[2], re.MULTILINE))
    assert len(shown) >= 30
    assert not rows - shown, "said, but not in docs/python.md: paste what examples/python/05_mistakes.py prints"
    silent = shown - rows
    assert all("gradient asked of" in row for row in silent), silent  # of PyTorch, which may be missing


def test_a_gpu_that_is_not_there_is_refused_as_shown():
    reports = [report for report in stiction.devices() if report["device"].startswith("cuda")]
    if any(report["usable"] for report in reports) or "no CUDA machine" not in str(reports):
        pytest.skip("there is a GPU, or a build that could use one")
    with pytest.raises(stiction.Error) as caught:
        stiction.Solver(device="cuda")
    begins = str(caught.value)[:len("device 'cuda' is not usable: this build has no CUDA machine")]
    assert f"`{begins}`" in PAGE
