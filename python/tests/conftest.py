"""Shared by the tests: recorded files, the command line to compare with, problems made by NumPy."""

import ast
import os
import pathlib

import numpy as np
import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
DATA = ROOT / "examples" / "data"


def pytest_configure(config):
    config.addinivalue_line("markers", "warp: kernels are compiled by Warp, which takes a minute of a core in all")
    config.addinivalue_line("markers", "quick: of these, what run.py runs")


class SkippedTest(pytest.Item):
    """A test of a module that cannot be imported, for the reason that the module gives."""

    def __init__(self, *, definition, reason, **options):
        super().__init__(**options)
        self.line, self.reason = definition.lineno, reason
        for decorator in map(ast.unparse, definition.decorator_list):
            if decorator in ("pytest.mark.quick", "pytest.mark.warp"):
                self.add_marker(decorator.rpartition(".")[2])

    def runtest(self):
        raise pytest.skip.Exception(self.reason, _use_item_location=True)

    def reportinfo(self):
        return self.path, self.line - 1, self.name


class CountedModule(pytest.Module):
    """A module of tests. One that skips as a whole is all its tests, each skipped, so that each is counted."""

    def collect(self):
        try:
            return list(super().collect())
        except pytest.skip.Exception as lacking:
            tree = ast.parse(self.path.read_text(encoding="utf-8"))
            for node in tree.body:
                if ast.unparse(node) == "pytestmark = pytest.mark.warp":
                    self.add_marker("warp")
            return [SkippedTest.from_parent(self, name=node.name, definition=node, reason=lacking.msg)
                    for node in ast.walk(tree) if isinstance(node, ast.FunctionDef) and node.name.startswith("test_")]


def pytest_pycollect_makemodule(module_path, parent):
    return CountedModule.from_parent(parent, path=module_path)


@pytest.fixture
def data():
    """Folder of the recorded batches."""
    return DATA


@pytest.fixture
def cli():
    """The stiction command line of this build."""
    path = os.environ.get("STICTION_CLI", str(ROOT / "build" / "bin" / "stiction"))
    if not os.access(path, os.X_OK):
        pytest.skip(f"no command line at {path}: set STICTION_CLI to compare with it")
    return path


class Scene:
    """Contacts of one environment with their Jacobian, mass matrix and velocity without contact."""

    def __init__(self, rng, contacts, dofs):
        self.rows, self.dofs = 3 * contacts, dofs
        self.J = rng.normal(size=(self.rows, dofs))
        half = rng.normal(size=(dofs, dofs))
        self.M = half @ half.T + dofs * np.eye(dofs)
        self.v_free = rng.normal(size=dofs) - 1
        self.A = self.J @ np.linalg.solve(self.M, self.J.T)
        self.A = (self.A + self.A.T) / 2
        self.b = self.J @ self.v_free


@pytest.fixture
def scenes():
    """Environments of different sizes, one of them without contacts."""
    rng = np.random.default_rng(7)
    return [Scene(rng, contacts, dofs) for contacts, dofs in ((2, 8), (1, 5), (3, 12), (0, 3))]


class Padded:
    """Returns those scenes in arrays of fixed shape, with NaN wherever nothing may be read."""

    def __init__(self, scenes, room=9):
        count = len(scenes)
        self.A = np.full((count, room, room), np.nan)
        self.b = np.full((count, room), np.nan)
        self.counts = np.array([scene.rows for scene in scenes], np.int32)
        for env, scene in enumerate(scenes):
            self.A[env, :scene.rows, :scene.rows] = scene.A
            self.b[env, :scene.rows] = scene.b


@pytest.fixture
def padded(scenes):
    return Padded(scenes)
