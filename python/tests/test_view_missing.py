"""Without Rerun there is one sentence with the remedy, and the rest of the package works."""

import subprocess
import sys

import pytest
from conftest import DATA

SENTENCE = "stiction.view needs Rerun, which is not installed: pip install rerun-sdk"


@pytest.mark.parametrize("hidden", ["sys.modules['rerun'] = None", "sys.modules['rerun'] = types.ModuleType('rerun')"],
                         ids=["missing", "another_package_of_that_name"])
def test_without_rerun_the_remedy_is_said(tmp_path, hidden):
    program = f"""
import sys, types
{hidden}
import stiction.view
try:
    stiction.view.Recorder({str(tmp_path / 'a.rrd')!r})
except ImportError as error:
    print(error)
print(stiction.view.main([{str(DATA / 'pile.h5')!r}, "-o", {str(tmp_path / 'b.rrd')!r}]))
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout == f"{SENTENCE}\n2\n" and done.stderr == f"stiction.view: {SENTENCE}\n"
    assert not list(tmp_path.iterdir())
