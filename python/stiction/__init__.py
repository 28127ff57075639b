"""Batched frictional contact for Python, with the same bits on every machine.

    batch = stiction.Batch.from_delassus(A, b, mu=0.5, law="coulomb")   # arrays of NumPy, PyTorch, JAX, CuPy, Warp
    solution = stiction.Solver(device="cpu", tolerance=1e-6).solve(batch)
    solution.lambda_, solution.status, solution.solved
"""

from . import _core, learning, monitor
from .core.arrays import STATUS_DTYPE
from .core.batch import Batch
from .core.derivative import GRADIENT_DTYPE, GRADIENT_FLAGS, Derivative, Gradients
from .core.flags import FLAGS
from .core.policy import Accuracy, AccuracyPolicy
from .core.semidefinite import semidefinite_matrix, semidefinite_vector
from .core.solution import CODES, SOLVERS, Solution
from .core.solver import Solver, verify, worst_contacts
from .core.stepping import ParallelContactSolver, SteppingSolver
from .core.world import Body, Shape, World, WorldContacts, WorldState
from .core.world_step import WorldStep

Error = _core.Error
devices = _core.devices
__version__ = _core.version
numerics_epoch = _core.numerics_epoch

__all__ = ["Accuracy", "AccuracyPolicy", "Batch", "Body", "CODES", "Derivative", "Error", "FLAGS", "GRADIENT_DTYPE",
           "GRADIENT_FLAGS", "Gradients", "ParallelContactSolver", "SOLVERS", "STATUS_DTYPE", "Shape", "Solution",
           "Solver", "SteppingSolver", "World", "WorldContacts", "WorldState", "WorldStep", "devices", "learning",
           "monitor", "numerics_epoch", "semidefinite_matrix", "semidefinite_vector", "verify", "worst_contacts"]
