"""tools/gpu_check.py with every program it starts pretended: which stages run, and what makes the check fail."""

import contextlib
import io
import json
import pathlib
import sys
import tempfile
import unittest
from unittest import mock

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "tools"))
import gpu_check  # noqa: E402

CASE = ('<testcase name="twin_test_cuda_{}" status="run"><system-out>[==========] 3 tests from 1 test suite ran.\n{}'
        '</system-out></testcase>')


class Pretended:
    """Answers as the programs would; `gpu`, `differs`, `skips`, `breaks` say how."""

    def __init__(self, gpu=False, differs=False, skips=False, breaks=False):
        self.gpu, self.differs, self.skips, self.breaks = gpu, differs, skips, breaks

    def run(self, command, share=1.0, **more):
        words = [str(word) for word in command]
        name = pathlib.Path(words[0]).name

        def after(option):
            return words[words.index(option) + 1]

        if name == "stiction":
            return self.stiction(words[1], after)
        if name == "compute-sanitizer":
            return 0, "========= ERROR SUMMARY: 0 errors"
        if name == "ctest":
            text = "[  SKIPPED ] 1 test, listed below:" if self.skips else "[  PASSED  ] 3 tests."
            cases = "".join(CASE.format(test, text) for test in ("twin", "golden", "memory", "graph"))
            pathlib.Path(after("--output-junit")).write_text(f"<testsuite>{cases}</testsuite>")
            return 0, ""
        if name == "bench_classes":
            return (2, "broken") if self.breaks else (0, "one line")
        if name == "bench_solvers":
            file = next(word.split("=", 1)[1] for word in words if word.startswith("--benchmark_out="))
            pathlib.Path(file).write_text(json.dumps({"benchmarks": [{"name": "pretended"}]}))
            return 0, ""
        return 1, ""

    def stiction(self, command, after):
        if command == "info":
            return 0, json.dumps({"devices": [
                {"device": "cpu", "usable": True, "name": "cpu", "reason": ""},
                {"device": "cuda:0", "usable": self.gpu, "name": "one", "reason": "" if self.gpu else "there is none"}]})
        if command == "solve":
            different = self.differs and after("--device") != "cpu"
            pathlib.Path(after("--json")).write_text(json.dumps(
                {"hash": "b" if different else "a", "environments": 1, "seconds": {"solve": 1}, "residual": 0,
                 "unconverged": 0}))
        return 0, ""


class GpuCheck(unittest.TestCase):
    def check(self, device="cuda", **how):
        pretended = Pretended(**how)
        with tempfile.TemporaryDirectory() as name, contextlib.redirect_stdout(io.StringIO()) as printed:
            folder = pathlib.Path(name)
            (folder / "out").mkdir()
            for program in ("bin/stiction", "bench/bench_classes", "bench/bench_solvers"):
                (folder / "build" / program).parent.mkdir(parents=True, exist_ok=True)
                (folder / "build" / program).touch(mode=0o755)
            words = ["gpu_check.py", "--root", name, "--build", f"{name}/build", "--out", f"{name}/out", "--seconds", "1e6",
                     "--device", device]
            with mock.patch.object(gpu_check.Check, "run", lambda self, *given, **more: pretended.run(*given, **more)), \
                    mock.patch.object(gpu_check.shutil, "which", lambda program: program), \
                    mock.patch.object(sys, "argv", words):
                status = gpu_check.main()
            result = json.loads((folder / "out" / "gpu_check.json").read_text())
        self.assertEqual(status == 0, not result["failures"], printed.getvalue())
        return result

    def test_all_stages_run_on_a_machine_with_a_gpu(self):
        result = self.check(gpu=True)
        self.assertEqual(result["failures"], [])
        self.assertEqual(result["tests"]["passed"], 12)
        # Four generated batches, every solver, precision and law.
        self.assertEqual((result["hashes"]["compared"], result["hashes"]["different"]), (4 * 4 * 2 * 2, 0))
        self.assertEqual({run["result"] for run in result["sanitizer"]["runs"]}, {"clean"})
        self.assertEqual(result["benchmarks"]["bench_classes"], ["one line"])
        self.assertEqual(result["benchmarks"]["bench_solvers"], [{"name": "pretended"}])
        self.assertEqual(result["benchmarks"]["bench_ratio"], "not built")

    def test_a_machine_without_a_gpu_fails_with_the_reason_and_compares_nothing(self):
        result = self.check()
        self.assertEqual(result["failures"], ["no usable CUDA device: there is none"])
        self.assertNotIn("hashes", result)
        self.assertNotIn("sanitizer", result)

    def test_a_rehearsal_needs_no_gpu_and_leaves_the_sanitizer_out(self):
        result = self.check("emulated")
        self.assertEqual(result["failures"], [])
        self.assertEqual(result["hashes"]["compared"], 64)
        self.assertNotIn("sanitizer", result)

    def test_other_bits_are_a_failure(self):
        result = self.check(gpu=True, differs=True)
        self.assertEqual(result["hashes"]["different"], 64)
        self.assertIn("cpu a, cuda b", result["failures"][0])

    def test_a_gpu_test_that_skipped_is_a_failure(self):
        result = self.check(gpu=True, skips=True)
        self.assertEqual(len(result["failures"]), 4)
        self.assertIn("twin_test_cuda_graph", result["failures"][3])

    def test_a_benchmark_that_ends_badly_is_a_failure(self):
        result = self.check("emulated", breaks=True)
        self.assertEqual(result["failures"], ["bench_classes ended with status 2: broken"])


if __name__ == "__main__":
    unittest.main(verbosity=2)  # says why a test is skipped
