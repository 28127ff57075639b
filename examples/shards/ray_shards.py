"""Solves a batch in parts on the workers of a Ray cluster, and joins them.

    python examples/shards/ray_shards.py BATCH SOLUTION [--parts 8] [--cpus 8] [-- options of stiction solve]

Needs ray, and a folder for the parts that all workers see: SOLUTION's. docs/howto/shards.md.
"""

import argparse
import pathlib
import subprocess
import sys

try:
    import ray
except ImportError as missing:
    print(f"NOT run, because this needs ray: {missing}")
    sys.exit(77)


@ray.remote(max_retries=3)
def solve_part(command, output):
    """Solves one part. Ray starts it again elsewhere if its worker is lost: a part is renamed into place when whole."""
    finished = subprocess.run(command, capture_output=True, text=True, check=False)
    if finished.returncode > 1:  # 1: some environment did not end as `solved`, which the part's status says
        raise RuntimeError(finished.stderr.strip())
    return output


def partition(words, separator):
    """Words before and after the first separator, as str.partition does."""
    at = words.index(separator) if separator in words else len(words)
    return words[:at], words[at:at + 1], words[at + 1:]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("batch", type=pathlib.Path)
    parser.add_argument("solution", type=pathlib.Path)
    parser.add_argument("--parts", type=int, default=8)
    parser.add_argument("--cpus", type=int, default=1, help="of a part")
    parser.add_argument("--stiction", default="stiction", help="the command")
    own, _, options = partition(sys.argv[1:], "--")
    arguments = parser.parse_args(own)

    ray.init()  # the cluster that RAY_ADDRESS names, else one of this machine
    batch, solution = arguments.batch.resolve(), arguments.solution.resolve()
    parts = []
    for part in range(arguments.parts):
        output = f"{solution}.part-{part}"
        command = [arguments.stiction, "solve", str(batch), "--shard", f"{part}/{arguments.parts}",
                   "--threads", str(arguments.cpus), "--quiet", "-o", output, *options]
        parts.append(solve_part.options(num_cpus=arguments.cpus).remote(command, output))
    outputs = ray.get(parts)
    return subprocess.run([arguments.stiction, "merge", str(solution), *outputs], check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
