"""Demonstrations of docs/explanation/demonstrations.md happen as they are shown."""

import re
import runpy

import numpy as np
import pytest
from conftest import ROOT

pytest.importorskip("mujoco", reason="the demonstrations are NOT tested: pip install mujoco")


@pytest.fixture(scope="module")
def shown():
    return runpy.run_path(str(ROOT / "examples" / "python" / "10_demonstrations.py"))


def test_the_convex_law_lifts_a_sliding_cube_and_coulombs_does_not(shown):
    found = shown["slide"]()
    _, convex, residual = found["stiction, convex"]
    _, exact, exact_residual = found["stiction, coulomb"]
    assert max(residual, exact_residual) < 1e-9
    # The associated law turns a slip of v into a rise of mu v: at first 3 m/s, slowed by gravity and by its friction.
    assert 0.2 < convex.max() < 0.46
    assert np.abs(exact).max() < 1e-6
    steps = np.arange(1, 501)  # 6 m/s slowed by mu g, in steps that end with their velocity
    np.testing.assert_allclose(found["stiction, coulomb x"], (6 - 0.5 * 9.81 * 0.002 * steps).sum() * 0.002, atol=1e-6)


def test_a_capsule_in_a_grip_creeps_by_regularised_friction_and_sticks_by_coulombs(shown):
    found = shown["grip"](seconds=1.0)
    _, drops, rate, load, residual = found["stiction, coulomb"]
    assert load == pytest.approx(30, abs=1e-6) and residual < 1e-9
    assert abs(rate) < 1e-12 and np.abs(drops).max() < 1e-12
    # 50 to 2300 um/s were reported; the creep is as 1 / impratio.
    slow, fast = found["MuJoCo, impratio 10"][2], found["MuJoCo, impratio 1"][2]
    assert 5e-5 < slow < 5e-4 and 9 < fast / slow < 11
    assert 1e-9 < found["MuJoCo, impratio 10, noslip 10"][2] < 1e-6


def test_environments_may_be_permuted(shown):
    assert shown["permutation"](count=5, steps=100) == (5, 100)


def test_one_nan_harms_nobody(shown):
    assert shown["one_nan"](count=512, bad=77) == ([77], [], True)


def test_the_page_has_what_the_program_prints():
    page = (ROOT / "docs" / "explanation" / "demonstrations.md").read_text(encoding="utf-8")
    lines = re.search(r"```text\n(.*?)```", page, re.DOTALL).group(1).strip().splitlines()
    assert [line.split()[0] for line in lines] == ["slide"] * 3 + ["grip"] * 4 + ["permutation", "nan"]
