#!/usr/bin/env python3
"""Checks the includes of each folder, and the few words that belong in one place only.

Usage: lint_includes.py [--root DIR] [--self-test]

The table below is the architecture: one row per folder, with the includes allowed to its files. A file may include
something else, or use a word that a rule keeps out of its folder. It is then reported as `file:line: sentence` and the
exit status is 1. Comments and string literals are not read. A template (*.in), of which CMake makes a source for each
solver, is checked as that source. A name in @s that it includes is one of the folder before it.
"""

import pathlib
import re
import sys

import lint_tools

SOURCE_SUFFIXES = {".hpp", ".cpp", ".cu", ".cuh", ".h", ".inc"}
SOURCE_FOLDERS = ["core", "cuda", "cpu_fallback", "c_api", "distributed", "cli", "scenes", "bench", "examples", "tools", "tests", "python"]

STD_ANY = "std"
# Headers of the standard library for algorithms and Teams: types and compile-time facts, no arithmetic.
STD_TYPES = {"array", "concepts", "cstddef", "cstdint", "limits", "tuple", "type_traits", "utility"}

PUBLIC = "core/include/stiction"
IO_PUBLIC = "core/io/include/stiction"
# Folders of kernels and machines.
KERNEL = [PUBLIC, "core/base", "core/job", "core/team", "core/algorithm"]
PLANS = ["core/plan/plan.hpp", "core/plan/body_plan.hpp"]
MACHINE = [*KERNEL, *PLANS, "core/machine"]

# Rooms of core/algorithm, in the order of a solve, with the includes allowed to each. No room includes one that is
# further down, so there are no cycles.
ALGORITHM = {
    "problem": [],
    "system": ["problem"],
    "sweep": ["problem", "system"],
    "residual": ["problem", "system", "sweep"],
    "load": ["problem", "system", "residual"],
    "linear": ["problem", "system"],
    "newton": ["problem"],
    "solver": ["problem", "system", "sweep", "residual", "linear", "newton"],
    "driver": ["problem", "system", "sweep", "residual", "load", "solver"],
    "pack": ["problem", "system", "residual", "load", "driver"],
    "rigid": ["problem", "system", "sweep", "residual", "load", "linear", "driver", "pack", "newton"],
    "plan": [],
    "collision": ["rigid", "plan"],
    "jacobian": [],
    "derivative": ["problem", "system", "sweep", "residual", "linear", "pack", "jacobian", "velocity"],
    "unrolled": ["problem", "system", "sweep", "residual", "load", "driver", "derivative"],
    "velocity": ["problem", "system", "sweep", "residual", "load", "linear", "jacobian", "newton"],
    "warm_start": ["plan"],
    # Robots are in lanes of Newton's method in velocities, and their bodies have the worlds' vectors and axes.
    "articulated": ["problem", "system", "sweep", "residual", "load", "linear", "jacobian", "newton", "velocity", "rigid", "collision"],
}


class Row:
    """One folder's permissions: project folders or files, standard headers, third-party prefixes."""

    def __init__(self, folder, project, std=STD_ANY, foreign=()):
        self.folder = folder
        self.project = project
        self.std = std
        self.foreign = foreign


# Longest folder first: the first row that contains a file is the one that speaks.
TABLE = [
    Row(PUBLIC, [PUBLIC]),
    Row("core/base", [PUBLIC, "core/base"], foreign=("arm_neon.h", "immintrin.h", "xmmintrin.h")),
    Row("core/team", [PUBLIC, "core/base", "core/team"], std=STD_TYPES),
    *(Row(f"core/algorithm/{room}", [PUBLIC, "core/base", "core/job", "core/team", f"core/algorithm/{room}"] +
          [f"core/algorithm/{other}" for other in below], std=STD_TYPES) for room, below in ALGORITHM.items()),
    Row("core/job", [PUBLIC, "core/base", "core/job"]),
    # Orderings come from libraries; they are integers, so no rounding comes with them.
    Row("core/plan/library_orderings.cpp", [PUBLIC, "core/base", "core/plan"],
        foreign=("Eigen/", "amd.h", "metis.h")),
    Row("core/plan", [PUBLIC, "core/base", "core/job", "core/plan"]),
    Row("core/machine", [PUBLIC, "core/base", "core/job", "core/plan", "core/machine"]),
    Row("core/graph", [PUBLIC, "core/graph", "core/base/fp_env.hpp"]),
    # Extremes of a tridiagonal matrix, whichever matrix it comes from.
    Row("core/runtime/analysis", [PUBLIC, "core/base", "core/job", "core/plan", "core/machine", "core/runtime",
                                  "core/graph/tridiagonal.hpp"]),
    Row("core/runtime", [PUBLIC, "core/base", "core/job", "core/plan", "core/machine", "core/runtime"]),
    Row("core/facade", [PUBLIC, "core/base", "core/job", "core/plan", "core/machine", "core/runtime", "core/facade"]),
    # Checks of a hostile file before HDF5 reads it.
    Row("core/io/guard", [PUBLIC, "core/io/guard"], foreign=("hdf5.h", "H5")),
    Row("core/io", [PUBLIC, "core/io", "core/base/fp_env.hpp"], foreign=("hdf5.h", "H5", "fcntl.h", "unistd.h")),
    # The rooms of the two machines; the folders themselves hold no sources.
    Row("cuda/api", [PUBLIC, "core/base", "core/job", "cuda/api"]),
    Row("cuda/kernels", [*KERNEL, "cuda/api", "cuda/kernels"]),
    Row("cuda/machine", [*MACHINE, "cuda/api", "cuda/kernels", "cuda/machine"]),
    Row("cuda/emulated", [*MACHINE, "cuda/api", "cuda/kernels", "cuda/machine", "cuda/emulated"], foreign=("dlfcn.h", "pthread.h", "sys/mman.h")),
    Row("cuda/native", [*MACHINE, "cuda/api", "cuda/kernels", "cuda/machine", "cuda/native"],
        foreign=("cuda_runtime", "cooperative_groups", "thrust/", "cub/", "nvtx3/")),
    Row("cuda", [PUBLIC]),
    Row("cpu_fallback/threads", [PUBLIC, "core/base", "core/team", "cpu_fallback/threads"],
        foreign=("tbb/", "pthread.h", "sched.h", "unistd.h")),
    # Tables of functions that an instruction set has. A pack's driver is given some, and is compiled into kernels.
    Row("cpu_fallback/tables", [*KERNEL, "cpu_fallback/threads", "cpu_fallback/tables"], foreign=("valgrind/",)),
    Row("cpu_fallback/pack", [*KERNEL, *PLANS, "cpu_fallback/tables", "cpu_fallback/pack"]),
    Row("cpu_fallback/kernels", [*KERNEL, "cpu_fallback/threads", "cpu_fallback/tables", "cpu_fallback/pack", "cpu_fallback/kernels"]),
    Row("cpu_fallback/machine", [*MACHINE, "cpu_fallback"]),
    Row("cpu_fallback", [PUBLIC]),
    Row("c_api/include", ["c_api/include"], std=(), foreign=("stddef.h", "stdint.h")),  # C
    Row("c_api", [PUBLIC, IO_PUBLIC, "c_api"]),
    # Ranks: messages, pieces of plans, parts of worlds; a program beside the command line.
    Row("distributed/transport", [PUBLIC, "distributed/transport"], foreign=("mpi.h", "sched.h")),
    Row("distributed/solve", [*KERNEL, *PLANS, "distributed/transport", "distributed/solve"]),
    # A world over ranks: parts of its model, and the stages of a step that the CPU's worlds run.
    Row("distributed/world", [*MACHINE, "core/plan/colored_body_plan.hpp", "core/runtime/world/world_model.hpp",
                              "cpu_fallback/tables/isa.hpp", "distributed/transport", "distributed/solve", "distributed/world"]),
    Row("distributed/subdomains", [*KERNEL, *PLANS, "distributed/transport", "distributed/solve", "distributed/subdomains"]),
    # Newton's method over ranks plans factors of parts of its matrix.
    Row("distributed/newton", [*KERNEL, "core/plan", "distributed/transport", "distributed/solve",
                               "distributed/subdomains", "distributed/newton"]),
    # Checkpoints that ranks write together have the layout that one process writes.
    Row("distributed/program/shared_file.cpp", [PUBLIC, IO_PUBLIC, "core/io/checkpoint_layout.hpp", "distributed"],
        foreign=("fcntl.h", "hdf5.h", "mpi.h", "unistd.h")),
    Row("distributed/program/whole_checkpoint.cpp",
        [PUBLIC, IO_PUBLIC, "core/io/checkpoint_layout.hpp", "distributed"]),
    Row("distributed/program", [PUBLIC, IO_PUBLIC, "scenes", "cli", "distributed"],
        foreign=("CLI/", "fmt/", "nlohmann/")),
    Row("scenes", [PUBLIC, "scenes", "core/base/fp_env.hpp", IO_PUBLIC]),
    # Programs around solvers of others; they know nothing of this project.
    Row("bench/arena", ["bench/arena"],
        foreign=("Bullet", "dart/", "signal.h", "sys/", "time.h", "unistd.h")),
    Row("bench/support", [PUBLIC, IO_PUBLIC, "bench/support", "scenes", "core/job/size_class.hpp"],
        foreign=("benchmark/", "Eigen/")),
    # Its threads are made slow by a team of its own, so that the library has no hook for that.
    Row("bench/programs/bench_asynchronous.cpp", [*KERNEL, *PLANS, "cpu_fallback/threads", "scenes", "bench"]),
    Row("bench/programs", [PUBLIC, IO_PUBLIC, "scenes", "bench"], foreign=("benchmark/",)),
    Row("examples", [PUBLIC, IO_PUBLIC]),
    Row("cli", [PUBLIC, IO_PUBLIC, "core/plan", "scenes", "cli"],
        foreign=("CLI/", "fmt/", "nlohmann/", "dlfcn.h", "spawn.h", "unistd.h", "sys/", "H5", "hdf5.h")),
    Row("python", [PUBLIC, IO_PUBLIC, "python", "cpu_fallback/threads/thread_pool.hpp"], foreign=("nanobind/", "xla/ffi/")),
]
# tests and tools outside cli may include anything; the word rules still bind them.

STANDARD_HEADER = re.compile(r"^[a-z_0-9]+$")
INCLUDE = re.compile(r'^\s*#\s*include\s*([<"])([^>"]+)[>"]')

# (word, folders or files it is kept out of, folders or files it is allowed in, why)
WORDS = [
    (r"__CUDACC__|__CUDA_ARCH__|__NVCC__", [""], ["core/include/stiction/config.hpp", "core/base"],
     "which compiler is reading is asked in core/include/stiction/config.hpp and core/base only"),
    (r"threadIdx|blockIdx|blockDim|gridDim|__syncthreads|__syncwarp|__shfl\w*|__ballot\w*|\batomic\w*|std::atomic|"
     r"\bclock(64)?\s*\(", ["core/algorithm", "core/base", "core/job", "core/plan"], [],
     "an algorithm is written in phases over a Team and never sees a thread, an atomic or a clock"),
    (r"std::(f?min|f?max|clamp|sqrt|fma|abs|fabs|pow|hypot|reduce|accumulate)\b|\b(fminf?|fmaxf?|rsqrtf?|hypotf?|powf?|"
     r"sinf?|cosf?|tanf?|expf?|logf?)\s*\(", ["core/algorithm", "core/team"], [],
     "every rounding and selection goes through core/base/real.hpp"),
    (r"std::(f?min|f?max|clamp)\b", ["core/base", "core/job", "core/runtime", "core/facade", "core/machine", "core/plan", "cuda", "cpu_fallback"], [],
     "counts are compared by core/base/extents.hpp, numbers by core/base/real.hpp: the library's take NaN by position"),
    (r"\b(fma_|sqrt_|div_|project_\w+)\s*\(", ["cuda", "cpu_fallback", "c_api", "distributed"], [],
     "a machine holds a Team, memory and launches; arithmetic belongs in core/algorithm"),
    (r"\blong double\b|_Float16|__float128", ["core/algorithm", "core/base", "core/job", "core/team", "cuda", "cpu_fallback", "distributed"], [],
     "float and double are the two precisions whose bits are promised"),
]


def strip_comments(text, keep_strings=False):
    """Blanks comments and, unless they are kept, string contents, keeping line numbers and #include paths."""
    out = []
    i, n = 0, len(text)
    while i < n:
        if text.startswith("//", i):
            while i < n and text[i] != "\n":
                i += 1
        elif text.startswith("/*", i):
            end = text.find("*/", i + 2)
            end = n if end < 0 else end + 2
            out.append("\n" * text.count("\n", i, end))
            i = end
        elif text[i] == '"' and not re.search(r"#\s*include\s*$", text[text.rfind("\n", 0, i) + 1:i]):
            raw = re.search(r'R$', text[max(0, i - 1):i])
            if raw:
                tag = re.match(r'"([^()\\\s]*)\(', text[i:])
                close = ")" + (tag.group(1) if tag else "") + '"'
                end = text.find(close, i)
                end = n if end < 0 else end + len(close)
            else:
                end = i + 1
                while end < n and text[end] not in '"\n':
                    end += 2 if text[end] == "\\" else 1
                end += 1
            out.append(text[i:end] if keep_strings else '""' + "\n" * text.count("\n", i, min(end, n)))
            i = end
        else:
            out.append(text[i])
            i += 1
    return "".join(out)


def inside(path, folder):
    """True if path (relative, posix) is the file `folder` or lies under the folder `folder` ('' is everything)."""
    return folder == "" or path == folder or path.startswith(folder + "/")


def row_of(path):
    return next((row for row in TABLE if inside(path, row.folder)), None)


def resolve(root, path, included):
    """The project path an include names, or None if it is not one of ours."""
    beside = pathlib.PurePosixPath(path).parent / included
    candidates = [str(beside), included]
    if included.startswith("stiction/"):
        candidates += ["core/include/" + included, "core/io/include/" + included]
    candidates.append("c_api/include/" + included)
    for candidate in candidates:
        if "@" in candidate:
            if (root / candidate[:candidate.index("@")]).is_dir():
                return candidate
        elif (root / candidate).is_file() or (root / (candidate + ".in")).is_file():
            return str(pathlib.PurePosixPath(*(root / candidate).resolve().relative_to(root.resolve()).parts))
    return None


def check_include(root, path, included):
    """The sentence to report, or None."""
    row = row_of(path)
    target = resolve(root, path, included)
    if target is None and re.match(r"(cuda|cuda_runtime\w*|cuda_\w+|device_launch\w+)\.h$", included):
        if not any(inside(path, folder) for folder in ("cuda/native", "tests/twin", "tools/gpu_first")):
            return f"includes <{included}>; only cuda/native may"
        return None
    if row is None:
        return None
    if target is not None:
        if any(inside(target, allowed) for allowed in row.project):
            return None
        return f"{row.folder} may not include {target}; it may include {', '.join(row.project)}"
    if any(included.startswith(prefix) for prefix in row.foreign):
        return None
    if STANDARD_HEADER.match(included):
        if row.std == STD_ANY or included in row.std:
            return None
        return f"{row.folder} may not include <{included}>; of the standard library it may use {', '.join(sorted(row.std))}"
    if re.match(r"(stiction|core|cuda|cpu_fallback|bench|tools)/", included):
        return f"includes {included}, which does not exist"
    return f"{row.folder} may not depend on <{included}>"


def check_file(root, path):
    """Sentences for one file."""
    text = (root / path).read_text(encoding="utf-8")
    code = strip_comments(text)
    found = []
    if path.removesuffix(".in").endswith((".hpp", ".cuh", ".h")) and "#pragma once" not in code:
        found.append((1, "a header begins with #pragma once"))
    for number, line in enumerate(code.splitlines(), start=1):
        include = INCLUDE.match(line)
        if include:
            problem = check_include(root, path, include.group(2))
            if problem:
                found.append((number, problem))
            continue
        for word, kept_out, allowed, why in WORDS:
            if not any(inside(path, folder) for folder in kept_out) or any(inside(path, a) for a in allowed):
                continue
            match = re.search(word, line)
            if match:
                found.append((number, f"uses '{match.group(0).strip()}': {why}"))
    return [f"{path}:{number}: {sentence}" for number, sentence in found]


def sources(root):
    for folder in SOURCE_FOLDERS:
        for file in sorted((root / folder).rglob("*")):
            if pathlib.PurePath(file.name.removesuffix(".in")).suffix in SOURCE_SUFFIXES and file.is_file():
                yield file.relative_to(root).as_posix()


def check_tree(root):
    problems = []
    count = 0
    for path in sources(root):
        count += 1
        problems += check_file(root, path)
    return count, problems


def self_test():
    """Plants one violation of every rule in a small tree: each must be found, and the clean tree must be clean."""
    clean = {
        "core/include/stiction/config.hpp": "#pragma once\n#if defined(__CUDACC__)\n#endif\n",
        "core/include/stiction/types.hpp": '#pragma once\n#include <cstdint>\n#include "stiction/config.hpp"\n',
        "core/base/real.hpp": '#pragma once\n#include <cmath>\n#include "stiction/types.hpp"\n#ifdef __CUDA_ARCH__\n#endif\n',
        "core/team/phases.hpp": '#pragma once\n#include "core/base/real.hpp"\n',
        "core/algorithm/solver/pgs.hpp": '#pragma once\n#include <cstdint>\n#include "core/team/phases.hpp"\n'
                                  '// an atomic, std::min and threadIdx in a comment are fine\n',
        "core/algorithm/driver/solve_environment.hpp": '#pragma once\n#include "core/algorithm/solver/pgs.hpp"\n',
        "core/plan/plan.hpp": '#pragma once\n#include <vector>\n#include "stiction/types.hpp"\n',
        "core/plan/library_orderings.cpp": '#include <Eigen/OrderingMethods>\n#include <amd.h>\n#include <metis.h>\n',
        "core/machine/contact_machine.hpp": '#pragma once\n#include "core/plan/plan.hpp"\n',
        "core/runtime/check/expect.hpp": "#pragma once\n",
        "core/facade/overlap.hpp": "#pragma once\n",
        "core/facade/solver.cpp": '#include "core/machine/contact_machine.hpp"\nconst char* s = "threadIdx, cuda_runtime.h";\n',
        "core/io/include/stiction/io.hpp": '#pragma once\n#include "stiction/types.hpp"\n',
        "core/io/read.cpp": '#include <hdf5.h>\n#include "stiction/io.hpp"\n',
        "cuda/native/pgs.cu": '#include <cuda_runtime.h>\n#include "core/algorithm/solver/pgs.hpp"\n',
        "cpu_fallback/kernels/pgs.cpp": '#include "core/algorithm/solver/pgs.hpp"\n',
        "cpu_fallback/kernels/solver.cpp.in": '#include "core/algorithm/solver/@header@"\n',
        "cpu_fallback/threads/thread_team.hpp": "#pragma once\n",
        "cpu_fallback/machine/contact_machine.cpp": '#include "cpu_fallback/tables/isa.hpp"\n',
        "cpu_fallback/tables/isa.hpp": '#pragma once\n#include "cpu_fallback/threads/thread_team.hpp"\n',
        "cuda/api/device_api.hpp": "#pragma once\n",
        "cuda/machine/engine.cpp": '#include "cuda/api/device_api.hpp"\n',
        "c_api/include/stiction.h": '#pragma once\n#include <stdint.h>\n#include "kinds.h"\n',
        "c_api/include/kinds.h.in": "#pragma once\n",
        "c_api/solver.cpp": '#include <memory>\n#include "stiction.h"\n#include "stiction/types.hpp"\n',
        "examples/hello.cpp": '#include "stiction/types.hpp"\n',
        "cli/main.cpp": '#include <CLI/CLI.hpp>\n#include "core/plan/plan.hpp"\n#include "stiction/io.hpp"\n',
    }
    planted = [
        ("core/include/stiction/types.hpp", '#include "core/base/real.hpp"'),
        ("core/base/real.hpp", '#include "core/algorithm/solver/pgs.hpp"'),
        ("core/team/phases.hpp", "#include <algorithm>"),
        ("core/algorithm/solver/pgs.hpp", '#include "core/algorithm/driver/solve_environment.hpp"'),
        ("core/algorithm/solver/pgs.hpp", "#include <cmath>"),
        ("core/algorithm/solver/pgs.hpp", '#include "core/machine/contact_machine.hpp"'),
        ("core/algorithm/solver/pgs.hpp", "int i = threadIdx.x;"),
        ("core/algorithm/solver/pgs.hpp", "std::atomic<int> n;"),
        ("core/algorithm/solver/pgs.hpp", "float m = std::max(a, b);"),
        ("core/algorithm/solver/pgs.hpp", "#ifdef __CUDA_ARCH__"),
        ("core/plan/plan.hpp", '#include "core/machine/contact_machine.hpp"'),
        ("core/plan/plan.hpp", "#include <Eigen/OrderingMethods>"),
        ("core/plan/library_orderings.cpp", "#include <boost/graph/adjacency_list.hpp>"),
        ("core/facade/solver.cpp", '#include "cpu_fallback/threads/thread_team.hpp"'),
        ("core/facade/solver.cpp", "#include <cuda_runtime.h>"),
        ("core/facade/solver.cpp", '#include "core/algorithm/solver/pgs.hpp"'),
        ("core/runtime/check/expect.hpp", '#include "core/facade/overlap.hpp"'),
        ("core/io/read.cpp", '#include "core/machine/contact_machine.hpp"'),
        ("cuda/native/pgs.cu", '#include "cpu_fallback/threads/thread_team.hpp"'),
        ("cuda/native/pgs.cu", "x = fma_(a, b, c);"),
        ("cpu_fallback/kernels/pgs.cpp", "rows = std::min(rows, most);"),
        ("cpu_fallback/kernels/pgs.cpp", '#include "cuda/native/pgs.cu"'),
        ("cpu_fallback/kernels/solver.cpp.in", '#include "core/runtime/@header@"'),
        ("cpu_fallback/kernels/solver.cpp.in", '#include "no_such/@header@"'),
        ("cpu_fallback/kernels/solver.cpp.in", "x = fma_(a, b, c);"),
        ("cpu_fallback/kernels/pgs.cpp", "#include <cuda_runtime_api.h>"),
        ("cpu_fallback/kernels/pgs.cpp", "#include <Eigen/Dense>"),
        ("cpu_fallback/threads/thread_team.hpp", '#include "cpu_fallback/tables/isa.hpp"'),
        ("cpu_fallback/tables/isa.hpp", '#include "core/machine/contact_machine.hpp"'),
        ("cuda/machine/engine.cpp", "#include <cuda_runtime_api.h>"),
        ("cuda/machine/engine.cpp", '#include "cuda/native/pgs.cu"'),
        ("cuda/api/device_api.hpp", '#include "core/algorithm/solver/pgs.hpp"'),
        ("c_api/include/stiction.h", '#include "stiction/types.hpp"'),
        ("c_api/include/stiction.h", "#include <cstdint>"),
        ("c_api/solver.cpp", '#include "core/machine/contact_machine.hpp"'),
        ("examples/hello.cpp", '#include "core/base/real.hpp"'),
        ("examples/hello.cpp", '#include "stiction/no_such.hpp"'),
        ("cli/main.cpp", '#include "core/algorithm/solver/pgs.hpp"'),
    ]
    return lint_tools.test_planted(check_tree, clean, [
        *((path, line + "\n", f"{path}:{clean[path].count(chr(10)) + 1}:") for path, line in planted),
        ("core/team/other.hpp", "struct A;\n", "core/team/other.hpp:1: a header begins with #pragma once")])


if __name__ == "__main__":
    sys.exit(lint_tools.run_check(__doc__, check_tree, self_test))
