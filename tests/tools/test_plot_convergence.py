#!/usr/bin/env python3
"""Input and pictures of tools/plot_convergence.py.

Run as a program it exits with 77 (skipped) when numpy or matplotlib is missing, and says which.
"""
import contextlib
import importlib.util
import io
import sys
import tempfile
import unittest
from pathlib import Path

TOOL = Path(__file__).resolve().parents[2] / "tools" / "plot_convergence.py"
GOOD = "iteration,median,p90,max\n0,1,2,3\n1,0.5,0.6,0.7\n10,0.05,0.06,0.07\n100,0,1e-9,1e-8\n"

try:
    import numpy as np

    spec = importlib.util.spec_from_file_location("plot_convergence", TOOL)
    plot_convergence = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(plot_convergence)
except ImportError as missing:
    REASON = f"SKIPPED: the plotter is not tested, {missing}; pip install -r tools/requirements.txt"
    if __name__ == "__main__":
        print(REASON)
        sys.exit(77)
    raise unittest.SkipTest(REASON) from missing


class PlotConvergence(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)

    def file(self, name, text):
        path = self.folder / name
        path.write_text(text, encoding="utf-8")
        return str(path)

    def run_tool(self, *arguments, output="out.png"):
        errors, path = io.StringIO(), self.folder / output
        with contextlib.redirect_stderr(errors), contextlib.redirect_stdout(io.StringIO()):
            status = plot_convergence.main([*arguments, "-o", str(path)])
        return status, errors.getvalue(), path

    def test_a_trace_loses_its_start_and_its_exact_zeros(self):
        trace = plot_convergence.read_trace(self.file("a.csv", "# solver npgs\n" + GOOD))
        np.testing.assert_array_equal(trace["iteration"], [1, 10, 100])
        np.testing.assert_array_equal(trace["median"], [0.5, 0.05, np.nan])
        np.testing.assert_array_equal(trace["max"], [0.7, 0.07, 1e-8])

    def test_columns_are_found_by_name(self):
        trace = plot_convergence.read_trace(self.file("a.csv", "max,iteration,seconds,p90,median\n4,1,9,3,2\n"))
        self.assertEqual([trace[c][0] for c in ("iteration", "median", "p90", "max")], [1, 2, 3, 4])

    def test_several_solvers_become_one_picture_and_the_same_bytes_twice(self):
        traces = ("npgs=" + self.file("a.csv", GOOD), self.file("apgd.csv", GOOD.replace("0.5,0.6,0.7", "0.2,0.3,0.4")))
        pictures = [self.run_tool(*traces, "--tolerance", "1e-6", "--title", "x", output=f"{i}.png") for i in range(2)]
        for status, errors, path in pictures:
            self.assertEqual((status, errors), (0, ""))
            self.assertEqual(path.read_bytes()[:8], b"\x89PNG\r\n\x1a\n")
        self.assertEqual(pictures[0][2].read_bytes(), pictures[1][2].read_bytes())
        self.assertNotEqual(pictures[0][2].read_bytes(), self.run_tool(traces[0], output="one.png")[2].read_bytes())

    def test_each_solver_is_drawn_with_its_own_numbers(self):
        trace = plot_convergence.read_trace(self.file("a.csv", GOOD))
        drawn, close = [], plot_convergence.plt.close
        plot_convergence.plt.close = drawn.append
        try:
            plot_convergence.draw({"npgs": trace}, self.folder / "a.png")
        finally:
            plot_convergence.plt.close = close
        axes = drawn[0].axes[0]
        lines = {line.get_label(): line for line in axes.get_lines()}
        np.testing.assert_array_equal(lines["npgs"].get_ydata(), trace["median"])
        self.assertEqual((axes.get_xscale(), axes.get_yscale()), ("log", "log"))
        close(drawn[0])

    def test_bad_traces_get_one_sentence_and_status_2(self):
        good = self.file("a.csv", GOOD)
        for arguments, sentence in (
                ((self.file("b.csv", "iteration,median\n1,2\n"),), "the header lacks p90, max"),
                ((self.file("c.csv", "iteration,median,p90,max\n1,2,x,4\n"),), "a value is not a number"),
                ((self.file("d.csv", "iteration,median,p90,max\n1,2\n"),), "a value is not a number"),
                ((self.file("e.csv", "iteration,median,p90,max\n0,1,2,3\n"),), "no iteration from 1 on"),
                ((self.file("f.csv", ""),), "the header lacks iteration"),
                ((str(self.folder / "none.csv"),), "cannot be read"),
                ((good, good), "two traces are called a")):
            status, errors, path = self.run_tool(*arguments)
            self.assertEqual((status, path.exists()), (2, False))
            self.assertIn(sentence, errors)
            self.assertEqual(errors.count("\n"), 1)


if __name__ == "__main__":
    unittest.main(verbosity=2)  # says why a test is skipped
