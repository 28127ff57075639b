"""Description of the machine of a run, and a stand-in for another machine."""

import pathlib
import platform
import re

import h5py
import numpy


def processor():
    """Model and number of processors, as the system says."""
    path = pathlib.Path("/proc/cpuinfo")
    text = path.read_text(encoding="utf-8") if path.exists() else ""
    model = re.search(r"^model name[^:]*: (.*)$", text, re.M)
    count = len(re.findall(r"^processor\s*:", text, re.M))
    return f"{model.group(1).strip()}, {count} processors" if model else platform.processor() or platform.machine()


# Variables read by libraries that choose their code by the processor: with these they choose code without AVX.
# Compiled code that does not choose is the same.
OLDER = {"STICTION_ISA": "baseline", "OPENBLAS_CORETYPE": "Nehalem", "MKL_ENABLE_INSTRUCTIONS": "SSE4_2",
         "NPY_DISABLE_CPU_FEATURES": "X86_V3 X86_V4 AVX512_ICL AVX512_SPR",
         "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX512F,-AVX2_Usable,-AVX2,-FMA_Usable,-FMA,-FMA4"}
OLDER_XLA = "--xla_cpu_max_isa=SSE4_2"


def versions():
    return {"python": platform.python_version(), "numpy": numpy.__version__, "h5py": h5py.__version__,
            "system": f"{platform.system()} {platform.release()}"}
