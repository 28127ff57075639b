#!/usr/bin/env python3
"""The part of scripts/gpu_check.sh after the build: tests, CPU and GPU hashes, sanitizer, benchmarks, one JSON file.

Every stage has a share of the time that is left, so that the whole ends on time. A stage that ran out of time says so
in the JSON and counts as failed.

With --device emulated the same stages run where there is no GPU, on fewer environments and without the sanitizer. That
is a rehearsal of this script, not a check of the machine.
"""

import argparse
import itertools
import json
import os
import pathlib
import platform
import re
import shutil
import subprocess
import sys
import time
import xml.etree.ElementTree as ElementTree

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import test_summary  # noqa: E402

SOLVERS = ["npgs", "apgd", "pgs", "jacobi"]
# Tests that say nothing on a machine without a GPU, and must not have been skipped on one with a GPU.
GPU_TESTS = ["twin_test_cuda_twin", "twin_test_cuda_golden", "twin_test_cuda_memory", "twin_test_cuda_graph"]
# Programs of bench/ that print a table, with their arguments; the others are Google Benchmark's.
TABLES = {"bench_classes": ["--device", "{device}", "--repeats", "3", "--csv", "{out}/classes.csv"],
          "bench_ratio": ["--contacts", "8", "--envs", "4096", "--precision", "f32", "--csv", "{out}/headline.csv"]}
GOOGLE = ["bench_solvers", "bench_baselines"]
GENERATED = [("walker", 2048), ("mixed", 256), ("adversarial", 256), ("stack", 512)]
SANITIZER_TOOLS = ["memcheck", "racecheck", "synccheck", "initcheck"]


class Check:
    def __init__(self, arguments):
        self.root = arguments.root
        self.build = arguments.build
        self.out = arguments.out
        self.jobs = arguments.jobs
        self.device = arguments.device
        self.end = time.monotonic() + arguments.seconds
        self.stiction = self.build / "bin" / "stiction"
        self.failures = []
        self.has_gpu = False

    def left(self):
        return max(5.0, self.end - time.monotonic())

    def run(self, command, share=1.0, **more):
        """(exit status, output); 124 when the stage's share of the remaining time was not enough."""
        try:
            done = subprocess.run([str(word) for word in command], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                                  errors="replace", timeout=self.left() * share, check=False, **more)
            return done.returncode, done.stdout
        except subprocess.TimeoutExpired as expired:
            text = expired.stdout or b""
            return 124, text.decode(errors="replace") if isinstance(text, bytes) else text

    def fail(self, sentence):
        print(f"   FAILED: {sentence}", flush=True)
        self.failures.append(sentence)

    def machine(self):
        facts = {"processor": platform.processor() or platform.machine(), "cores": os.cpu_count(), "gpu": None}
        status, text = self.run(["nvidia-smi", "--query-gpu=name,compute_cap,driver_version,memory.total",
                                 "--format=csv,noheader"]) if shutil.which("nvidia-smi") else (1, "")
        if status == 0 and text.strip():
            facts["gpu"] = text.strip().splitlines()[0]
        if self.stiction.exists():
            status, text = self.run([self.stiction, "info", "--json"])
            if status == 0:
                facts["stiction"] = json.loads(text)
                for device in facts["stiction"]["devices"]:
                    if device["device"].startswith("cuda") and device["usable"]:
                        facts["cuda"] = device["name"]
        self.has_gpu = "cuda" in facts
        return facts

    def tests(self):
        junit = self.out / "gpu_tests.xml"
        junit.unlink(missing_ok=True)
        begin = time.monotonic()
        status, text = self.run(["ctest", "--test-dir", self.build, "-j", max(2, self.jobs // 2), "--output-on-failure",
                                 "-LE", "consumer|lint", "--timeout", "120", "--no-tests=error",
                                 "--test-output-size-passed", "1000000", "--output-junit", junit], share=0.45)
        (self.out / "gpu_tests.log").write_text(text)
        if not junit.exists():
            self.fail(f"ctest ended with status {status} and without a result; see gpu_tests.log")
            return {"status": status}
        passed, failed, skipped = test_summary.summarize(junit)
        if status != 0 or failed:
            self.fail(f"{failed} tests failed; see gpu_tests.log")
        if self.has_gpu:
            for name in silent_tests(junit):
                self.fail(f"{name} did not run on the GPU or skipped something; see gpu_tests.log")
        return {"passed": passed, "failed": failed, "skipped": skipped, "seconds": round(time.monotonic() - begin, 1)}

    def batches(self):
        found = sorted((self.root / "examples" / "data").glob("*.h5"))
        for scene, full in GENERATED:
            count = full if self.device == "cuda" else 8
            path = self.out / f"{scene}-{count}.h5"
            if not path.exists():
                status, text = self.run([self.stiction, "generate", scene, "--envs", count, "--seed", 7, "-o", path,
                                         "--quiet"], share=0.2)
                if status != 0:
                    self.fail(f"generate {scene}: {text.strip()}")
                    continue
            found.append(path)
        return found

    def solve(self, batch, solver, precision, law, device):
        report = self.out / "one_report.json"
        report.unlink(missing_ok=True)
        status, text = self.run([self.stiction, "solve", batch, "--solver", solver, "--precision", precision, "--law", law,
                                 "--device", device, "--tolerance", "1e-6", "--max-iterations", "500", "--quiet",
                                 "--json", report], share=0.3)
        if status > 1 or not report.exists():
            return None, text.strip() or f"exit status {status}"
        return json.loads(report.read_text()), None

    def hashes(self):
        """Every batch, solver, precision and law on both devices. Stops early, and says so, when time is short."""
        results = {"compared": 0, "different": 0, "left_out": 0, "runs": []}
        cases = list(itertools.product(self.batches(), SOLVERS, ["f32", "f64"], ["convex", "coulomb"]))
        reserve = self.left() * 0.45  # for the sanitizer and the benchmarks
        for batch, solver, precision, law in cases:
            if self.left() < reserve:
                results["left_out"] += 1
                continue
            both = {}
            for device in ("cpu", self.device):
                report, error = self.solve(batch, solver, precision, law, device)
                if report is None:
                    self.fail(f"{batch.stem} {solver} {precision} {law} on {device}: {error}")
                    break
                both[device] = report
            if len(both) < 2:
                results["different"] += 1
                continue
            cpu, other = both["cpu"], both[self.device]
            same = cpu["hash"] == other["hash"]
            results["compared"] += 1
            results["different"] += 0 if same else 1
            if not same:
                self.fail(f"{batch.stem} {solver} {precision} {law}: cpu {cpu['hash']}, {self.device} {other['hash']}")
            results["runs"].append({
                "batch": batch.stem, "environments": cpu["environments"], "solver": solver, "precision": precision,
                "law": law, "same": same, "hash": cpu["hash"], "seconds_cpu": cpu["seconds"]["solve"],
                f"seconds_{self.device}": other["seconds"]["solve"], "residual": other["residual"],
                "unconverged": other["unconverged"]})
        print(f"   {results['compared']} compared, {results['different']} different, {results['left_out']} left out for time")
        if results["compared"] == 0:
            self.fail("no hash was compared")
        return results

    def sanitizer(self):
        program = shutil.which("compute-sanitizer") or shutil.which("/usr/local/cuda/bin/compute-sanitizer")
        if program is None:
            print("   compute-sanitizer is not here")
            return {"available": False}
        small = self.out / "sanitizer.h5"
        status, text = self.run([self.stiction, "generate", "mixed", "--envs", 6, "--seed", 3, "-o", small, "--quiet"])
        if status != 0:
            self.fail(f"sanitizer: {text.strip()}")
            return {"available": True}
        results = {"available": True, "runs": []}
        reserve = self.left() * 0.4  # for the benchmarks
        for tool, solver in itertools.product(SANITIZER_TOOLS, SOLVERS):
            if self.left() < reserve:
                results["runs"].append({"tool": tool, "solver": solver, "result": "left out for time"})
                continue
            status, text = self.run([program, "--tool", tool, "--error-exitcode", "99", "--print-limit", "5", self.stiction,
                                     "solve", small, "--solver", solver, "--device", "cuda", "--precision", "f32",
                                     "--max-iterations", "5", "--quiet"], share=0.2)
            clean = status in (0, 1) and re.search(r"SUMMARY: 0 (errors|hazards)", text) is not None
            result = "clean" if clean else "out of time" if status == 124 else "errors"
            results["runs"].append({"tool": tool, "solver": solver, "result": result})
            if result == "errors":
                self.fail(f"compute-sanitizer {tool}, {solver}: {text.strip()[-600:]}")
        print("   " + ", ".join(f"{r['tool']} {r['solver']} {r['result']}" for r in results["runs"]))
        return results

    def benchmarks(self):
        results = {}
        programs = [*TABLES, *GOOGLE]
        for position, name in enumerate(programs):
            program = next((folder / name for folder in (self.build / "bench", self.build / "bin")
                            if os.access(folder / name, os.X_OK)), None)
            if program is None:
                print(f"   {name} was not built")
                results[name] = "not built"
                continue
            file = self.out / f"{name}.json"
            file.unlink(missing_ok=True)
            words = TABLES.get(name)
            if words is None:
                words = [f"--benchmark_out={file}", "--benchmark_out_format=json", "--benchmark_min_time=0.05"]
            elif name == "bench_classes" and self.device != "cuda":
                words = [*words, "--parts", "envs,plan", "--envs", "16"]
            status, text = self.run([program, *(word.format(device=self.device, out=self.out) for word in words)],
                                    share=0.9 / (len(programs) - position), cwd=self.root)
            results[name] = self.result_of(name, file, status, text)
            print(f"   {name}: {results[name] if isinstance(results[name], str) else f'{len(results[name])} results'}")
        return results

    def result_of(self, name, file, status, text):
        """What one program measured: the lines of its table, or Google Benchmark's list; a sentence if nothing."""
        if status == 0 and name in TABLES:
            return text.splitlines()
        try:
            return json.loads(file.read_text())["benchmarks"]
        except (OSError, ValueError):
            if status != 124:
                self.fail(f"{name} ended with status {status}: {text.strip()[-300:]}")
            return f"no result (status {status}{', out of time' if status == 124 else ''})"


def silent_tests(junit):
    """Those of GPU_TESTS that a CTest result does not show as run in full."""
    ran = {case.get("name"): test_summary.count(case) for case in ElementTree.parse(junit).getroot().iter("testcase")}
    return [name for name in GPU_TESTS if name not in ran or ran[name].passed == 0 or ran[name].skipped > 0]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    for name in ("--root", "--build", "--out"):
        parser.add_argument(name, type=pathlib.Path, required=True)
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--seconds", type=float, default=400, help="time for all stages together")
    parser.add_argument("--device", choices=["cuda", "emulated"], default="cuda", help="what is compared with the CPU")
    parser.add_argument("--build-seconds", type=float, default=0)
    arguments = parser.parse_args()
    check = Check(arguments)
    begin = time.monotonic()
    result = {"schema_version": 1, "build_seconds": arguments.build_seconds}
    stages = [("machine", check.machine), ("tests", check.tests)]
    if check.stiction.exists():
        stages += [("hashes", check.hashes), ("sanitizer", check.sanitizer)]
    else:
        check.fail("the command line was not built (HDF5, CLI11, fmt, nlohmann-json): no hashes compared, no sanitizer run")
    stages.append(("benchmarks", check.benchmarks))
    for name, stage in stages:
        print(f"\n== {name}", flush=True)
        needs_gpu = name == "sanitizer" or (name == "hashes" and arguments.device == "cuda")
        if needs_gpu and not check.has_gpu:
            print("   left out: no usable CUDA device")
            continue
        result[name] = stage()
        if name == "machine" and not check.has_gpu and arguments.device == "cuda":
            reasons = [d["reason"] for d in result["machine"].get("stiction", {}).get("devices", []) if d["reason"]]
            check.fail(f"no usable CUDA device{': ' + reasons[0] if reasons else ''}")
    result["failures"] = check.failures
    result["seconds"] = round(time.monotonic() - begin + arguments.build_seconds, 1)
    (arguments.out / "gpu_check.json").write_text(json.dumps(result, indent=1) + "\n")
    print(f"\n{arguments.out / 'gpu_check.json'}: {len(check.failures)} failures, {result['seconds']} s")
    return 1 if check.failures else 0


if __name__ == "__main__":
    sys.exit(main())
