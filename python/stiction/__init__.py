"""Batched frictional contact for Python, with the same bits on every machine.

    batch = stiction.Batch.from_delassus(A, b, mu=0.5, law="coulomb")   # arrays of NumPy, PyTorch, JAX, CuPy, Warp
    solution = stiction.Solver(device="cpu", tolerance=1e-6).solve(batch)
    solution.lambda_, solution.status, solution.solved
"""

from . import _core, guess, monitor
from ._arrays import STATUS_DTYPE
from ._batch import Batch
from ._derivative import GRADIENT_DTYPE, GRADIENT_FLAGS, Derivative, Gradients
from ._flags import FLAGS
from ._policy import Accuracy, AccuracyPolicy
from ._semidefinite import semidefinite_matrix, semidefinite_vector
from ._solution import CODES, SOLVERS, Solution
from ._solver import Solver, verify, worst_contacts
from ._stepping import ParallelContactSolver
from ._world import Body, Shape, World, WorldContacts, WorldState
from ._world_step import WorldStep

Error = _core.Error
devices = _core.devices
__version__ = _core.version
numerics_epoch = _core.numerics_epoch

__all__ = ["Accuracy", "AccuracyPolicy", "Batch", "Body", "CODES", "Derivative", "Error", "FLAGS", "GRADIENT_DTYPE",
           "GRADIENT_FLAGS", "Gradients", "ParallelContactSolver", "SOLVERS", "STATUS_DTYPE", "Shape", "Solution",
           "Solver", "World", "WorldContacts", "WorldState", "WorldStep", "devices", "guess", "monitor", "numerics_epoch",
           "semidefinite_matrix", "semidefinite_vector", "verify", "worst_contacts"]
