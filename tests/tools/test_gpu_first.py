"""gpu_first and the pack that carries it: the emulated device is right, and a failure costs itself alone.

    test_gpu_first.py GPU_FIRST
"""

import json
import lzma
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import tarfile
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "tools"), str(ROOT / "tools" / "gpu_first")]
import pack_manifest  # noqa: E402
import prebuilt_cuda  # noqa: E402

PROGRAM = sys.argv.pop() if len(sys.argv) > 1 and pathlib.Path(sys.argv[-1]).is_file() else None
HASHES = ROOT / "tools" / "gpu_first" / "hashes.csv"
RECORDED = pathlib.Path(os.environ.get("STICTION_SHARED_DIR", ROOT.parent / "shared")) / "data" / "mujoco"


def lines_of(path):
    return [json.loads(line) for line in path.read_text().splitlines()]


def run(*options, hashes=HASHES):
    """(exit status, lines of the results)."""
    with tempfile.TemporaryDirectory() as name:
        out = pathlib.Path(name) / "results.jsonl"
        done = subprocess.run([PROGRAM, "--out", out, "--hashes", hashes, *options], capture_output=True, text=True, check=False)
        return done.returncode, lines_of(out)


@unittest.skipIf(PROGRAM is None, "no gpu_first is named")
class GpuFirst(unittest.TestCase):
    def test_the_cpu_has_the_committed_hashes(self):
        status, lines = run("--device", "cpu", "--size", "small", "--skip", "robot,golden")
        compared = [line for line in lines if "committed" in line]
        self.assertEqual({line["committed"] for line in compared}, {"equal"})
        self.assertGreater(len(compared), 90)
        self.assertEqual(status, 0)

    def test_the_emulated_device_has_the_cpus_bits(self):
        status, lines = run("--device", "emulated", "--only", "device,plan,class/dense,form/derivative,form/stepping,capture/cold,capture/leftovers,time/dense_tile,hash/piles,robot/piles/jm,lanes/pyramids")
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
        self.assertEqual((results["all", ""]["right"], results["all", ""]["wrong"]), (2, 5))

    def test_a_check_that_has_no_time_left_is_said_to_be_left_out(self):
        status, lines = run("--device", "cpu", "--seconds", "0", "--only", "plan,class/dense_tile")
        self.assertEqual(status, 1)
        self.assertEqual([line["result"] for line in lines], ["left out: no time", "left out: no time", "wrong"])


@unittest.skipIf(PROGRAM is None, "no gpu_first is named")
class Plan(unittest.TestCase):
    def test_phases_come_in_order_and_what_has_no_time_is_said(self):
        status, lines = run("--device", "emulated", "--plan", "minutes", "--seconds", "0", "--made-of", "these")
        self.assertEqual(status, 1)
        self.assertEqual((lines[0]["result"], lines[0]["made_of"]), ("begins", "these"))
        phases, left_out = [], []
        for line in lines[1:-1]:
            if line["check"] == "phase":
                phases.append(line["part"])
            else:
                self.assertEqual(line["result"], "left out: no time")
                left_out.append((phases[-1], line["check"]))
        self.assertEqual(phases, ["device", "hashes", "times", "baseline", "lanes", "checks", "profiles", "graphs", "two grids"])
        self.assertEqual(lines[-1]["left_out"], len(left_out))
        names = [name for _, name in left_out]
        self.assertEqual(len(names), len(set(names)))
        self.assertEqual(names[0], "device")
        self.assertEqual(names[-1], "capture/two_grids")
        self.assertLess(names.index("robot/g1/jm"), names.index("robot/g1/a"))
        kinds = list(dict.fromkeys((phase, name.split("/")[0]) for phase, name in left_out))
        self.assertEqual(kinds, [("device", "device"), ("hashes", "hash"), ("times", "robot"), ("baseline", "baseline"), ("lanes", "lanes"),
                                 *(("checks", kind) for kind in ("solver", "class", "form", "plan", "golden")), ("profiles", "ncu"),
                                 *(("graphs", kind) for kind in ("capture", "repeat", "sanitizer")), ("two grids", "capture")])
        self.assertEqual({name for name in names if name.startswith("hash/")},
                         {f"hash/{robot}/{form}" for robot in ("g1", "humanoid", "leap_hand", "piles") for form in ("jm", "a")})

    def test_a_phase_is_cut_where_the_plan_says(self):
        # Its own limit is hours away.
        status, lines = run("--device", "emulated", "--only", "self/hangs", "--patience", "100000", "--seconds", "10")
        self.assertEqual(status, 1)
        self.assertEqual([line["result"] for line in lines], ["right", "out of time", "wrong"])

    def test_the_emulated_device_follows_the_plan(self):
        with tempfile.TemporaryDirectory() as name:
            summary = pathlib.Path(name) / "summary.txt"
            status, lines = run("--device", "emulated", "--plan", "minutes", "--seconds", "100000", "--only", "device,hash/piles,robot/piles/jm,class/dense_tile",
                                "--summary", summary)
            self.assertEqual(status, 0, lines)
            text = summary.read_text().splitlines()
        timed = [line for line in lines if line["check"] == "robot/piles/jm" and line["result"] == "measured"]
        self.assertEqual([(line["tolerance"], line["start"]) for line in timed],
                         [(1e-4, "cold"), (1e-4, "warm"), (1e-6, "cold"), (1e-6, "warm")])
        self.assertEqual({line["answers"] for line in timed}, {"equal"})
        self.assertIn("5 checks right, 0 wrong", text[0])
        self.assertIn("device: emulated by the CPU", text)
        self.assertRegex(next(line for line in text if line.startswith("piles J M auto 1e-4: ")), r": 2 cold [0-9.]+, 2 warm [0-9.]+$")

    def test_a_summary_has_forty_lines_at_most(self):
        with tempfile.TemporaryDirectory() as name:
            summary = pathlib.Path(name) / "summary.txt"
            run("--device", "cpu", "--only", "self/talks,self/wrong", "--summary", summary)
            text = summary.read_text().splitlines()
        self.assertEqual(len(text), 40)
        self.assertEqual(text[1:3], ["WRONG self/wrong", "subject 0: 0, 60"])
        self.assertEqual(text[-1], "and 23 more")

    def test_a_line_is_there_before_its_check_has_ended(self):
        with tempfile.TemporaryDirectory() as name:
            out = pathlib.Path(name) / "results.jsonl"
            child = subprocess.Popen([PROGRAM, "--device", "cpu", "--only", "self/hangs", "--patience", "100000", "--out", out],
                                     stdout=subprocess.PIPE, text=True)
            try:
                self.assertEqual(child.stdout.readline(), "> self | before it hangs\n")
                self.assertEqual([line["part"] for line in lines_of(out)], ["before"])
                self.assertIsNone(child.poll())
            finally:
                child.kill()
                child.communicate()

    def test_the_baseline_has_the_librarys_answers(self):
        with tempfile.TemporaryDirectory() as name:
            robots = ["g1", "humanoid", "leap_hand"] if RECORDED.is_dir() else []
            if robots:
                subprocess.run([pathlib.Path(PROGRAM).parent / "pack_batches", name, *(RECORDED / f"{robot}.h5" for robot in robots)], check=True)
            status, lines = run("--device", "cpu", "--batches", name, "--only", "baseline/,hash/")
        self.assertEqual(status, 0, lines)
        judged = [(line["check"], line["part"]) for line in lines if line["result"] == "right" and line["check"] != "all"]
        self.assertEqual(judged, [(f"baseline/{robot}", f"answers {start}") for robot in [*robots, "walkers"] for start in ("cold", "warm")])
        hashed = [line for line in lines if line["check"].startswith("hash/") and "committed" in line]
        self.assertEqual(len(hashed), 6 * (len(robots) + 1))
        self.assertEqual({line["committed"] for line in hashed}, {"equal"})


class Pack(unittest.TestCase):
    """run.sh with a program that prints its arguments, and the manifest."""

    PROGRAM = """#!/bin/sh
[ "$1" = --list ] && exit 0
while [ $# -gt 0 ]; do
  case $1 in --out) out=$2 ;; --summary) summary=$2 ;; --made-of) sources=$2 ;; esac
  shift
done
echo "{\\"made_of\\": \\"$sources\\"}" >> "$out"
echo table > "$(dirname "$out")/ncu_velocity.csv"
echo begun
%s
echo "the end" | tee -a "$summary"
"""

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        self.pack, self.out = self.folder / "pack", self.folder / "out"

    def make(self, does=""):
        (self.pack / "batches").mkdir(parents=True)
        (self.pack / "gpu_first.xz").write_bytes(lzma.compress((self.PROGRAM % does).encode()))
        (self.pack / "hashes.csv").write_text("one,two,full,0x3\n")
        shutil.copy(ROOT / "tools" / "gpu_first" / "run.sh", self.pack)
        return pack_manifest.write(self.pack, ["a test"])

    def start(self, **options):
        return subprocess.Popen([self.pack / "run.sh", self.out], cwd="/", stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, **options)

    def archive(self):
        with tarfile.open(self.out / "all.tgz") as tar:
            return {member.name: tar.extractfile(member).read().decode() for member in tar.getmembers() if member.isfile()}

    def test_it_runs_anywhere_and_says_what_it_was_made_of(self):
        sources = self.make()
        child = self.start()
        said = child.communicate()[0]
        self.assertEqual(child.returncode, 0, said)
        self.assertEqual(said.splitlines()[-1], "the end")
        self.assertEqual(sorted(path.name for path in self.out.iterdir()), ["all.tgz", "results.jsonl", "summary.txt"])
        self.assertEqual(lines_of(self.out / "results.jsonl"), [{"made_of": sources}])
        self.assertEqual((self.out / "summary.txt").read_text(), "the end\n")
        self.assertEqual(sorted(self.archive()), ["all/checks.txt", "all/log.txt", "all/manifest.txt", "all/ncu_velocity.csv", "all/results.jsonl"])

    def test_results_are_packed_when_it_is_ended(self):
        sources = self.make("exec sleep 30")
        child = self.start()
        self.assertEqual(child.stdout.readline(), "begun\n")
        child.send_signal(signal.SIGTERM)
        child.communicate()
        self.assertEqual(child.returncode, 143)
        kept = self.archive()
        self.assertEqual(json.loads(kept["all/results.jsonl"]), {"made_of": sources})
        self.assertEqual(kept["all/log.txt"], "begun\n")

    def test_python_unpacks_where_there_is_no_xz(self):
        self.make()
        tools = self.folder / "bin"
        tools.mkdir()
        for tool in ("bash", "sh", "cat", "chmod", "cp", "dirname", "gzip", "ln", "mkdir", "mkfifo", "mktemp", "python3", "rm", "sed", "sha256sum",
                     "tail", "tar", "tee"):
            (tools / tool).symlink_to(pathlib.Path(sys.executable).resolve() if tool == "python3" else shutil.which(tool))
        child = self.start(env={"PATH": str(tools)})
        said = child.communicate()[0]
        self.assertEqual(child.returncode, 0, said)

    def test_a_damaged_pack_is_refused(self):
        self.make()
        (self.pack / "hashes.csv").write_text("one,two,full,0x4\n")
        child = self.start()
        said = child.communicate()[0]
        self.assertEqual(child.returncode, 2)
        self.assertIn("hashes.csv", said)
        self.assertIn("the pack is damaged", said)

    def test_a_pack_of_other_sources_is_refused(self):
        self.make()
        self.assertEqual(pack_manifest.check(self.pack), [])
        manifest = self.pack / "manifest.txt"
        text = manifest.read_text()
        name = "cuda/machine/engine.hpp"
        self.assertIn(f" {name}\n", text)
        manifest.write_text(text.replace(pack_manifest.digest(ROOT / name), "0" * 64))
        self.assertEqual(pack_manifest.check(self.pack), [f"{name} is another"])
        done = subprocess.run([ROOT / "scripts" / "gpu_check.sh", self.out], env={**os.environ, "STICTION_PACK": str(self.pack)},
                              capture_output=True, text=True, check=False)
        self.assertEqual(done.returncode, 1)
        self.assertIn(f"{name} is another", done.stderr)
        self.assertFalse(self.out.exists())
        manifest.write_text(text)
        done = subprocess.run([ROOT / "scripts" / "gpu_check.sh", self.out], env={**os.environ, "STICTION_PACK": str(self.pack)},
                              capture_output=True, text=True, check=False)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertTrue((self.out / "all.tgz").exists())

    def test_no_manifest_is_written_once_sources_have_changed(self):
        self.make()
        (self.pack / "manifest.txt").unlink()
        tool = [sys.executable, ROOT / "tools" / "gpu_first" / "pack_manifest.py"]
        sources = subprocess.run([*tool, "sources"], capture_output=True, text=True, check=True).stdout.strip()
        for given, status in (("0" * 16, 1), (sources, 0)):
            done = subprocess.run([*tool, "write", self.pack, "--sources", given], capture_output=True, text=True, check=False)
            self.assertEqual((done.returncode, (self.pack / "manifest.txt").exists()), (status, status == 0), done.stderr)

    def test_kernels_that_are_left_out_are_told_from_those_that_are_compiled(self):
        names = ["one/cuda_npgs.cu.o", "two/cuda_pgs.cu.o"]
        self.assertEqual(prebuilt_cuda.split(names, {"cuda_pgs"}), ([names[0]], [names[1]]))
        self.assertEqual(prebuilt_cuda.split(names, set()), (names, []))
        with self.assertRaisesRegex(SystemExit, "names cuda_nothing; there are cuda_npgs cuda_pgs"):
            prebuilt_cuda.split(names, {"cuda_nothing"})

    def test_no_kernel_that_auto_may_take_is_left_out(self):
        script = (ROOT / "scripts" / "pack_for_gpu.sh").read_text()
        left_out = re.search(r"STICTION_PACK_WITHOUT-([\w,]+)}", script).group(1).split(",")
        chain = "".join((ROOT / "core" / "job" / f"fallback_{name}.hpp").read_text() for name in ("chain", "order"))
        taken = set(re.findall(r"SolverKind::(\w+)", chain))
        self.assertLessEqual({"subspace", "jacobi"}, taken)
        self.assertEqual({name.removeprefix("cuda_") for name in left_out} & taken, set())

    def test_a_source_that_is_new_or_gone_is_named(self):
        root = self.folder / "root"
        (root / "core").mkdir(parents=True)
        (root / "CMakeLists.txt").write_text("project(x)")
        (root / "core" / "one.hpp").write_text("one")
        self.pack.mkdir()
        first = pack_manifest.write(self.pack, [], root)
        (root / "core" / "one.hpp").rename(root / "core" / "two.hpp")
        self.assertEqual(pack_manifest.check(self.pack, root), ["core/one.hpp is not here", "core/two.hpp is new"])
        self.assertNotEqual(pack_manifest.write(self.pack, [], root), first)
        self.assertEqual(pack_manifest.check(self.pack, root), [])


if __name__ == "__main__":
    unittest.main(verbosity=2)
