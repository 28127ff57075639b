"""Contact problems as a PyTorch operator, `torch.ops.stiction.solve`: it can be traced and compiled, and links no PyTorch.

    lambda_, w, status = stiction.torch.solve(A, b, mu, law="coulomb")
"""

import functools

import torch

from ._arrays import STATUS_DTYPE
from ._batch import Batch
from ._solver import Solver


@functools.lru_cache(maxsize=64)
def _solver(device, solver, tolerance, max_iterations):
    return Solver(device=device, solver=solver, tolerance=tolerance, max_iterations=max_iterations)


@torch.library.custom_op("stiction::solve", mutates_args=())
def _solve(A: torch.Tensor, b: torch.Tensor, mu: torch.Tensor, R: torch.Tensor | None, lo: torch.Tensor | None,
           hi: torch.Tensor | None, counts: torch.Tensor | None, warm_start: torch.Tensor | None, cones: str, law: str,
           solver: str, tolerance: float,
           max_iterations: int) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    A, b, mu, R, lo, hi, warm_start = (None if t is None else t.detach() for t in (A, b, mu, R, lo, hi, warm_start))
    batch = Batch.from_delassus(A, b, mu=mu, R=R, lo=lo, hi=hi, counts=counts, cones=_cones_from(cones), law=law)
    device = "cpu" if A.device.type == "cpu" else batch.device
    solution = _solver(device, solver, tolerance, max_iterations).solve(batch, warm_start=warm_start)
    return solution.lambda_, solution.w, solution._raw


@_solve.register_fake
def _(A, b, mu, R, lo, hi, counts, warm_start, cones, law, solver, tolerance, max_iterations):
    return (torch.empty_like(b), torch.empty_like(b),
            torch.empty((A.shape[0], STATUS_DTYPE.itemsize), dtype=torch.uint8, device=A.device))


def _text_of(cones):
    """Cones as an operator's argument: one kind's name, or "friction:3,box:1"."""
    if isinstance(cones, str):
        return cones
    pairs = (cone if isinstance(cone, tuple) else (cone, 3 if cone == "friction" else 1) for cone in cones)
    return ",".join(f"{kind}:{rows}" for kind, rows in pairs)


def _cones_from(text):
    if ":" not in text:
        return text if text else []
    return [(kind, int(rows)) for kind, rows in (part.split(":") for part in text.split(","))]


def solve(A, b, mu=None, R=None, lo=None, hi=None, *, counts=None, warm_start=None, cones="friction", law="convex",
          solver="auto", tolerance=1e-4, max_iterations=1000):
    """Reactions, residual motion and status of a batch of contact problems.

    A (B, n, n) or (n, n), b, R, lo, hi, warm_start (B, n) or (n,), mu a number or like b. All are contiguous, float32
    or float64, on one device; counts int32 (B,): rows in use. cones: the same for every environment, as for
    Batch.from_delassus. Returns lambda_ and w, shaped like b, and status as bytes uint8 (B, 32) or (32,), which
    `status(...)` names. On a GPU it is queued on the current stream.

    It has no derivative: raises RuntimeError if an argument wants one.
    """
    tensors = {"A": A, "b": b, "mu": mu, "R": R, "lo": lo, "hi": hi, "warm_start": warm_start}
    if torch.is_grad_enabled():
        for name, tensor in tensors.items():
            if isinstance(tensor, torch.Tensor) and tensor.requires_grad:
                raise RuntimeError(f"{name} requires a gradient, and stiction.torch.solve has no derivative: give "
                                   f"{name}.detach(), or call it under torch.no_grad()")
    single = b.dim() == 1
    if not isinstance(mu, torch.Tensor):
        mu = torch.full_like(b, 0.0 if mu is None else mu)
    if single:
        A, b, mu, R, lo, hi, warm_start = (None if t is None else t.unsqueeze(0)
                                           for t in (A, b, mu, R, lo, hi, warm_start))
    out = torch.ops.stiction.solve(A, b, mu, R, lo, hi, counts, warm_start, _text_of(cones), law, solver,
                                   float(tolerance), int(max_iterations))
    return tuple(tensor.squeeze(0) for tensor in out) if single else out


def status(records):
    """The records of `solve` as NumPy's, on the host: code, flags, iterations, residual, residual_abs, solver."""
    return records.cpu().numpy().view(STATUS_DTYPE).reshape(records.shape[:-1])
