"""What a run was made on."""

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


def versions():
    return {"python": platform.python_version(), "numpy": numpy.__version__, "h5py": h5py.__version__,
            "system": f"{platform.system()} {platform.release()}"}
