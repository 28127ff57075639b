#!/usr/bin/env python3
"""The part of scripts/gpu_check.sh after the build: tests, CPU and GPU hashes, sanitizer, benchmarks, one JSON file.

Every stage has a share of the time that is left, so that the whole ends on time; a stage that ran out of time says so
in the JSON and counts as failed.
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

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import test_summary  # noqa: E402

SOLVERS = ["npgs", "apgd", "pgs", "jacobi"]
GENERATED = [("walker", 2048), ("mixed", 256), ("adversarial", 256), ("stack", 512)]
SANITIZER_TOOLS = ["memcheck", "racecheck", "synccheck", "initcheck"]


class Check:
    def __init__(self, arguments):
        self.root = arguments.root
        self.build = arguments.build
        self.out = arguments.out
        self.jobs = arguments.jobs
        self.end = time.monotonic() + arguments.seconds
        self.stiction = self.build / "bin" / "stiction"
        self.failures = []

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
        return {"passed": passed, "failed": failed, "skipped": skipped, "seconds": round(time.monotonic() - begin, 1)}

    def batches(self):
        found = sorted((self.root / "examples" / "data").glob("*.h5"))
        for scene, count in GENERATED:
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
            for device in ("cpu", "cuda"):
                report, error = self.solve(batch, solver, precision, law, device)
                if report is None:
                    self.fail(f"{batch.stem} {solver} {precision} {law} on {device}: {error}")
                    break
                both[device] = report
            if len(both) < 2:
                results["different"] += 1
                continue
            same = both["cpu"]["hash"] == both["cuda"]["hash"]
            results["compared"] += 1
            results["different"] += 0 if same else 1
            if not same:
                self.fail(f"{batch.stem} {solver} {precision} {law}: cpu {both['cpu']['hash']}, cuda {both['cuda']['hash']}")
            results["runs"].append({
                "batch": batch.stem, "environments": both["cpu"]["environments"], "solver": solver, "precision": precision,
                "law": law, "same": same, "hash": both["cpu"]["hash"],
                "seconds_cpu": both["cpu"]["seconds"]["solve"], "seconds_cuda": both["cuda"]["seconds"]["solve"],
                "residual": both["cuda"]["residual"], "unconverged": both["cuda"]["unconverged"]})
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
        programs = [p for folder in (self.build / "bin", self.build / "bench") for p in sorted(folder.glob("*bench*"))
                    if p.is_file() and os.access(p, os.X_OK)]
        results = {}
        for position, program in enumerate(programs):
            file = self.out / f"{program.name}.json"
            file.unlink(missing_ok=True)
            status, text = self.run([program, f"--benchmark_out={file}", "--benchmark_out_format=json",
                                     "--benchmark_min_time=0.05"], share=0.9 / (len(programs) - position))
            try:
                results[program.name] = json.loads(file.read_text())["benchmarks"]
                print(f"   {program.name}: {len(results[program.name])} results")
            except (OSError, ValueError):
                results[program.name] = f"no result (status {status}{', out of time' if status == 124 else ''})"
                print(f"   {program.name}: {results[program.name]}")
                if status != 124:
                    self.fail(f"{program.name} ended with status {status}: {text.strip()[-300:]}")
        return results


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    for name in ("--root", "--build", "--out"):
        parser.add_argument(name, type=pathlib.Path, required=True)
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--seconds", type=float, default=400, help="time for all stages together")
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
        if name in {"hashes", "sanitizer"} and "cuda" not in result["machine"]:
            print("   left out: no usable CUDA device")
            continue
        result[name] = stage()
        if name == "machine" and "cuda" not in result["machine"]:
            reasons = [d["reason"] for d in result["machine"].get("stiction", {}).get("devices", []) if d["reason"]]
            check.fail(f"no usable CUDA device{': ' + reasons[0] if reasons else ''}")
    result["failures"] = check.failures
    result["seconds"] = round(time.monotonic() - begin + arguments.build_seconds, 1)
    (arguments.out / "gpu_check.json").write_text(json.dumps(result, indent=1) + "\n")
    print(f"\n{arguments.out / 'gpu_check.json'}: {len(check.failures)} failures, {result['seconds']} s")
    return 1 if check.failures else 0


if __name__ == "__main__":
    sys.exit(main())
