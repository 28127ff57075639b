#!/usr/bin/env python3
"""Environments that `stiction step` steps a second, with the shares of its stages, as a table.

Usage: step.py STICTION [--scenes pile,walker] [--envs 64,1024,4096] [--precisions f64,f32] [--steps 200] [--threads 0]
               [--device cpu] [--csv PATH]

Line 1 of the table is the command, the lines below it are the machine and its load before and after. With the load
above zero at the beginning another program was using the cores, and rates are lower bounds. cpu_us, processor
microseconds of an environment-step, suffers less from that.
"""

import argparse
import csv
import io
import json
import os
import pathlib
import platform
import subprocess
import sys

COLUMNS = ["scene", "precision", "device", "environments", "steps", "threads", "sps", "effective_sps", "quality",
           "cpu_us", "solver_share", "detect_share", "plan_share", "utilisation", "contacts", "residual_median",
           "residual_max", "energy_begin", "energy_end", "hash"]


def measure(program, scene, precision, envs, arguments):
    """One row of the table."""
    command = [program, "step", scene, "--envs", str(envs), "--steps", str(arguments.steps), "--precision", precision,
               "--threads", str(arguments.threads), "--device", arguments.device, "--json", "-"]
    report = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    seconds = report["seconds"]
    return {
        **{name: report[name] for name in ("scene", "precision", "device", "environments", "steps", "threads", "hash")},
        "sps": f"{report['sps']:.4g}", "effective_sps": f"{report['effective_sps']:.4g}",
        "cpu_us": f"{1e6 * seconds['cpu'] / (report['environments'] * report['steps']):.4g}",
        "quality": f"{report['quality']:.4f}", "solver_share": f"{report['solver_share']:.3f}",
        "detect_share": f"{seconds['detect'] / seconds['wall']:.3f}",
        "plan_share": f"{seconds['plan'] / seconds['wall']:.3f}", "utilisation": f"{report['utilisation']:.3f}",
        "contacts": f"{report['contacts'] / (report['environments'] * report['steps']):.2f}",
        "residual_median": f"{report['residual']['median']:.2e}", "residual_max": f"{report['residual']['max']:.2e}",
        "energy_begin": f"{report['energy']['begin']:.6g}", "energy_end": f"{report['energy']['end']:.6g}"}


def processor():
    for line in pathlib.Path("/proc/cpuinfo").read_text().splitlines():
        if line.startswith("model name"):
            return line.split(":", 1)[1].strip()
    return platform.processor() or "unknown"


def load():
    return f"{os.getloadavg()[0]:.2f}"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("stiction")
    parser.add_argument("--scenes", default="pile,walker")
    parser.add_argument("--envs", default="64,1024,4096")
    parser.add_argument("--precisions", default="f64,f32")
    parser.add_argument("--steps", type=int, default=200)
    parser.add_argument("--threads", type=int, default=0)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--csv", type=pathlib.Path)
    arguments = parser.parse_args()
    before = load()
    rows = []
    for scene in arguments.scenes.split(","):
        for precision in arguments.precisions.split(","):
            for envs in arguments.envs.split(","):
                rows.append(measure(arguments.stiction, scene, precision, int(envs), arguments))
                print("  ".join(str(rows[-1][name]) for name in COLUMNS[:12]), file=sys.stderr)
    text = io.StringIO()
    words = [pathlib.Path(word).name if word.startswith("/") else word for word in sys.argv[1:]]
    text.write(f"# bench/studies/step.py {' '.join(words)}\n# processor: {processor()}\n# cores: {os.cpu_count()}\n")
    text.write(f"# load average of a minute: {before} before, {load()} after\n")
    writer = csv.DictWriter(text, COLUMNS, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    if arguments.csv:
        arguments.csv.write_text(text.getvalue())
    else:
        print(text.getvalue(), end="")


if __name__ == "__main__":
    main()
