"""Common to all other solvers: each runs in a process of its own (worker.py) and answers by a file."""

import os
import pathlib
import pickle
import select
import signal
import sys
import time

import answer_file
import numpy as np
import processes
from machine import OLDER, OLDER_XLA

HERE = pathlib.Path(__file__).resolve().parent
TIGHTER, LEAST_TOLERANCE = [1, 1e-2, 1e-4, 1e-6, 1e-8], 1e-16  # a peer stops by another measure than the judge's
TURNS, TURNS_SECONDS = 5, 0.05  # a solve is done again while all of its turns are shorter than that; the shortest counts


class Peer:
    given, version, has_threads = "A", "", False
    takes_boxes = False  # boxed friction

    def prepare(self, folder, clock):
        """None, or why it cannot run; its compiled files lie in `folder`."""
        raise NotImplementedError

    def refuses(self, problems):
        """None, or why the set is none for this solver: another law, other cones."""
        raise NotImplementedError

    def settings(self, goal):
        return [float(f"{goal * factor:.3g}") for factor in TIGHTER if goal * factor >= 0.99 * LEAST_TOLERANCE]

    def load(self):
        """Imports its packages; their memory is not the solve's."""

    def answer(self, path, law, setting, seconds, folder):
        """In the worker: an Answer."""
        raise NotImplementedError

    def solve(self, path, law, setting, seconds, folder, threads=1, repeat=3, older=False):
        import h5py

        with h5py.File(path) as batch:
            rows, count = len(batch["b"]), len(batch["env_row_ptr"]) - 1
        out = pathlib.Path(folder, "peer_answer.h5")
        out.unlink(missing_ok=True)
        limit = max(5.0, 3 * seconds * count)
        environment = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1",
                       "XLA_FLAGS": "--xla_cpu_multi_thread_eigen=false", "JAX_PLATFORMS": "cpu"}
        if older:
            environment |= {**OLDER, "XLA_FLAGS": f"{environment['XLA_FLAGS']} {OLDER_XLA}"}
        command = [sys.executable, HERE / "worker.py", self.name, path, law, repr(setting), repr(seconds), folder, out]
        status, message = processes.run(command, limit, environment)
        if status == 0 and out.exists():
            return answer_file.read(out, rows, count)
        note = f"no answer in {limit:g} s" if status is None else processes.last_line(message)
        return answer_file.Answer(np.full(rows, np.nan), late=status is None, note=note)


def shortest(call, clock=time.process_time):
    """(result of the call, seconds of the shortest turn)."""
    turns = []
    while len(turns) < TURNS and sum(turns) < TURNS_SECONDS:
        begin = clock()
        found = call()
        turns.append(clock() - begin)
    return found, min(turns)


def memory(name):
    """VmRSS or VmHWM of this process [MiB], None where the system does not say."""
    try:
        text = pathlib.Path("/proc/self/status").read_text(encoding="ascii")
        return int(text.split(name + ":")[1].split()[0]) / 1024
    except (OSError, IndexError):
        return None


def forget_peak():
    try:
        pathlib.Path("/proc/self/clear_refs").write_text("5", encoding="ascii")
    except OSError:
        pass


def apart(solve, seconds):
    """`solve()` in a process of its own: its result and memory, or None where it was late or crashed.

    Returns (result, MiB, late)."""
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            forget_peak()
            before = memory("VmRSS")
            result = solve()
            peak = memory("VmHWM")
            with os.fdopen(writing, "wb") as pipe:
                pickle.dump((result, None if before is None or peak is None else peak - before), pipe)
        finally:
            os._exit(0)
    os.close(writing)
    data, end = b"", time.monotonic() + processes.PATIENCE * seconds
    late = False
    while True:
        ready, _, _ = select.select([reading], [], [], max(0.0, end - time.monotonic()))
        if not ready:
            os.kill(child, signal.SIGKILL)
            late = True
            break
        piece = os.read(reading, 1 << 16)
        if not piece:
            break
        data += piece
    os.close(reading)
    os.waitpid(child, 0)
    result, weight = pickle.loads(data) if data and not late else (None, None)
    return result, weight, late


def one_by_one(environments, solve, seconds):
    """An Answer from solve(environment) -> (reaction, seconds, claimed or None, iterations or None), each apart."""
    reactions, spent, claimed, iterations, weights, late = [], [], [], [], [], False
    for e in environments:
        result, weight, was_late = apart(lambda e=e: solve(e), seconds)
        late |= was_late
        reaction, took, claims, steps = result or (np.full(e.rows, np.nan), seconds, False, 0)
        reactions.append(reaction)
        spent.append(took)
        claimed.append(claims)
        iterations.append(steps)
        weights += [weight] if weight is not None else []
    known = all(steps is not None for steps in iterations)
    return answer_file.Answer(np.concatenate(reactions), np.array(spent),
                              None if None in claimed else np.array(claimed, bool),
                              np.array(iterations, np.int64) if known else None, max(weights, default=None), late)
