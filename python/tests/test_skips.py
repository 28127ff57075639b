"""A test that needs a framework is skipped, names the command that installs it, and is counted."""

import re
import shutil
import subprocess
import sys

from conftest import ROOT

FOLDER = ROOT / "python" / "tests"
MODULE = """
import pytest
from frameworks import framework

framework("no_such_framework", "this module is")
pytestmark = pytest.mark.warp


def test_one():
    pass


class TestMore:
    @pytest.mark.quick
    @pytest.mark.parametrize("number", [1, 2])
    def test_another(self, number):
        pass
"""


def test_a_module_that_lacks_a_framework_is_all_its_tests_skipped(tmp_path):
    for name in ("conftest.py", "frameworks.py"):
        shutil.copy(FOLDER / name, tmp_path / name)
    (tmp_path / "test_module.py").write_text(MODULE, encoding="utf-8")

    def said(*options):
        return subprocess.run([sys.executable, "-m", "pytest", "-q", "-rs", "-p", "no:cacheprovider", *options, tmp_path],
                              capture_output=True, text=True, timeout=120).stdout

    assert "\n2 skipped in " in said()
    quick = said("-m", "quick or not warp")
    assert "\n1 skipped, 1 deselected in " in quick
    assert "this module is NOT tested, there is no no_such_framework: scripts/test.sh --frameworks\n" in quick


def test_frameworks_are_asked_for_by_the_function_that_names_the_command():
    listed = (ROOT / "tools" / "requirements-frameworks.txt").read_text(encoding="utf-8")
    packages = {name.replace("-", "_") for name in re.findall(r"^([a-z][\w-]*)", listed, re.M)}
    modules = packages | {"warp", "mujoco.mjx", "rsl_rl", "tensordict", "msgspec", "zstandard"}
    assert {"torch", "jax", "newton"} <= modules
    for file in FOLDER.glob("*.py"):
        asked = set(re.findall(r'importorskip\(\s*"([\w.]+)"', file.read_text(encoding="utf-8")))
        assert not asked & modules, f"{file.name}: ask for {asked & modules} by frameworks.framework"
