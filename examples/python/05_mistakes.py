"""Makes each mistake and prints the error, as rows of the table in MISTAKES.md."""

import numpy as np

import stiction
from stiction import Batch, Solver, SteppingSolver

A = np.tile(np.eye(6), (2, 1, 1))  # two environments of two friction cones
b = np.zeros((2, 6)) - 1.0
ids = np.arange(4, dtype=np.uint64).reshape(2, 2)


def batch(A=A, b=b, **more):
    return Batch.from_delassus(A, b, **more)


def solve_into(lambda_):
    Solver().solve(batch(), out={"lambda_": lambda_, "status": np.zeros((2, 32), np.uint8)})


def frozen(array):
    array.setflags(write=False)
    return array


def loop(envs=2, **more):
    return SteppingSolver(envs, max_rows=6, **more)


MISTAKES = {
    "another dtype": lambda: batch(b=b.astype(np.float32)),
    "integers for numbers": lambda: batch(A.astype(np.int64)),
    "another shape": lambda: batch(b=b[:, :5].copy()),
    "matrices that are not square": lambda: batch(A[:, :5].copy()),
    "not contiguous": lambda: batch(A[:, ::-1]),
    "not an array": lambda: batch("A"),
    "rows that are not whole cones": lambda: batch(A[:, :4, :4].copy(), b[:, :4].copy()),
    "half a cone in use": lambda: batch(counts=np.array([3, 4], np.int32)),
    "a cone that there is not": lambda: batch(cones=["ice"]),
    "a solver that there is not": lambda: Solver(solver="magic"),
    "a device that there is not": lambda: Solver(device="tpu"),
    "tolerance below 0": lambda: Solver(tolerance=-1),
    "not a batch": lambda: Solver().solve(A),
    "an output of another shape": lambda: solve_into(np.zeros((2, 5))),
    "a read-only output": lambda: solve_into(frozen(np.zeros((2, 6)))),
    "`warm_velocities` for a batch without J and M": lambda: Solver().solve(batch(), warm_velocities=np.zeros((2, 6))),
    "a warm start of another shape": lambda: Solver().solve(batch(), warm_start=np.zeros((2, 3))),
    'NaN, with invalid="reject"': lambda: Solver(invalid="reject").solve(batch(A * np.nan)),
    'friction below 0, with invalid="reject"': lambda: Solver(invalid="reject").solve(batch(mu=-0.5)),
    "a stream that is not one": lambda: Solver(device="emulated").solve(batch(), stream="main"),
    "a stream that was freed": lambda: Solver(device="emulated").solve(batch(), stream=0xDEAD),
    "more environments than a loop has room for": lambda: loop(envs=1).step(batch(), ids, 0.01),
    "a batch of another form than the loop's": lambda: loop(form="jacobian").step(batch(), ids, 0.01),
    "a loop in another precision": lambda: loop(dtype="float32").step(batch(), ids, 0.01),
    "ids of another type": lambda: loop().step(batch(), ids.astype(np.int32), 0.01),
    "a step of no length": lambda: loop().step(batch(), ids, 0.0),
    "a mask of another length": lambda: loop().reset(mask=np.zeros(3, bool)),
    "an environment that there is not": lambda: loop().reset(ids=[5]),
    "a Jacobian loop on a device, of unknown width": lambda: loop(device="emulated", form="jacobian"),
    "multigrid without bodies": lambda: Solver(solver="multigrid").solve(batch()),
}


def with_torch():
    """Memory that PyTorch's own state adds, where PyTorch is installed."""
    try:
        import torch
    except ImportError:
        return {}
    matrices, right = torch.from_numpy(A).requires_grad_(), torch.from_numpy(b)
    return {"a gradient asked of a tensor": lambda: batch(matrices, right)}


def rows():
    """(mistake, error, message) of each."""
    for mistake, make in (MISTAKES | with_torch()).items():
        try:
            make()
        except (TypeError, ValueError, RuntimeError) as error:  # stiction.Error is a RuntimeError
            kind = type(error).__name__
            if isinstance(error, stiction.Error):
                kind = f"stiction.Error, {error.code}"
            yield mistake, kind, str(error)
        else:
            raise AssertionError(f"nothing was said to: {mistake}")


if __name__ == "__main__":
    print("| mistake | error | message |\n|---|---|---|")
    for mistake, kind, message in rows():
        print(f"| {mistake} | {kind} | `{message}` |")
