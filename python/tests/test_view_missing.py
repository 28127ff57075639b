"""Without Rerun, or viser, there is one sentence with the remedy, and the rest of the package works."""

import subprocess
import sys

import pytest
from conftest import DATA

SENTENCES = {"rerun": "stiction.view needs Rerun, which is not installed: pip install rerun-sdk",
             "viser": "stiction.view with viser needs viser, which is not installed: pip install viser"}


@pytest.mark.parametrize("hidden", ["None", "types.ModuleType('another')"], ids=["missing", "another_package_of_that_name"])
@pytest.mark.parametrize("name, suffix", [("rerun", ".rrd"), ("viser", ".html")])
def test_without_the_backend_the_remedy_is_said(tmp_path, name, suffix, hidden):
    program = f"""
import sys, types
sys.modules[{name!r}] = {hidden}
import stiction.view
try:
    stiction.view.Recorder({str(tmp_path / 'a') + suffix!r})
except ImportError as error:
    print(error)
print(stiction.view.main([{str(DATA / 'pile.h5')!r}, "-o", {str(tmp_path / 'b') + suffix!r}]))
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout == f"{SENTENCES[name]}\n2\n" and done.stderr == f"stiction.view: {SENTENCES[name]}\n"
    assert not list(tmp_path.iterdir())
