"""An archive of prebuilt kernels is taken where it fits the sources, and refused where it does not."""

import hashlib
import io
import pathlib
import shutil
import subprocess
import sys
import tarfile
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
PROJECT = f"""cmake_minimum_required(VERSION 3.22)
project(taken LANGUAGES NONE)
include({ROOT}/cmake/prebuilt_cuda.cmake)
file(WRITE "${{PROJECT_BINARY_DIR}}/made.cu" "made")
stiction_read_prebuilt_cuda("${{STICTION_PREBUILT_CUDA}}")
stiction_prebuilt_objects(objects native/one.cu)
message(STATUS "nvcc ${{STICTION_PREBUILT_NVCC}}, objects ${{objects}}")
"""
SOURCES = {"core/one.hpp": b"one", "@build@/made.cu": b"made"}


def digest(data):
    return hashlib.sha256(data).hexdigest()


@unittest.skipIf(shutil.which("cmake") is None, "no cmake")
class Prebuilt(unittest.TestCase):
    def configure(self, sources=SOURCES, head="nvcc 13.0.88\narchitectures 90\n", objects=("one.cu.o",), damage=b""):
        """(exit status, output) of a project that takes an archive of these."""
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)
            (folder / "core").mkdir()
            (folder / "core" / "one.hpp").write_bytes(b"one")
            (folder / "CMakeLists.txt").write_text(PROJECT)
            text = head + "".join(f"source {digest(data)} {path}\n" for path, data in sources.items())
            text += "".join(f"object {digest(b'object')} {path}\n" for path in objects)
            with tarfile.open(folder / "kernels.tar.xz", "w:xz") as tar:
                for path, data in [("manifest.txt", text.encode()), *((path, b"object" + damage) for path in objects)]:
                    info = tarfile.TarInfo(path)
                    info.size = len(data)
                    tar.addfile(info, io.BytesIO(data))
            done = subprocess.run(["cmake", "-S", name, "-B", f"{name}/build", f"-DSTICTION_PREBUILT_CUDA={name}/kernels.tar.xz"],
                                  capture_output=True, text=True, check=False)
            return done.returncode, done.stdout + done.stderr

    def test_an_archive_of_these_sources_is_taken(self):
        status, text = self.configure()
        self.assertEqual(status, 0, text)
        self.assertRegex(text, r"nvcc 13\.0\.88, objects \S*/prebuilt_cuda/one\.cu\.o")

    def test_a_source_that_has_changed_is_named(self):
        for path in SOURCES:
            status, text = self.configure({**SOURCES, path: b"another"})
            self.assertNotEqual(status, 0)
            self.assertIn(path, text)
            self.assertIn("made of other sources", " ".join(text.split()))

    def test_a_source_that_is_gone_is_named(self):
        status, text = self.configure({**SOURCES, "core/gone.hpp": b""})
        self.assertNotEqual(status, 0)
        self.assertIn("core/gone.hpp", text)

    def test_an_object_that_is_not_there_is_named(self):
        status, text = self.configure(objects=("two.cu.o",))
        self.assertNotEqual(status, 0)
        self.assertIn("one.cu.o", text)

    def test_a_damaged_object_is_named(self):
        status, text = self.configure(damage=b"!")
        self.assertNotEqual(status, 0)
        self.assertIn("one.cu.o", text)

    def test_an_archive_without_a_manifest_is_refused(self):
        status, text = self.configure(head="")
        self.assertNotEqual(status, 0)
        self.assertIn("no manifest", " ".join(text.split()))


if __name__ == "__main__":
    sys.exit(unittest.main(verbosity=2))
