"""Checks of your own simulator or solver, for its tests; they need NumPy alone.

    def rollout(seeds):                                # any function of a list of environments
        ...
        return [states[i] for i in range(len(seeds))]  # one result for each, in their order

    stiction.testing.assert_permutation_invariant(rollout, range(16))
"""

from __future__ import annotations

import numpy as np

__all__ = ["assert_permutation_invariant"]


def assert_permutation_invariant(run, environments, *, shuffles=2, seed=0):
    """Asserts that an environment's result depends on that environment alone, to the last bit.

    The environments are run as given. They are run again in reverse, in random orders, in two halves, each one alone,
    and all twice over. Wherever an environment stands and whatever stands beside it, its result must have the same
    bits. NaN equals NaN of the same bits; 0 and -0 differ.

    run: takes a list of environments, returns one result for each in the same order. A result is an array, a number, or
        a tuple, list or dict of results. Arrays of PyTorch, JAX, CuPy and Warp are copied to the host. run must start
        anew in each call: state kept from the last one (warm starts, states, random numbers) is part of the answer.
    environments: arguments of run, a list of at least one: seeds, states, matrices.
    shuffles: how many random orders; seed: of them.

    Raises AssertionError with the first environment that differs, its two places, and the first number that does.
    ValueError if run returns another number of results.
    """
    environments = list(environments)
    count = len(environments)
    if count < 1:
        raise ValueError("environments: expected at least one, got none")
    expected = _results(run, environments)
    rng = np.random.default_rng(seed)
    straight = list(range(count))
    trials = [("reversed", straight[::-1])]
    trials += [(f"shuffled ({i + 1})", rng.permutation(count).tolist()) for i in range(shuffles)]
    trials += [("the first half", straight[:(count + 1) // 2]), ("the second half", straight[count // 2:])]
    trials += [(f"environment {i} alone", [i]) for i in straight]
    trials += [("all twice over", straight * 2)]
    for name, order in trials:
        found = _results(run, [environments[i] for i in order])
        for place, (environment, result) in enumerate(zip(order, found)):
            difference = _difference(expected[environment], result)
            if difference is not None:
                raise AssertionError(
                    f"environment {environment} of {count} returned other bits at place {place} of {len(order)} ({name}) "
                    f"than at place {environment} of {count}: {difference}")


def _results(run, environments):
    found = run(list(environments))
    found = [found[i] for i in range(len(found))]
    if len(found) != len(environments):
        raise ValueError(f"run: expected one result for each of {len(environments)} environments, got {len(found)}")
    return [_copied(result) for result in found]


def _copied(result):
    """The result in memory of its own, which the next call does not write to."""
    if isinstance(result, dict):
        return {key: _copied(value) for key, value in result.items()}
    if isinstance(result, (tuple, list)):
        return tuple(_copied(value) for value in result)
    for name in ("detach", "cpu", "get", "numpy"):
        step = getattr(result, name, None)
        if callable(step) and not isinstance(result, (np.ndarray, np.generic)):
            result = step()
    return np.array(result)


def _difference(expected, found, path="the result"):
    """Says where two results differ first, in words; None: nowhere."""
    if isinstance(expected, dict) and isinstance(found, dict) and expected.keys() == found.keys():
        pairs = [(f"{path}[{key!r}]", expected[key], found[key]) for key in expected]
    elif isinstance(expected, tuple) and isinstance(found, tuple) and len(expected) == len(found):
        pairs = [(f"{path}[{i}]", *both) for i, both in enumerate(zip(expected, found))]
    elif isinstance(expected, np.ndarray) and isinstance(found, np.ndarray):
        return _array_difference(expected, found, path)
    else:
        return f"{path} is made otherwise"
    for name, one, other in pairs:
        difference = _difference(one, other, name)
        if difference is not None:
            return difference
    return None


def _array_difference(expected, found, path):
    if expected.shape != found.shape or expected.dtype != found.dtype:
        return f"{path} is {found.dtype} {found.shape}, and was {expected.dtype} {expected.shape}"
    if expected.tobytes() == found.tobytes():
        return None
    size = expected.dtype.itemsize
    one, other = (np.frombuffer(array.tobytes(), np.uint8).reshape(-1, size) for array in (expected, found))
    rows = np.flatnonzero((one != other).any(axis=1))
    at = tuple(int(i) for i in np.unravel_index(rows[0], expected.shape))
    place = f"{path}{list(at) if at else ''}"
    return f"{place} is {found[at]!r}, and was {expected[at]!r}; {len(rows)} of {expected.size} numbers differ"
