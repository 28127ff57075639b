"""Options that are no arrays: values beyond the library's numbers and names are refused by name."""

import subprocess
import sys
import textwrap

import numpy as np
import pytest

import stiction
from stiction import Accuracy, AccuracyPolicy, Batch, Body, Shape, Solver, SteppingSolver, World, WorldStep
from stiction.distributed import Shard, rebalance
from stiction.learning import Guess
from stiction.learning import features

BALL = Shape("sphere", 0.1, body=0)


def world(**options):
    return World([Body.solid(BALL, 1000.0)], [Shape("plane"), BALL], 2, **options)


def solve_by(guess):
    batch = Batch.from_delassus(np.eye(3)[None], -np.ones((1, 3)), mu=0.5)
    return Solver().solve(batch, guess=guess, ids=np.array([[1]]))


def contacts():
    return Batch.from_delassus(np.eye(3)[None].repeat(2, 0), -np.ones((2, 3)), mu=0.5)


def accuracy_of(tolerance, max_iterations):
    contacts().set_accuracy(Accuracy(tolerance, max_iterations))


def stages(*last):
    return AccuracyPolicy.curriculum([(0, 5, 1e-2), last])


NAN, INF = float("nan"), float("inf")

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
    "no guess": (lambda: solve_by(3), TypeError, "guess: expected a stiction.learning.Guess, got int"),
    "more threads than fit": (lambda: Guess(threads=2**31), ValueError, "threads: expected an integer from"),
    "tolerance NaN": (lambda: accuracy_of(NAN, 9), ValueError, "accuracy.tolerance: expected a finite number >= 0, got nan"),
    "tolerance infinite": (lambda: accuracy_of(INF, 9), ValueError, "accuracy.tolerance: .*got inf"),
    "tolerance negative": (lambda: accuracy_of(-1e-4, 9), ValueError, "accuracy.tolerance: .*got -0.0001"),
    "one tolerance NaN": (lambda: accuracy_of([1, NAN], 9), ValueError, r"accuracy.tolerance\[1\]: expected.*got nan"),
    "tolerances of others": (lambda: accuracy_of([1, 1, 1], 9), ValueError, r"one for each of 2 environments, got \(3,\)"),
    "no tolerance": (lambda: accuracy_of(None, 9), ValueError, "accuracy.tolerance: expected a finite number"),
    "a word of a tolerance": (lambda: accuracy_of("low", 9), TypeError, "accuracy.tolerance: expected numbers, got 'low'"),
    "one iteration and a half": (lambda: accuracy_of(0, 1.5), ValueError, "accuracy.max_iterations: expected an integer.*1.5"),
    "negative iterations": (lambda: accuracy_of(0, [5, -1]), ValueError, r"accuracy.max_iterations\[1\]: .*got -1"),
    "iterations that overflow": (lambda: accuracy_of(0, 2**31), ValueError, "accuracy.max_iterations: .*to 2147483647, got"),
    "infinite iterations": (lambda: accuracy_of(0, INF), ValueError, "accuracy.max_iterations: .*got inf"),
    "no accuracy": (lambda: contacts().set_accuracy(1e-4), TypeError, "accuracy: expected a stiction.Accuracy.*got 0.0001"),
    "a policy without end": (lambda: AccuracyPolicy.fixed(INF), ValueError, "tolerance: .*got inf"),
    "a stage that never begins": (lambda: stages(NAN, 9, 0), ValueError, r"stages' progress\[1\]: expected.*got nan"),
    "a stage before the first": (lambda: stages(-1, 9, 0), ValueError, "stages: expected the first to begin at progress 0"),
    "half a stage's iterations": (lambda: stages(0.5, 9.5, 0), ValueError, r"stages' max_iterations\[1\]: .*got 9.5"),
    "progress NaN": (lambda: stages(0.5, 9, 0).apply(progress=NAN), ValueError, "progress: .*got nan"),
    "entropy NaN": (lambda: AccuracyPolicy.entropy(5, 1).apply(entropy=NAN), ValueError, "entropy: expected numbers, got nan"),
    "a base without end": (lambda: AccuracyPolicy.entropy(INF, 1), ValueError, "base: .*got inf"),
    "negative room": (lambda: Solver(capacity={"rows": -1}), ValueError, r"capacity\['rows'\]: expected a count.*got -1"),
    "negative freedom": (lambda: SteppingSolver(1, max_rows=3, form="jacobian", max_dofs=-1), ValueError, "max_dofs: .*-1"),
    "half an environment": (lambda: SteppingSolver(2, max_rows=3).reset([0.5]), TypeError, "ids: expected an integer"),
    "features of no tolerance": (lambda: features(contacts(), NAN), ValueError, "tolerance: .*got nan"),
    "half a shard": (lambda: Shard.split(1.5), TypeError, "total: expected an integer, got 1.5"),
    "offsets between": (lambda: Shard.of([0, 1.5]), TypeError, "offsets: expected an integer, got 1.5"),
    "negative moves": (lambda: rebalance([0, 4, 8], [1, 2], -1), ValueError, "most: .*got -1"),
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
