#!/usr/bin/env python3
"""The package as it was installed from a wheel, beside NumPy and nothing else. scripts/wheel.sh builds, installs and runs.

    wheel.py WHEEL.whl SOURCE

The last line is: N passed, M failed, K skipped
"""

import importlib.metadata
import json
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest
import zipfile

WHEEL, SOURCE = (pathlib.Path(name).resolve() for name in sys.argv[1:3])
HASH = """
import numpy as np, stiction
A = np.tile(np.eye(3) + 0.25, (64, 1, 1))
b = np.linspace(-9, 7, 64 * 3).reshape(64, 3)
print(stiction.Solver(device="cpu").solve(stiction.Batch.from_delassus(A, b, mu=0.5, law="coulomb")).hash())
"""
NAMES = """
import os, stiction
os.environ["STICTION_ISA"] = "none"
try:
    stiction.Solver(device="cpu")
except stiction.Error as error:
    print(str(error).split("expected one of ")[1].split(", the kernels of this build")[0])
"""


def run(code, **environment):
    """Returns the output of a separate interpreter, outside of the source tree and with those variables set."""
    return subprocess.run([sys.executable, "-c", code], env=environment, check=True, capture_output=True, text=True,
                          timeout=60).stdout.strip()


class Wheel(unittest.TestCase):
    def test_what_is_imported_is_what_was_installed(self):
        place = pathlib.Path(run("import stiction; print(stiction.__file__)"))
        self.assertIn(pathlib.Path(sys.prefix).resolve(), place.resolve().parents)
        self.assertNotIn(SOURCE / "python", place.resolve().parents)

    def test_the_version_is_that_of_the_source(self):
        version = re.search(r"project\(stiction VERSION ([0-9.]+)", (SOURCE / "CMakeLists.txt").read_text()).group(1)
        self.assertEqual(run("import stiction; print(stiction.__version__)"), version)
        self.assertEqual(importlib.metadata.version("stiction"), version)

    def test_numpy_is_all_it_needs(self):
        needed = [line for line in importlib.metadata.requires("stiction") if "extra ==" not in line]
        self.assertEqual([re.match(r"[\w-]+", line).group() for line in needed], ["numpy"])

    def test_the_wheel_holds_the_package_and_nothing_else(self):
        names = set(zipfile.ZipFile(WHEEL).namelist())
        source = SOURCE / "python" / "stiction"
        sources = {f"stiction/{file.relative_to(source)}" for file in source.rglob("*.py")}
        self.assertEqual({name for name in names if name.endswith(".py")}, sources)
        self.assertLessEqual({"stiction/py.typed", "stiction/_core.pyi"}, names)
        # auditwheel puts shared libraries that a module brings into stiction.libs.
        self.assertEqual([name for name in names if not re.match(r"stiction(-[0-9.]+\.dist-info|\.libs)?/", name)], [])

    def test_the_first_program_of_the_python_page_runs(self):
        # It needs NumPy alone; test_docs.py runs the README's, which steps robots.
        page = (SOURCE / "docs" / "reference" / "python.md").read_text(encoding="utf-8")
        program = re.search(r"```python\n(.*?)```", page, re.S).group(1)
        said = run(program + "\nprint(*np.round(solution.lambda_.ravel(), 3) + 0.0, solution.solved.all())")
        self.assertEqual(said.splitlines()[-1], "9.81 -2.0 0.0 9.81 -4.905 0.0 True")

    def test_the_command_makes_a_page_and_says_what_is_missing(self):
        program = pathlib.Path(sys.prefix, "bin", "stiction")

        def command(*arguments):
            return subprocess.run([program, *arguments], env={"PATH": ""}, capture_output=True, text=True, timeout=60)

        report = {"schema_version": 2, "device": "cpu", "environments": 2, "unconverged": 1, "seconds": {"solve": 0.5},
                  "residual": {"min": 0, "median": 1e-9, "p90": 1e-8, "max": 1e-7}, "iterations": None}
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder, "run.json")
            path.write_text(json.dumps(report), encoding="utf-8")
            done = command("report", path)
            page = path.with_suffix(".html")
            self.assertEqual((done.returncode, done.stdout, done.stderr), (0, f"report: {page}\n", ""))
            self.assertIn("not solved", page.read_text(encoding="utf-8"))
        for name, needs in (("rerun", "needs Rerun"), ("viser", "needs viser")):
            done = command("view", SOURCE / "examples" / "data" / "pile.h5", "--backend", name)
            self.assertEqual(done.returncode, 2)
            self.assertRegex(done.stderr, f"^stiction.view.* {needs}, which is not installed: pip install .*\n$")
        done = command("solve", "x.h5")
        self.assertEqual((done.returncode, done.stdout, done.stderr.count("\n")), (2, "", 1))
        self.assertRegex(command("--help").stdout, "report +makes a page")

    def test_all_kernels_of_this_build_give_the_same_bits(self):
        own = run(HASH)
        self.assertRegex(own, r"^[0-9a-f]{16}$")
        names = run(NAMES).split(", ")
        self.assertIn("widest", names)
        for name in names:
            with self.subTest(name):
                self.assertEqual(run(HASH, STICTION_ISA=name), own)


if __name__ == "__main__":
    result = unittest.main(argv=sys.argv[:1], verbosity=2, exit=False).result
    failed, skipped = len(result.failures) + len(result.errors), len(result.skipped)
    print(f"{result.testsRun - failed - skipped} passed, {failed} failed, {skipped} skipped", flush=True)
    sys.exit(1 if failed else 0)
