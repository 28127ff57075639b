"""Runs of a program with a limit on time and a look at its memory."""

import os
import pathlib
import signal
import subprocess
import sys

WEIGH = pathlib.Path(__file__).with_name("weigh.py")
PATIENCE = 4  # wall clock over the limit in seconds: other programs may run
LATE = 124  # weigh.py's exit status


def weighed(command, notes, limit=1e9):
    """`command` under weigh.py, with that many seconds of processor time."""
    return [sys.executable, "-S", "-E", str(WEIGH), str(notes), repr(limit), *map(str, command)]


def peak(notes):
    """The largest peak [MiB] noted so far, or None."""
    path = pathlib.Path(notes)
    return max(map(int, path.read_text().split())) / 1024 if path.exists() and path.stat().st_size else None


def run(command, limit, environment=None):
    """(exit status, or None when the time was up; its stderr). `limit` is of the wall clock, times PATIENCE."""
    process = subprocess.Popen([str(word) for word in command], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
                               env=environment, start_new_session=True)
    try:
        message = process.communicate(timeout=PATIENCE * limit)[1]
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
        return None, ""
    return None if process.returncode == LATE else process.returncode, message


def last_line(text):
    lines = text.strip().splitlines()
    return lines[-1][:120] if lines else "no message"
