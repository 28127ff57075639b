#!/usr/bin/env python3
"""Every comparison in one command: tables, pictures and a summary, in under 20 minutes on two idle cores; a GPU takes 30 more.

    bench/peers/run.py [--build build-bench] [--python-package BUILD/python] [--data DATA] [--judge check_solution.py]
                       [--results bench/results/MACHINE/peers] [--images docs/images] [--seed S] [--parts a,b] [--patience 1]

A part may lack something (a Python module, a program, recorded problems, a judge, a GPU). It is left out, and the
summary says what it lacks. Each part has a limit in seconds of the wall clock, times --patience on a machine that is
busy. What it has written by then is kept. Each part's own output is in --logs. Writes summary.md.
"""

import argparse
import dataclasses
import os
import pathlib
import signal
import subprocess
import sys
import tempfile
import time

HERE = pathlib.Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent / "studies")]

import measure  # noqa: E402
import summary  # noqa: E402


@dataclasses.dataclass
class Part:
    name: str
    question: str
    seconds: int
    command: list  # strings and paths
    modules: tuple = ()  # of Python
    files: tuple = ()  # programs and folders
    judge: bool = False
    gpu: bool = False


SEES_GPU = "import torch, stiction; assert torch.cuda.is_available(); stiction.Solver(device='cuda')"


def parts(a):
    """What is to be run with these arguments."""
    script, judge = (lambda name: [sys.executable, HERE / name]), (["--judge", a.judge] if a.judge else [])
    ours, results, images = a.build / "bin" / "stiction", ["--results", a.results], ["--images", a.images]
    ratio, data = a.build / "bench" / "bench_ratio", ["--data", a.data]
    seed = [] if a.seed is None else ["--seed", a.seed]
    goals = "f64:1e-2,f64:1e-4,f64:1e-6,f64:1e-8"
    names = ("humanoid", "g1", "go1", "leap_hand", "franka_cube", "aloha_peg", "car")
    robots = [a.data / "mujoco" / f"{name}.h5" for name in names]
    contacts = [a.data / "coulomb" / f"{name}.h5" for name in ("boxes", "rover", "single_object", "small")]
    return [
        Part("ratio", "against a naive loop and Eigen (C1, C2)", 60,
             [ratio, "--contacts", "4,8,16,22", "--envs", "1024", "--precision", "f32", "--csv", a.results / "ratio.csv"],
             files=(ratio,)),
        Part("robots", "against MuJoCo's solvers on recorded robots (C3)", 120,
             [*script("robots.py"), *robots, *judge, *results, *images], ("stiction", "mujoco", "matplotlib"), tuple(robots)),
        Part("robots_1024", "the same, states repeated to 1024 environments", 200,
             [*script("robots.py"), *robots, *judge, *results, *images, "--envs", "1024", "--repeat", "--forms", "matrix,jacobian", "--seconds", "0.8",
              "--name", "robots_1024"], ("stiction", "mujoco", "matplotlib"), tuple(robots)),
        Part("engines", "against Bullet, ODE and DART (C4)", 360,
             [*script("engines.py"), ours, *data, *judge, *results], files=(ours, HERE / "engines.py", a.data), judge=True),
        Part("against", "against Siconos and Clarabel on recorded contacts (C5)", 150,
             [*script("against.py"), ours, a.data / "fclib", *contacts, *judge, *results, "--goals", "1e-4,1e-8", "--seconds", "0.5",
              "--solvers", "auto,npgs,admm,auto/apart", "--laws", "file"], files=(ours, a.data / "fclib", *contacts), judge=True),
        Part("scaling", "time against environments, contacts and threads; tails; warm starts (C6, S4, S5, A3)", 120,
             [*script("scaling.py"), ours, *data, *judge, *results, *images], ("stiction", "matplotlib"), (ours,)),
        Part("roofline", "operations a second of sweeps, under the roof of one core (G10 on the CPU)", 60,
             [*script("roofline.py"), *results, *images], ("stiction", "matplotlib"), (HERE / "yardstick.c",)),
        Part("fresh", "C1, C2 and C5 on scenes of a new seed", 160,
             [*script("fresh.py"), ours, "--bench-ratio", ratio, *judge, *results, *seed], files=(ours, ratio), judge=True),
        Part("profiles", "performance profiles at 1e-2, 1e-4, 1e-6 and 1e-8", 190,
             [*script("../studies/roster.py"), ours, *robots, *contacts, *judge, *results, "--goals", goals, "--profiled", goals, "--name",
              "profiles", "--profiles", a.images / "peers_profiles.png", "--timeout", "2", "--max-iterations", "2000"],
             ("matplotlib",), (ours, *robots, *contacts), True),
        Part("gpu", "stiction on a GPU against MJX, MuJoCo Warp and PyTorch; the GPU against two threads (G1, G4, G5, X1)", 1800,
             [*script("gpu.py"), *robots[:3], "--envs", "1024,8192,32768", *judge, *results, *images], ("stiction", "torch", "matplotlib"),
             tuple(robots[:3]), gpu=True),
        Part("work_precision", "residual against time", 110,
             [*script("../studies/work_precision.py"), ours, *data, *judge, *results, *images, "--name", "peers_work_precision", "--scenes",
              "humanoid,G1,LEAP hand", "--short", "--limit", "0.5"], ("matplotlib",), (ours,)),
    ]


def lacks(part, a, environment):
    """What the part needs and is not there, in words; empty if nothing."""
    missing = [f"{pathlib.Path(path).name} is not there" for path in part.files if not pathlib.Path(path).exists()]
    for module in ("h5py", *part.modules):
        if subprocess.run([sys.executable, "-c", f"import {module}"], capture_output=True, env=environment).returncode:
            missing.append(f"no Python module {module}")
    if part.judge and not a.judge:
        missing.append("no --judge")
    if part.gpu and not missing and subprocess.run([sys.executable, "-c", SEES_GPU], capture_output=True, env=environment).returncode:
        missing.append("no GPU that PyTorch and stiction can use")
    return "; ".join(missing)


def run(part, a, environment):
    """(seconds, how it ended)."""
    begin, limit = time.monotonic(), part.seconds * a.patience
    with open(a.logs / f"{part.name}.log", "w") as log:
        process = subprocess.Popen([str(word) for word in part.command], stdout=log, stderr=subprocess.STDOUT, env=environment,
                                   start_new_session=True)
        try:
            status = process.wait(limit)
            said = "done" if status == 0 else f"exit status {status}, see {log.name}"
        except (subprocess.TimeoutExpired, KeyboardInterrupt) as why:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
            if isinstance(why, KeyboardInterrupt):
                raise
            said = f"stopped after {limit:.0f} s"
    return time.monotonic() - begin, said


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    root = measure.ROOT
    parser.add_argument("--build", type=pathlib.Path, default=root / "build-bench", help="has bin/stiction and bench/bench_ratio")
    parser.add_argument("--python-package", type=pathlib.Path, help="folder that holds the package; default: BUILD/python")
    parser.add_argument("--data", type=pathlib.Path, default=root.parent / "shared" / "data")
    parser.add_argument("--judge", type=pathlib.Path)
    parser.add_argument("--results", type=pathlib.Path, default=root / "bench" / "results" / measure.machine_name() / "peers")
    parser.add_argument("--images", type=pathlib.Path, default=root / "docs" / "images")
    parser.add_argument("--logs", type=pathlib.Path, default=pathlib.Path(tempfile.gettempdir(), "stiction_peers"))
    parser.add_argument("--seed", type=int, help="of the fresh scenes; default: drawn")
    parser.add_argument("--parts", help="these alone; default: all")
    parser.add_argument("--patience", type=float, default=1.0)
    a = parser.parse_args()
    for folder in (a.results, a.images, a.logs):
        folder.mkdir(parents=True, exist_ok=True)
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
    package = (a.python_package or a.build / "python").resolve()
    environment["PYTHONPATH"] = os.pathsep.join([str(package), *filter(None, [os.environ.get("PYTHONPATH")])])
    chosen = [part for part in parts(a) if not a.parts or part.name in a.parts.split(",")]
    ended, failed = [], False
    for number, part in enumerate(chosen, 1):
        missing = lacks(part, a, environment)
        print(f"[{number}/{len(chosen)}] {part.name}: {part.question}", end=" ", flush=True)
        spent, said = (0.0, f"left out: {missing}") if missing else run(part, a, environment)
        print(f"- {said}" + (f", {spent:.0f} s" if spent else ""), flush=True)
        failed |= said.startswith("exit status")
        ended.append((part.name, part.question, said, spent))
    text = summary.text(a.results, ended)
    (a.results / "summary.md").write_text(text)
    print("\n" + text)
    sys.exit(failed)


if __name__ == "__main__":
    main()
