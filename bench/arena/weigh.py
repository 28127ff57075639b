"""Runs a program and notes its peak resident memory [KiB] in a file: weigh.py FILE SECONDS PROGRAM ARGUMENT ...

Ends it after so many seconds of processor time, with exit status 124. Started as `python -S -E`, which keeps its own memory, the
least that it can report, at a few MiB.
"""

import os
import signal
import sys
import time

LATE = 124


def processor_seconds(process):
    with open(f"/proc/{process}/stat", encoding="ascii") as file:
        fields = file.read().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def main():
    limit, pause, late = float(sys.argv[2]), 1e-3, False
    child = os.fork()
    if child == 0:
        os.execvp(sys.argv[3], sys.argv[3:])
    while True:
        ended, status, usage = os.wait4(child, os.WNOHANG)
        if ended:
            break
        if not late and processor_seconds(child) > limit:
            os.kill(child, signal.SIGKILL)
            late = True
        time.sleep(pause)
        pause = min(2 * pause, 0.05)
    with open(sys.argv[1], "a", encoding="ascii") as file:
        file.write(f"{usage.ru_maxrss}\n")
    sys.exit(LATE if late else os.waitstatus_to_exitcode(status) % 256)


main()
