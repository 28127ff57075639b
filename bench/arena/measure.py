"""Races of solvers share the judge, a clock of processor time, the machine's name, tables."""

import argparse
import csv
import importlib.util
import os
import pathlib
import re
import shutil
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
JUDGE = ROOT / "tools" / "check_law.py"


def load_judge(path=JUDGE):
    """residuals(batch, reactions, law) of a module."""
    spec = importlib.util.spec_from_file_location("judge", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.residuals


CLOCK = """
#define _GNU_SOURCE
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>
int clock_gettime(clockid_t clock, struct timespec* now) {
  return (int)syscall(SYS_clock_gettime, clock == CLOCK_MONOTONIC ? CLOCK_PROCESS_CPUTIME_ID : clock, now);
}
"""


def processor_clock(folder):
    """Environment variables under which the command line's clock is its own processor time, so that other programs'
    turns do not count. There are none (the wall clock) where there is no C compiler or no preloading."""
    source, library = pathlib.Path(folder) / "clock.c", pathlib.Path(folder) / "clock.so"
    source.write_text(CLOCK)
    built = shutil.which("cc") and sys.platform == "linux" and subprocess.run(
        ["cc", "-O2", "-shared", "-fPIC", str(source), "-o", str(library)], capture_output=True).returncode == 0
    if not built:
        print("no C compiler: times are wall-clock", file=sys.stderr)
    return {"LD_PRELOAD": str(library)} if built else {}


def machine_name():
    """As in run.sh: the environment's MACHINE, else processor and cores."""
    if os.environ.get("MACHINE"):
        return os.environ["MACHINE"]
    text = pathlib.Path("/proc/cpuinfo").read_text() if pathlib.Path("/proc/cpuinfo").exists() else ""
    model = re.search(r"^model name[^:]*: (.*)$", text, re.M)
    number = re.search(r"^model\s*: (.*)$", text, re.M)
    cores = len(re.findall(r"^processor\s*:", text, re.M)) or 1
    name = f"{model.group(1) if model else 'unknown'} model {number.group(1) if number else ''} {cores} cores"
    return re.sub(r"[^a-z0-9]+", "-", re.sub(r"\([A-Za-z]*\)", "", name).lower()).strip("-")


def write_table(path, comments, columns, rows):
    path.parent.mkdir(parents=True, exist_ok=True)
    with open(path, "w", newline="") as file:
        file.writelines(f"# {comment}\n" for comment in comments)
        table = csv.DictWriter(file, columns, lineterminator="\n")
        table.writeheader()
        table.writerows(rows)


def race_arguments(description, robots):
    """Common parser of programs that race on recorded robots, and the files that its arguments name."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="*", type=pathlib.Path)
    parser.add_argument("--data", type=pathlib.Path, default=ROOT.parent / "shared" / "data")
    parser.add_argument("--judge", default=JUDGE)
    parser.add_argument("--results", type=pathlib.Path, default=pathlib.Path("."))
    parser.add_argument("--images", type=pathlib.Path, default=pathlib.Path("."))
    parser.add_argument("--goals", type=lambda text: sorted(map(float, text.split(",")), reverse=True), default=[1e-4, 1e-6])

    def files(arguments):
        recorded = (arguments.data / "mujoco" / f"{name}.h5" for name in robots)
        return arguments.files or [path for path in recorded if path.is_file()]

    return parser, files


def rounded(rows):
    """Rows of a table with four digits a number."""
    return [{key: f"{value:.4g}" if isinstance(value, float) else value for key, value in row.items()} for row in rows]
