"""The tutorials, block after block: the text below a block is the block's output."""

import contextlib
import io
import re
import runpy

import numpy as np
import pytest
from conftest import ROOT
from frameworks import framework

FEWER = {"COUNT, STEPS, ROUNDS = 64, 100, 20": "COUNT, STEPS, ROUNDS = 32, 50, 10"}


def run(page, least=5):
    text = (ROOT / "docs" / "tutorials" / page).read_text(encoding="utf-8")
    for shown, shorter in FEWER.items():
        text = text.replace(shown, shorter)
    names = {}
    blocks = list(re.finditer(r"```python\n(.*?)```(?:\s*```text\n(.*?)```)?", text, re.DOTALL))
    assert len(blocks) >= least
    for block in blocks:
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed):
            exec(compile(block.group(1), f"docs/tutorials/{page}", "exec"), names)
        assert printed.getvalue() == (block.group(2) or ""), block.group(1)
    return names


def test_the_first_solve():
    names = run("first_solve.md")
    assert names["solution"].solved.all()


def test_my_engine_has_j_and_m():
    names = run("jacobian_and_mass.md")
    assert names["solution"].solved.all()


def test_differentiate_a_slide():
    names = run("differentiate_a_slide.md")
    assert abs(names["mass"] - 0.7) < 0.01 and abs(names["mu"] - 0.35) < 0.001


def test_ants_in_ten_minutes():
    pytest.importorskip("gymnasium", reason="the tutorial of ants is NOT tested: pip install gymnasium mujoco")
    pytest.importorskip("mujoco", reason="the tutorial of ants is NOT tested: pip install gymnasium mujoco")
    names = run("ants_in_ten_minutes.md", least=4)
    assert len(names["curve"]) == 10


def test_a_robot_of_ones_own(monkeypatch):
    mujoco = pytest.importorskip("mujoco", reason="the tutorial of a robot is NOT tested: pip install mujoco")
    monkeypatch.chdir(ROOT)
    names = run("a_robot_of_ones_own.md", least=2)
    assert names["robots"].solved.all()
    framework("stable_baselines3", "the model of the example beside the tutorial is")
    example = runpy.run_path(str(ROOT / "examples" / "python" / "14_quadruped.py"))["rough_model"]()
    saved = [np.empty(mujoco.mj_sizeModel(model), np.uint8) for model in (names["model"], example)]
    for model, buffer in zip((names["model"], example), saved):
        mujoco.mj_saveModel(model, None, buffer)
    assert np.array_equal(*saved)
