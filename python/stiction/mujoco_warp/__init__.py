"""MuJoCo Warp with stiction as its constraint solver.

    solution = stiction.mujoco_warp.step(model, data)       # mujoco_warp.step with this solver
    solution.solved, solution.residual                      # of each world

`solve` and `noslip` stand in for MuJoCo Warp's functions of those names: they read its arrays where they lie, and
write its outputs. docs/howto/mujoco_warp.md.
"""

from __future__ import annotations

import contextlib

import mujoco_warp
import warp as wp
from mujoco_warp._src import island, smooth, types
from mujoco_warp._src import solver as _theirs

from ..core.replaced import replaced
from ..core.solution import Solution
from ..core.solver import Solver
from .rows import Friction, Rows, memory_of

__all__ = ["ConstraintSolver", "noslip", "replaces_solver", "solution_of", "solve", "step"]


class ConstraintSolver:
    """Solves the constraints of one model and data, again and again. Its memory is taken at the first solve.

    model, data: of mujoco_warp.put_model, put_data and make_data, on the CPU or a GPU.
    solver, max_iterations, threads: as of stiction.Solver.
    tolerance: on each world's residual, relative to its largest |J qacc_smooth - aref|, in float32.
    device: None: the one that data is on. "emulated": the GPU's programs on the CPU, for tests.

    Attributes: model, data; solver, the stiction.Solver, with stats(). solution and batch are those of the last solve:
    a stiction.Solution, whose reactions are efc.force and whose velocities are qacc, and its rows for stiction.verify.
    """

    def __init__(self, model, data, *, solver="auto", tolerance=1e-6, max_iterations=1000, threads=0, device=None):
        _check(model, data)
        self.model, self.data = model, data
        where = data.qacc.device
        self.solver = Solver(device=device or ("cpu" if where.is_cpu else str(where)), solver=solver,
                             tolerance=tolerance, max_iterations=max_iterations, threads=threads)
        self.solution = None
        self._rows = self._friction = self._memory = None

    @property
    def batch(self):
        """The rows of the last solve, over MuJoCo Warp's own arrays; None before it."""
        return None if self._rows is None else self._rows.batch

    def solve(self) -> Solution | None:
        """As mujoco_warp.solve. Returns the Solution; None where there is no room for rows, or nothing moves."""
        model, data = self.model, self.data
        _check(model, data)
        sleeps = bool(model.opt.enableflags & types.EnableBit.SLEEP)
        if sleeps:
            island.update_active_dofs(model, data)
        if not self._look():
            wp.copy(data.qacc, data.qacc_smooth)
            data.solver_niter.zero_()
            return None
        self._rows.collect()
        warm = None if model.opt.disableflags & types.DisableBit.WARMSTART else data.qacc_warmstart
        self.solution = self._run(self._rows.batch, self._rows.solution, warm_velocities=warm)
        self._rows.write(self._rows.words)
        if model.opt.noslip_iterations > 0:
            _check_noslip(model)
            self._sweep()
        if sleeps and model.ntree > 1:
            island.compute_island_mapping(model, data)
        return self.solution

    def noslip(self) -> Solution | None:
        """As MuJoCo Warp's noslip, after a solve: friction again, without softness, at the normal forces in efc.force.
        It is solved to the tolerance. Returns its Solution, of the rows of friction alone; None as `solve` does."""
        _check(self.model, self.data)
        _check_noslip(self.model)
        if not self._look():
            return None
        self._rows.collect()
        return self._sweep()

    def step(self) -> Solution | None:
        """mujoco_warp.step with this solver. Returns the Solution of its last solve."""
        with replaced(_theirs, "solve", lambda model, data: self.solve()):
            mujoco_warp.step(self.model, self.data)
        return self.solution

    def _look(self):
        """Returns true if there is anything to solve; allocates anew if MuJoCo Warp's memory is other memory."""
        if self.data.njmax == 0 or self.model.nv == 0:
            return False
        memory = memory_of(self.model, self.data)
        if memory != self._memory:
            self._rows, self._friction, self._memory = Rows(self.model, self.data), None, memory
        return True

    def _run(self, batch, out, **start):
        solution = self.solver.solve(batch, out=out, **start)
        if self.solver.device == "emulated":  # Warp's kernels on the CPU do not wait for its queue
            solution.synchronize()
        return solution

    def _sweep(self):
        if self._friction is None:
            self._friction = Friction(self._rows)
        friction = self._friction
        friction.hold()
        self._run(friction.held, friction.pushed)
        found = self._run(friction.batch, friction.solution)
        friction.join()
        self._rows.write(friction.words, more=True)
        return found


def solve(model, data, **options) -> Solution | None:
    """Solves the constraints of all worlds, as mujoco_warp.solve. options: of ConstraintSolver, which is made at the
    first call and kept with data."""
    return _solver_of(model, data, options).solve()


def noslip(model, data, **options) -> Solution | None:
    """Takes softness from friction, as MuJoCo Warp's noslip: ConstraintSolver.noslip."""
    return _solver_of(model, data, options).noslip()


def step(model, data, **options) -> Solution | None:
    """Advances all worlds, as mujoco_warp.step, with this solver. Returns the Solution of its last solve."""
    return _solver_of(model, data, options).step()


@contextlib.contextmanager
def replaces_solver(**options):
    """Within it, step, forward and whatever else of mujoco_warp solves constraints does it with `solve`: for code that
    calls MuJoCo Warp itself. For the process, not for a thread. `solution_of(data)` has the last Solution."""
    with replaced(_theirs, "solve", lambda model, data: solve(model, data, **options)):
        yield


def solution_of(data) -> Solution | None:
    """The Solution of the last solve of that data by `solve`, `step` or within `replaces_solver`; None before one."""
    known = getattr(data, _KEPT, None)
    return None if known is None else known[1].solution


#: Name of data's attribute with its solver, which MuJoCo Warp does not know.
_KEPT = "_stiction_solver"


def _solver_of(model, data, options):
    known = getattr(data, _KEPT, None)
    key = (id(model), tuple(sorted(options.items())))
    if known is None or known[0] != key:
        known = (key, ConstraintSolver(model, data, **options))
        setattr(data, _KEPT, known)
    return known[1]


def _check(model, data):
    """Refuses options that would be solved otherwise than by MuJoCo Warp."""
    if not isinstance(model, mujoco_warp.Model):
        raise TypeError(f"model: expected a mujoco_warp.Model (mujoco_warp.put_model), got {type(model).__name__}")
    if not isinstance(data, mujoco_warp.Data):
        raise TypeError(f"data: expected a mujoco_warp.Data (mujoco_warp.put_data), got {type(data).__name__}")
    if smooth.skip_qacc_smooth(model, data):
        raise ValueError("model.opt.run_qacc_smooth: expected True, got False, which leaves the acceleration without "
                         "constraints unknown: set it to True")


def _check_noslip(model):
    if model.opt.integrator == types.IntegratorType.DISCRETE:
        raise ValueError("model.opt.integrator: expected another one with noslip, got discrete, for which MuJoCo Warp "
                         "has none: set model.opt.noslip_iterations to 0")
