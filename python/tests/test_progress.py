"""Bars of progress: on a terminal alone, and no bit depends on them."""

import fcntl
import importlib.util
import os
import pty
import struct
import subprocess
import sys
import termios

import pytest
import worlds

from stiction.monitor import Progress

PROGRAM = """
import sys
{before}
from stiction.monitor import Progress
bar = Progress(range(40), title="rollout", unit="step"{option})
for i in bar:
    if i == 20:
        bar.print("half of it")
print("shown" if bar.shown else "over")
"""


def run(before="", option="", terminal=True):
    """(stdout, stderr) of the program; stderr is a terminal or a pipe."""
    program = [sys.executable, "-c", PROGRAM.format(before=before, option=option)]
    if not terminal:
        done = subprocess.run(program, capture_output=True, text=True, check=True)
        return done.stdout, done.stderr
    leader, follower = pty.openpty()
    fcntl.ioctl(follower, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))
    done = subprocess.Popen(program, stdout=subprocess.PIPE, stderr=follower, text=True)
    os.close(follower)
    stdout, pieces = done.communicate()[0], []
    try:
        while piece := os.read(leader, 65536):
            pieces.append(piece)
    except OSError:  # Linux's error at the end of a terminal
        pass
    os.close(leader)
    assert done.returncode == 0
    return stdout, b"".join(pieces).decode()


def test_a_terminal_gets_a_bar():
    if importlib.util.find_spec("tqdm") is None:
        pytest.skip("bars of progress are NOT tested: pip install tqdm")
    stdout, stderr = run()
    assert "rollout" in stderr and "40/40" in stderr and stdout == "half of it\nover\n"


@pytest.mark.parametrize("how", [{"terminal": False}, {"option": ", quiet=True"},
                                 {"before": "sys.modules['tqdm'] = None"}, {"before": "sys.stderr = None"}])
def test_logs_and_quiet_calls_get_none(how):
    assert run(**how) == ("half of it\nover\n", "")


def test_without_a_bar_items_and_counts_pass_through(capsys):
    assert list(Progress(iter("abc"), quiet=True)) == ["a", "b", "c"]
    with Progress(total=3, quiet=True) as bar:
        bar.update(2)
        assert not bar.shown
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize("count", [0, 1, 7, 251])
def test_a_rollout_with_progress_has_the_bits_of_one_without(count):
    with_bar, without = worlds.started(envs=2), worlds.started(envs=2)
    with_bar.step(count=count, progress=True)
    without.step(count=count)
    assert with_bar.hash() == without.hash()
    assert with_bar.status.tobytes() == without.status.tobytes()
    assert with_bar.contacts().impulse.tobytes() == without.contacts().impulse.tobytes()
