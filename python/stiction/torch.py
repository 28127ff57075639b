"""Contact problems as a PyTorch operator, `torch.ops.stiction.solve`: it can be traced, compiled, vmapped and
differentiated, and links no PyTorch.

    lambda_, w, status = stiction.torch.solve(A, b, mu, law="coulomb")
"""

import functools
import math

import torch
from torch.autograd.forward_ad import unpack_dual

from .core.arguments import number, whole
from .core.arrays import STATUS_DTYPE
from .core.batch import Batch
from .core.derivative import Derivative
from .core.layout import cone_text
from .core.solver import Solver
from .core.world import WorldState
from .core.world_step import WorldStep


@functools.lru_cache(maxsize=64)
def _solver(device, solver, tolerance, max_iterations, unrolled):
    stall = {"stall_window": 0} if unrolled else {}
    return Solver(device=device, solver=solver, tolerance=tolerance, max_iterations=max_iterations, **stall)


@functools.lru_cache(maxsize=64)
def _derivative(device, kappa):
    """One for each device, since it keeps its memory."""
    return Derivative(device, kappa=kappa)


def _device_of(A):
    return "cpu" if A.device.type == "cpu" else f"{A.device.type}:{A.device.index}"


def _without_history(*tensors):
    return (None if t is None else t.detach().contiguous() for t in tensors)


def _as_tensors(arrays):
    return tuple(array if isinstance(array, torch.Tensor) else torch.from_numpy(array) for array in arrays)


@torch.library.custom_op("stiction::solve", mutates_args=())
def _solve(A: torch.Tensor, b: torch.Tensor, mu: torch.Tensor, R: torch.Tensor | None, lo: torch.Tensor | None,
           hi: torch.Tensor | None, counts: torch.Tensor | None, warm_start: torch.Tensor | None, cones: str, law: str,
           solver: str, tolerance: float, max_iterations: int,
           kappa: float = 0.0, unrolled: bool = False) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    A, b, mu, R, lo, hi, warm_start = (None if t is None else t.detach() for t in (A, b, mu, R, lo, hi, warm_start))
    batch = Batch.from_delassus(A, b, mu=mu, R=R, lo=lo, hi=hi, counts=counts, cones=_cones_from(cones), law=law)
    device = "cpu" if A.device.type == "cpu" else batch.device
    solution = _solver(device, solver, tolerance, max_iterations, unrolled).solve(batch, warm_start=warm_start)
    return solution.lambda_, solution.w, solution._raw


@_solve.register_fake
def _(A, b, mu, R, lo, hi, counts, warm_start, cones, law, solver, tolerance, max_iterations, kappa=0.0, unrolled=False):
    return (torch.empty_like(b), torch.empty_like(b),
            torch.empty((A.shape[0], STATUS_DTYPE.itemsize), dtype=torch.uint8, device=A.device))


@torch.library.custom_op("stiction::solve_backward", mutates_args=())
def _pull_back(A: torch.Tensor, b: torch.Tensor, mu: torch.Tensor, R: torch.Tensor | None, lo: torch.Tensor | None,
               hi: torch.Tensor | None, counts: torch.Tensor | None, lambda_: torch.Tensor, records: torch.Tensor,
               by_lambda: torch.Tensor, by_w: torch.Tensor, cones: str, law: str, kappa: float,
               ) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor, torch.Tensor, torch.Tensor, torch.Tensor]:
    A, b, mu, R, lo, hi, counts, lambda_, records, by_lambda, by_w = _without_history(
        A, b, mu, R, lo, hi, counts, lambda_, records, by_lambda, by_w)
    batch = Batch.from_delassus(A, b, mu=mu, R=R, lo=lo, hi=hi, counts=counts, cones=_cones_from(cones), law=law)
    found = _derivative(_device_of(A), kappa).vjp(batch, lambda_, lambda_=by_lambda, w=by_w,
                                                  status=status(records) if A.device.type == "cpu" else records)
    return _as_tensors((found.A, found.b, found.mu, found.R, found.lo, found.hi))


@_pull_back.register_fake
def _(A, b, mu, R, lo, hi, counts, lambda_, records, by_lambda, by_w, cones, law, kappa):
    return torch.empty_like(A), *(torch.empty_like(b) for _ in range(5))


@torch.library.custom_op("stiction::sweeps_backward", mutates_args=())
def _pull_back_sweeps(A: torch.Tensor, b: torch.Tensor, mu: torch.Tensor, R: torch.Tensor | None,
                      lo: torch.Tensor | None, hi: torch.Tensor | None, counts: torch.Tensor | None,
                      warm_start: torch.Tensor | None, by_lambda: torch.Tensor, by_w: torch.Tensor, cones: str, law: str,
                      sweeps: int) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor, torch.Tensor, torch.Tensor,
                                            torch.Tensor, torch.Tensor]:
    A, b, mu, R, lo, hi, counts, warm_start, by_lambda, by_w = _without_history(
        A, b, mu, R, lo, hi, counts, warm_start, by_lambda, by_w)
    batch = Batch.from_delassus(A, b, mu=mu, R=R, lo=lo, hi=hi, counts=counts, cones=_cones_from(cones), law=law)
    found = _derivative(_device_of(A), 0.0).unrolled_vjp(batch, sweeps, warm_start=warm_start, lambda_=by_lambda, w=by_w)
    return _as_tensors((found.A, found.b, found.mu, found.R, found.lo, found.hi, found.warm_start))


@_pull_back_sweeps.register_fake
def _(A, b, mu, R, lo, hi, counts, warm_start, by_lambda, by_w, cones, law, sweeps):
    return torch.empty_like(A), *(torch.empty_like(b) for _ in range(6))


def _keep(ctx, inputs, output):
    A, b, mu, R, lo, hi, counts, warm_start, ctx.cones, ctx.law, _, _, ctx.sweeps, *rest = inputs
    ctx.kappa, ctx.unrolled = rest + [0.0, False][len(rest):]
    lambda_, _, records = output
    own = (warm_start,) if ctx.unrolled else (lambda_, records)
    ctx.save_for_backward(A, b, mu, R, lo, hi, counts, *own)


def _differentiate(ctx, by_lambda, by_w, _):
    without = [kind for kind in ("box_friction", "semidefinite") if kind in ctx.cones]
    if without:
        raise RuntimeError(f"cones: expected cones that have a derivative, got {without[0]}")
    if ctx.unrolled:
        *found, by_start = torch.ops.stiction.sweeps_backward(*ctx.saved_tensors, by_lambda, by_w, ctx.cones, ctx.law,
                                                              ctx.sweeps)
        found += [None, by_start]
    else:
        found = torch.ops.stiction.solve_backward(*ctx.saved_tensors, by_lambda, by_w, ctx.cones, ctx.law, ctx.kappa)
    wanted = (gradient if needed else None for gradient, needed in zip(found, ctx.needs_input_grad))
    return *wanted, *(None,) * (len(ctx.needs_input_grad) - len(found))


torch.library.register_autograd("stiction::solve", _differentiate, setup_context=_keep)


def _vmapped(operator):
    """The rule of an operator whose tensors have environments in front: more of them."""

    def rule(info, in_dims, *arguments):
        flat = []
        for argument, dim in zip(arguments, in_dims):
            if isinstance(argument, torch.Tensor):
                argument = argument.unsqueeze(0) if dim is None else argument.movedim(dim, 0)
                argument = argument.expand(info.batch_size, *argument.shape[1:]).flatten(0, 1).contiguous()
            flat.append(argument)
        out = operator(*flat)
        return tuple(t.unflatten(0, (info.batch_size, -1)) for t in out), (0,) * len(out)

    return rule


if hasattr(torch.library, "register_vmap"):  # PyTorch 2.5
    torch.library.register_vmap("stiction::solve", _vmapped(torch.ops.stiction.solve))
    torch.library.register_vmap("stiction::solve_backward", _vmapped(torch.ops.stiction.solve_backward))
    torch.library.register_vmap("stiction::sweeps_backward", _vmapped(torch.ops.stiction.sweeps_backward))


def _text_of(cones):
    """Cones as an operator's argument: one kind's name, or "friction:3,box:1"."""
    if isinstance(cones, str):
        return cones
    return cone_text(cones)


def _cones_from(text):
    if ":" not in text:
        return text if text else []
    return [(kind, int(rows)) for kind, rows in (part.split(":") for part in text.split(","))]


def _refuse_tangents(tensors):
    """PyTorch takes the tangents of an operator without forward mode to be 0, without a word."""
    for name, tensor in tensors.items():
        if isinstance(tensor, torch.Tensor) and unpack_dual(tensor).tangent is not None:
            raise RuntimeError(f"{name}: expected a tensor without a tangent, got one: derivatives are in reverse alone, "
                               "by backward() or torch.autograd.grad")


def solve(A, b, mu=None, R=None, lo=None, hi=None, *, counts=None, warm_start=None, cones="friction", law="convex",
          solver="auto", tolerance=1e-4, max_iterations=1000, kappa=0.0,
          derivative="implicit"):
    """Reactions, residual motion and status of a batch of contact problems.

    A (B, n, n) or (n, n), b, R, lo, hi, warm_start (B, n) or (n,), mu a number or like b. All are contiguous, float32
    or float64, on one device; counts int32 (B,): rows in use. cones: the same for every environment, as for
    Batch.from_delassus. Returns lambda_ and w, shaped like b, and status as bytes uint8 (B, 32) or (32,), which
    `status(...)` names. On a GPU it is queued on the current stream.

    lambda_ and w have derivatives by A, b, mu, R, lo and hi, in reverse and once (docs/math/derivative.md).
    Entries of A are independent. Derivatives are those of the solution, not of the iterations, and err by as much as the
    solution does: solve to 1e-6 or less. An environment that was not solved has derivatives of 0, and so has one whose
    reactions are not determined: give R. warm_start has none. Boxed friction and semidefinite cones have none, and a
    backward pass through them raises. kappa > 0 takes the derivatives of the relaxed problem, so that open contacts
    pass some on (stiction.Derivative); the results do not change.

    derivative="unrolled" takes those of exactly max_iterations sweeps of solver="pgs" with tolerance=0, converged or not,
    and by warm_start, too (Derivative.unrolled_vjp).
    """
    if derivative not in ("implicit", "unrolled"):
        raise ValueError(f"derivative: expected 'implicit' or 'unrolled', got {derivative!r}")
    for name, tensor in (("A", A), ("b", b)):
        if not isinstance(tensor, torch.Tensor):
            raise TypeError(f"{name}: expected a torch.Tensor, got {type(tensor).__name__}")
    for name, tensor in (("R", R), ("lo", lo), ("hi", hi), ("counts", counts), ("warm_start", warm_start)):
        if not isinstance(tensor, torch.Tensor | None):
            raise TypeError(f"{name}: expected a torch.Tensor or None, got {type(tensor).__name__}")
    tolerance, kappa = number("tolerance", tolerance), number("kappa", kappa)
    if not 0 <= kappa < math.inf:
        raise ValueError(f"kappa: expected a finite number of at least 0, got {kappa}")
    unrolled = derivative == "unrolled"
    if unrolled and (solver != "pgs" or tolerance != 0 or kappa != 0):
        raise ValueError("derivative: 'unrolled' is that of max_iterations sweeps as they run: expected solver='pgs', "
                         f"tolerance=0 and kappa=0, got {solver!r}, {tolerance} and {kappa}")
    if not torch.compiler.is_compiling():
        _refuse_tangents({"A": A, "b": b, "mu": mu, "R": R, "lo": lo, "hi": hi})
    single = b.dim() == 1
    if not isinstance(mu, torch.Tensor):
        mu = torch.full_like(b, 0.0 if mu is None else mu)
    if single:
        A, b, mu, R, lo, hi, warm_start = (None if t is None else t.unsqueeze(0)
                                           for t in (A, b, mu, R, lo, hi, warm_start))
    out = torch.ops.stiction.solve(A, b, mu, R, lo, hi, counts, warm_start, _text_of(cones), law, solver,
                                   tolerance, whole("max_iterations", max_iterations), kappa, unrolled)
    return tuple(tensor.squeeze(0) for tensor in out) if single else out


def status(records):
    """The records of `solve` as NumPy's, on the host: code, flags, iterations, residual, residual_abs, solver."""
    return records.cpu().numpy().view(STATUS_DTYPE).reshape(records.shape[:-1])


class _WorldStep(torch.autograd.Function):
    """A step of a world from a state, and its derivative."""

    @staticmethod
    def forward(ctx, position, orientation, twist, wrench, world, kappa):
        ctx.save_for_backward(position, orientation, twist, wrench)
        position, orientation, twist, wrench = (None if t is None else t.detach().contiguous()
                                                for t in (position, orientation, twist, wrench))
        world.reset(position=position, orientation=orientation, twist=twist)
        ctx.step = WorldStep(world, wrench, kappa=kappa)
        after = world.state(WorldState(*map(torch.empty_like, (position, orientation, twist))))
        ctx.mark_non_differentiable(after.orientation)
        return tuple(after)

    @staticmethod
    def backward(ctx, by_position, _, by_twist):
        found = _WorldPull.apply(ctx.step, by_position, by_twist, *ctx.saved_tensors)
        by = (found[0], None, found[1], found[2])
        return *(gradient if needed else None for gradient, needed in zip(by, ctx.needs_input_grad)), None, None


class _WorldPull(torch.autograd.Function):
    """The derivative of a step, which depends on where the step began and has no derivative itself."""

    @staticmethod
    def forward(ctx, step, by_position, by_twist, *_):
        found = step.vjp(position=by_position.detach().contiguous(), twist=by_twist.detach().contiguous())
        return tuple(map(torch.from_numpy, (found.position, found.twist, found.wrench)))

    @staticmethod
    def backward(ctx, *_):
        raise RuntimeError("step_world: expected a derivative once, got one of a derivative, which there is not")


def step_world(world, position, orientation, twist, wrench=None, *, kappa=0.0):
    """One step of a stiction.World from a state: (position, orientation, twist) after it.

    Tensors on the host in the world's dtype, shaped as those of World.state; wrench is shaped as twist, or None. The
    world is put into that state, so it forgets the last step's contacts and starts from no reactions. The result
    depends on the arguments and the world's options alone.

    position and twist have derivatives by position, twist and wrench, in reverse and once: those of stiction.WorldStep.
    It lists the frozen quantities, and the effect of kappa. orientation has none. Environments without a derivative
    have zeros. Solve to a small tolerance, and give contacts compliance (cfm > 0).
    """
    return WorldState(*_WorldStep.apply(position, orientation, twist, wrench, world, kappa))
