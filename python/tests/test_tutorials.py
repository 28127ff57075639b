"""The tutorials, block after block: what a page shows below a block is what the block prints."""

import contextlib
import io
import re

import pytest
from conftest import ROOT

FEWER = {"COUNT, STEPS, ROUNDS = 64, 100, 20": "COUNT, STEPS, ROUNDS = 32, 50, 10"}


def run(page):
    text = (ROOT / "docs" / "tutorials" / page).read_text(encoding="utf-8")
    for shown, shorter in FEWER.items():
        text = text.replace(shown, shorter)
    names = {}
    blocks = list(re.finditer(r"```python\n(.*?)```(?:\s*```text\n(.*?)```)?", text, re.DOTALL))
    assert len(blocks) >= 5
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
    names = run("ants_in_ten_minutes.md")
    assert len(names["curve"]) == 10
