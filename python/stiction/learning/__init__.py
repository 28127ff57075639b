"""Choices that learn: first guesses (docs/howto/warm_start.md) and a tuner of solvers (docs/math/tuner.md)."""

from .guess import Dense, Guess, Ridge
from .tuner import FEATURES, TunedSolver, Tuner, features

__all__ = ["FEATURES", "Dense", "Guess", "Ridge", "TunedSolver", "Tuner", "features"]
