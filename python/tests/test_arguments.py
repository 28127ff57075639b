"""Options that are no arrays: what does not fit into the library's numbers and names is refused by its name."""

import subprocess
import sys
import textwrap

import numpy as np
import pytest

import stiction
from stiction import Batch, Body, Shape, Solver, World, WorldStep
from stiction.guess import Guess

BALL = Shape("sphere", 0.1, body=0)


def world(**options):
    return World([Body.solid(BALL, 1000.0)], [Shape("plane"), BALL], 2, **options)


def solve_by(guess):
    batch = Batch.from_delassus(np.eye(3)[None], -np.ones((1, 3)), mu=0.5)
    return Solver().solve(batch, guess=guess, ids=np.array([[1]]))


MISTAKES = {
    "more environments than fit": (lambda: World([], [], 2**63), ValueError, "env_count: expected an integer from"),
    "more bodies than fit": (lambda: Shape("sphere", 0.1, body=2**31), ValueError, "Shape.body: expected an integer from"),
    "more iterations than fit": (lambda: world(max_iterations=2**31), ValueError, "max_iterations: expected an integer"),
    "more steps than fit": (lambda: world().step(count=2**63), ValueError, "count: expected an integer from"),
    "words for seconds": (lambda: world(dt="soon"), TypeError, "dt: expected a number, got 'soon'"),
    "no law": (lambda: world(law=None), TypeError, "law: expected a str, got None"),
    "a list of kinds": (lambda: Shape(["box"]), ValueError, "Shape.kind: expected one of sphere"),
    "no checkpoint": (lambda: world().resume(None), TypeError, "checkpoint: expected a mapping of arrays, got None"),
    "more unknowns than fit": (lambda: WorldStep(world(), max_unknowns=2**31), ValueError, "max_unknowns: expected"),
    "no guess": (lambda: solve_by(3), TypeError, "guess: expected a stiction.guess.Guess, got int"),
    "more threads than fit": (lambda: Guess(threads=2**31), ValueError, "threads: expected an integer from"),
    "a word of candidates": (lambda: Guess("luck"), ValueError, r"candidates\[0\]: expected one of zero.*'luck'"),
}


@pytest.mark.parametrize("mistake", MISTAKES, ids=lambda name: name.replace(" ", "_"))
def test_mistakes_are_named(mistake):
    make, error, message = MISTAKES[mistake]
    with pytest.raises(error, match=message):
        make()


def test_a_float_that_is_whole_is_a_whole_number():
    assert Solver(max_iterations=1e3).max_iterations == 1000
    assert Solver(max_iterations=np.int32(7)).max_iterations == 7
    assert stiction.World([], [], 3.0).env_count == 3


def test_room_is_counts_and_switches():
    Solver(capacity={"envs": 2, "rows": 1e2, "wide": False, "semidefinite": True})


def test_a_signal_ends_many_steps_between_two_of_them():
    """In a process of its own: without the check it would step for half an hour."""
    program = textwrap.dedent("""
        import signal, stiction
        world = stiction.World([stiction.Body(1.0, (1, 1, 1))], [], 64)

        def stop(*_):
            raise KeyboardInterrupt
        signal.signal(signal.SIGALRM, stop)
        signal.setitimer(signal.ITIMER_REAL, 0.2)
        try:
            world.step(count=10**9)
        except KeyboardInterrupt:
            before = world.hash()
            world.step()
            print(before != world.hash(), world.solved.all())
    """)
    ended = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=120)
    assert ended.stdout == "True True\n", ended.stderr
