"""Accuracy of solves: the same always, by training progress, by the policy's entropy, by environment."""

from typing import NamedTuple

import numpy as np

from .. import _core
from .arguments import each_count, each_not_negative, not_negative

#: (training progress from which on, iterations, tolerance): the schedule of the source chapter's section 6.2.
CURRICULUM = ((0.0, 5, 1e-2), (0.3, 10, 1e-3), (0.7, 20, 1e-4))


class Accuracy(NamedTuple):
    """Relative residual that will do [-] and iteration limit: numbers, or arrays float64 and int32 (B,)."""

    tolerance: object
    max_iterations: object


class AccuracyPolicy:
    """Tolerance and iteration limit of solves, asked for with `apply` whenever they may have changed.

        policy = stiction.AccuracyPolicy.curriculum()
        batch.set_accuracy(policy.apply(progress=step / steps))
    """

    def __init__(self, rule):
        self._rule = rule

    @classmethod
    def fixed(cls, tolerance=1e-4, max_iterations=1000) -> "AccuracyPolicy":
        """One accuracy always; numbers, or arrays (B,) with one entry per environment."""
        accuracy = _accuracy(tolerance, max_iterations)
        return cls(lambda progress, entropy: accuracy)

    @classmethod
    def preset(cls, name: str) -> "AccuracyPolicy":
        """Accuracy by task: "navigation", "locomotion", "grasping" or "assembly"."""
        chosen = _core.preset(name)
        return cls.fixed(chosen["tolerance"], chosen["max_iterations"])

    @classmethod
    def curriculum(cls, stages=CURRICULUM) -> "AccuracyPolicy":
        """By training progress in [0, 1]: the last of the stages (progress, max_iterations, tolerance) that has begun.
        Default: 5 iterations and 1e-2, from progress 0.3 on 10 and 1e-3, from 0.7 on 20 and 1e-4.
        """
        stages = sorted(stages)
        if not stages or stages[0][0] != 0:
            raise ValueError(f"stages: expected the first to begin at progress 0, got {stages[:1]}")
        begins = each_not_negative("stages' progress", [stage[0] for stage in stages])
        iterations = each_count("stages' max_iterations", [stage[1] for stage in stages])
        tolerances = each_not_negative("stages' tolerance", [stage[2] for stage in stages])

        def rule(progress, entropy):
            if progress is None:
                raise ValueError("progress: expected the share of the training that is done, got None")
            stage = np.searchsorted(begins, each_not_negative("progress", progress), side="right") - 1
            return _accuracy(tolerances[stage], iterations[stage])

        return cls(rule)

    @classmethod
    def entropy(cls, base: float, alpha: float, tolerance=1e-4) -> "AccuracyPolicy":
        """base * (1 + alpha * H) iterations, rounded, for policies of entropy H >= 0 [the caller's unit]: an uncertain
        policy explores, and its contacts get more work. H: a number, or one per environment.
        """
        base, alpha = not_negative("base", base), not_negative("alpha", alpha)
        tolerance = each_not_negative("tolerance", tolerance)

        def rule(progress, entropy):
            if entropy is None:
                raise ValueError("entropy: expected the policy's entropy, got None")
            entropy = np.asarray(entropy, np.float64)
            if np.isnan(entropy).any():
                raise ValueError(f"entropy: expected numbers, got {entropy}")
            wanted = base * (1 + alpha * np.maximum(entropy, 0))
            return _accuracy(tolerance, np.rint(np.minimum(wanted, np.iinfo(np.int32).max)).astype(np.int32))

        return cls(rule)

    def apply(self, progress=None, entropy=None) -> Accuracy:
        """The Accuracy at that progress of the training [0 to 1] and that entropy; numbers or arrays, as they are.

        Give it to `Batch.set_accuracy`, its numbers to `Solver`, or its arrays to env_tolerance and env_max_iterations.
        """
        return self._rule(progress, entropy)


def _accuracy(tolerance, max_iterations):
    tolerance, max_iterations = each_not_negative("tolerance", tolerance), each_count("max_iterations", max_iterations)
    return Accuracy(tolerance if tolerance.ndim else float(tolerance),
                    max_iterations if max_iterations.ndim else int(max_iterations))
