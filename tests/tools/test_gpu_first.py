"""gpu_first: the emulated device is right, and whatever goes wrong is said and costs itself alone.

    test_gpu_first.py GPU_FIRST
"""

import json
import pathlib
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]

PROGRAM = sys.argv.pop() if len(sys.argv) > 1 and pathlib.Path(sys.argv[-1]).is_file() else None
HASHES = ROOT / "tools" / "gpu_first" / "hashes.csv"


def run(*options, hashes=HASHES):
    """(exit status, lines of the results)."""
    with tempfile.TemporaryDirectory() as name:
        out = pathlib.Path(name) / "results.jsonl"
        done = subprocess.run([PROGRAM, "--out", out, "--hashes", hashes, *options], capture_output=True, text=True, check=False)
        return done.returncode, [json.loads(line) for line in out.read_text().splitlines()]


@unittest.skipIf(PROGRAM is None, "no gpu_first is named")
class GpuFirst(unittest.TestCase):
    def test_the_cpu_has_the_committed_hashes(self):
        status, lines = run("--device", "cpu", "--size", "small", "--skip", "robot,golden")
        compared = [line for line in lines if "committed" in line]
        self.assertEqual({line["committed"] for line in compared}, {"equal"})
        self.assertGreater(len(compared), 90)
        self.assertEqual(status, 0)

    def test_the_emulated_device_has_the_cpus_bits(self):
        status, lines = run("--device", "emulated", "--only", "device,plan,class/dense,form/derivative,form/stepping,capture/cold,time/dense_tile,hash/piles,robot/piles/jm")
        self.assertEqual(status, 0, lines)
        self.assertEqual({line["result"] for line in lines}, {"equal", "right", "measured"})

    def test_another_hash_is_found(self):
        text = HASHES.read_text()
        row = next(line for line in text.splitlines() if line.startswith("class/dense_tile,npgs f32 convex,small,"))
        wrong = row[:-1] + ("0" if row[-1] != "0" else "1")
        with tempfile.NamedTemporaryFile("w", suffix=".csv") as file:
            file.write(text.replace(row, wrong))
            file.flush()
            status, lines = run("--device", "cpu", "--size", "small", "--only", "class/dense_tile", hashes=file.name)
        self.assertEqual(status, 1)
        self.assertEqual([line["result"] for line in lines], ["not what is committed", "equal", "wrong"])
        self.assertEqual(lines[0]["hash_committed"], wrong.rsplit(",", 1)[1])

    def test_what_hangs_dies_throws_or_differs_costs_itself_alone(self):
        status, lines = run("--device", "emulated", "--patience", "1", "--only", "self/,class/thread_small")
        self.assertEqual(status, 1)
        results = {(line["check"], line.get("part", "")): line for line in lines}
        self.assertEqual(results["class/thread_small", "npgs f32 convex"]["result"], "equal")
        self.assertEqual(results["self/hangs", "before"]["result"], "right")
        self.assertEqual(results["self/hangs", ""]["result"], "out of time")
        self.assertEqual((results["self/dies", ""]["result"], results["self/dies", ""]["signal"]), ("died", 6))
        self.assertEqual((results["self/throws", ""]["result"], results["self/throws", ""]["status"]), ("failed", 2))
        self.assertIn("a check that throws", results["self/throws", ""]["printed"])
        self.assertEqual(results["self/wrong", ""]["what"], "a check that is wrong")
        unequal = results["self/unequal", ""]
        self.assertEqual((unequal["result"], unequal["different"], unequal["first"]), ("different", 2, 2))
        self.assertEqual((results["all", ""]["right"], results["all", ""]["wrong"]), (1, 5))

    def test_a_check_that_has_no_time_left_is_said_to_be_left_out(self):
        status, lines = run("--device", "cpu", "--seconds", "0", "--only", "plan,class/dense_tile")
        self.assertEqual(status, 1)
        self.assertEqual([line["result"] for line in lines], ["left out: no time", "left out: no time", "wrong"])


if __name__ == "__main__":
    unittest.main(verbosity=2)
