"""Every documented mistake and its message (docs/reference/python.md shows them)."""

import numpy as np
import pytest

import stiction
from stiction import AccuracyPolicy, Batch, Solver, SteppingSolver

A = np.tile(np.eye(6), (2, 1, 1))
b = np.zeros((2, 6)) - 1.0


def refused(kind, message, call):
    with pytest.raises(kind) as caught:
        call()
    assert message in str(caught.value), str(caught.value)
    return caught.value


def frozen(array):
    array.setflags(write=False)
    return array


MISTAKES = {
    "dtype": (TypeError, "b: expected float64 (2, 6) C-contiguous on cpu, got float32 (2, 6) C-contiguous on cpu",
              lambda: Batch.from_delassus(A, b.astype(np.float32))),
    "integers as numbers": (TypeError, "A: expected float32 or float64, got int64",
                            lambda: Batch.from_delassus(A.astype(np.int64), b)),
    "long doubles": (TypeError, "A: expected float32 or float64, got float128 (numpy.longdouble), which no solver computes "
                                "with: give A.astype('float64')", lambda: Batch.from_delassus(A.astype(np.longdouble), b)),
    "long doubles in a list": (TypeError, "A[0]: expected float32 or float64, got float128",
                               lambda: Batch.from_delassus([A[0].astype(np.longdouble)], [b[0]])),
    "long doubles to start from": (TypeError, "warm_start: expected float32 or float64, got float128 (numpy.longdouble)",
                                   lambda: Solver().solve(Batch.from_delassus(A, b), warm_start=b.astype(np.longdouble))),
    "two and a half rows": (TypeError, "cones: rows of friction: expected an integer, got 2.5",
                            lambda: Batch.from_delassus(A, b, cones=[("friction", 2.5), ("friction", 3.5)])),
    "half a block": (TypeError, "mass_block: expected an integer, got 1.5",
                     lambda: Batch.from_jacobian(np.zeros(6), np.ones(6), np.zeros(6), cones="unilateral", mass_block=1.5,
                                                 offsets=np.array([0, 1]), dof_offsets=np.array([0, 6]))),
    "rows of a table": (TypeError, "max_rows: expected an integer, got 2.5",
                        lambda: stiction.learning.Ridge(max_rows=2.5)),
    "shape": (ValueError, "b: expected float64 (2, 6) C-contiguous on cpu, got float64 (2, 5) C-contiguous on cpu",
              lambda: Batch.from_delassus(A, b[:, :5].copy())),
    "dimensions": (ValueError, "A: expected float64 (environments, rows, rows) C-contiguous on cpu, got float64 (6, 6)",
                   lambda: Batch.from_delassus(A[0], b)),
    "not square": (ValueError, "A: expected square matrices (environments, rows, rows), got (2, 5, 6)",
                   lambda: Batch.from_delassus(A[:, :5].copy(), b)),
    "strides": (ValueError, "got float64 (2, 6, 6) not C-contiguous on cpu: make it contiguous first "
                            "(numpy.ascontiguousarray, Tensor.contiguous)",
                lambda: Batch.from_delassus(A[:, ::-1], b)),
    "not an array": (TypeError, "A: expected an array (NumPy, PyTorch, JAX, CuPy, Warp or another that speaks DLPack), "
                                "got str", lambda: Batch.from_delassus("A", b)),
    "law": (ValueError, "law: expected 'convex' or 'coulomb', got 'dry'", lambda: Batch.from_delassus(A, b, law="dry")),
    "cone name": (ValueError, "cones: expected kinds of free, unilateral, box, friction, box_friction, semidefinite, got 'ice'",
                  lambda: Batch.from_delassus(A, b, cones=["ice"])),
    "cones that do not tile": (ValueError, "which cones of 3 rows do not tile",
                               lambda: Batch.from_delassus(A[:, :4, :4].copy(), b[:, :4].copy())),
    "too many cones": (ValueError, "cones: expected cones of at most 6 rows together, got 9",
                       lambda: Batch.from_delassus(A, b, cones=["friction"] * 3)),
    "half a cone": (ValueError, "counts[env 1]: expected rows of whole cones, got 4",
                    lambda: Batch.from_delassus(A, b, counts=np.array([3, 4], np.int32))),
    "counts of another shape": (ValueError, "counts: expected integers (2,), got int64 (3,)",
                                lambda: Batch.from_delassus(A, b, counts=np.zeros(3, np.int64))),
    "two counts": (ValueError, "counts: expected counts or cone_counts, got both",
                   lambda: Batch.from_delassus(A, b, counts=np.zeros(2, np.int32), cone_counts=np.zeros(2, np.int32))),
    "offsets backwards": (ValueError, "offsets: expected numbers that lead from 0 forward",
                          lambda: Batch.from_delassus(A.reshape(-1), b.reshape(-1), offsets=np.array([0, 6, 3]))),
    "int32 offsets": (TypeError, "offsets: expected int64 (environments + 1,)",
                      lambda: Batch.from_delassus(A.reshape(-1), b.reshape(-1), offsets=np.array([0, 6, 12], np.int32))),
    "list lengths": (ValueError, "b: expected one entry per environment (2), got 1",
                     lambda: Batch.from_delassus(list(A), list(b[:1]))),
    "a list entry's dtype": (TypeError, "A[1]: expected float64, got float32",
                             lambda: Batch.from_delassus([A[0], A[1].astype(np.float32)], list(b))),
    "J and v_free": (ValueError, "v_free: expected float64 (2, 6)",
                     lambda: Batch.from_jacobian(A, A, np.zeros((2, 5)))),
    "M": (ValueError, "M: expected float64 (2, 6, 6)", lambda: Batch.from_jacobian(A, A[:, :5].copy(), b)),
    "solver": (ValueError, "solver: expected one of auto, pgs, npgs", lambda: Solver(solver="magic")),
    "multigrid on contacts": (ValueError, "'multigrid', which works on bodies alone",
                              lambda: Solver(solver="multigrid").solve(Batch.from_delassus(A, b))),
    "tolerance": (stiction.Error, "tolerance = -1.000000: must be finite and >= 0", lambda: Solver(tolerance=-1)),
    "tolerance in words": (TypeError, "tolerance: expected a number, got 'small'", lambda: Solver(tolerance="small")),
    "half an iteration": (TypeError, "max_iterations: expected an integer, got 1.5", lambda: Solver(max_iterations=1.5)),
    "more iterations than there are": (ValueError, "max_iterations: expected an integer from -2147483648 to 2147483647, got "
                                                   "2147483648", lambda: Solver(max_iterations=2**31)),
    "more threads than there are": (ValueError, "threads: expected an integer", lambda: Solver(threads=2**31)),
    "no islands": (TypeError, "islands: expected a str, got None", lambda: Solver(islands=None)),
    "blocks": (stiction.Error, "block mode 'boxes' is not known; use one of: cones, pairs, strong", lambda: Solver(blocks="boxes")),
    "blocks of another method": (stiction.Error, "blocks = pairs with solver = ipm: blocks are of sweeps",
                                 lambda: Solver(solver="ipm", blocks="pairs")),
    "asynchronous contacts": (ValueError, "asynchronous: expected a batch of bodies (Batch.from_bodies), got form 'delassus'",
                              lambda: Solver(asynchronous=True).solve(Batch.from_delassus(A, b))),
    "law as a number": (TypeError, "law: expected a str, got 3", lambda: Solver(law=3)),
    "preset as a number": (TypeError, "preset: expected a str, got 3", lambda: Solver(preset=3)),
    "room that there is not": (ValueError, "capacity: expected envs, rows, cones", lambda: Solver(capacity={"size": 1})),
    "half a sweep": (TypeError, "sweeps: expected an integer, got 2.5",
                     lambda: stiction.Derivative().unrolled_vjp(Batch.from_delassus(A, b), 2.5)),
    "more sweeps than there are": (ValueError, "sweeps: expected an integer",
                                   lambda: stiction.Derivative().unrolled_vjp(Batch.from_delassus(A, b), 2**31)),
    "rows of a loop": (ValueError, "max_rows: expected an integer", lambda: SteppingSolver(2, max_rows=2**31)),
    "preset": (stiction.Error, "navigation", lambda: Solver(preset="cooking")),
    "device": (stiction.Error, "device", lambda: Solver(device="tpu")),
    "invalid": (ValueError, "invalid: expected 'isolate' or 'reject', got 'ignore'", lambda: Solver(invalid="ignore")),
    "not a batch": (TypeError, "batch: expected a stiction.Batch, got ndarray", lambda: Solver().solve(A)),
    "out of another shape": (ValueError, "out['lambda_']: expected float64 (2, 6) C-contiguous on cpu, got float64 (2, 5)",
                             lambda: solve_into(np.zeros((2, 5)))),
    "read-only out": (ValueError, "out['lambda_']: expected a writable array, got a read-only one",
                      lambda: solve_into(frozen(np.zeros((2, 6))))),
    "unknown out": (ValueError, "out: expected lambda_, w, velocities and status, got 'forces'",
                    lambda: Solver().solve(Batch.from_delassus(A, b), out={"forces": b})),
    "warm start": (ValueError, "warm_start: expected float64 (2, 6)",
                   lambda: Solver().solve(Batch.from_delassus(A, b), warm_start=np.zeros((2, 3)))),
    "warm velocities of another form": (ValueError, "warm_velocities: expected None for a batch of form 'delassus'",
                                        lambda: Solver().solve(Batch.from_delassus(A, b), warm_velocities=b)),
    "warm velocities": (ValueError, "warm_velocities: expected float64 (2, 6)",
                        lambda: Solver().solve(Batch.from_jacobian(A, A, b), warm_velocities=np.zeros((2, 5)))),
    "stream": (TypeError, "stream: expected None, an int, a stream of PyTorch, CuPy or Warp, or an object with "
                          "__cuda_stream__, got str",
               lambda: Solver(device="emulated").solve(Batch.from_delassus(A, b), stream="main")),
    "freed stream": (stiction.Error, "a stream that is not there",
                     lambda: Solver(device="emulated").solve(Batch.from_delassus(A, b), stream=0xDEAD)),
    "NaN, not isolated": (stiction.Error, "A[env 0, cone 0, row 0, column 0] = nan: must be finite",
                          lambda: Solver(invalid="reject").solve(Batch.from_delassus(A * np.nan, b))),
    "capacity": (ValueError, "batch: expected at most 1 environments, 6 rows and",
                 lambda: SteppingSolver(1, max_rows=6).step(Batch.from_delassus(A, b),
                                                                   np.zeros((2, 2), np.uint64), 0.01)),
    "capacity of Jacobians": (ValueError, "batch: expected at most 1 environments, 6 rows and",
                              lambda: SteppingSolver(1, max_rows=6, form="jacobian").step(
                                  Batch.from_jacobian(A, A, b), np.zeros((2, 2), np.uint64), 0.01)),
    "degrees of freedom": (ValueError, "batch: expected at most 5 degrees of freedom in an environment, got 6",
                           lambda: SteppingSolver(2, max_rows=6, max_dofs=5, form="jacobian").step(
                               Batch.from_jacobian(A, A, b), np.zeros((2, 2), np.uint64), 0.01)),
    "no degrees of freedom": (ValueError, "max_dofs: expected the degrees of freedom of the largest environment",
                              lambda: SteppingSolver(2, "emulated", max_rows=6, form="jacobian")),
    "capacity of bodies": (ValueError, "batch: expected at most 1 environments, 3 rows and 1 cones, got 1, 6 and 2",
                           lambda: SteppingSolver(1, max_rows=3, form="bodies").step(
                               one_body(2), np.zeros((1, 2), np.uint64))),
    "ids of bodies": (ValueError, "ids: expected uint64 (1, 2)",
                      lambda: SteppingSolver(1, max_rows=6, form="bodies").step(
                          one_body(2), np.zeros((1, 3), np.uint64))),
    "another dt than the bodies'": (ValueError, "dt: expected that of the batch of bodies, 0.005, or None, got 0.01",
                                    lambda: SteppingSolver(1, max_rows=6, form="bodies").step(
                                        one_body(2), np.zeros((1, 2), np.uint64), 0.01)),
    "no dt": (ValueError, "dt: expected the length of the step [s], got None",
              lambda: SteppingSolver(2, max_rows=6).step(Batch.from_delassus(A, b), np.zeros((2, 2), np.uint64))),
    "another form": (ValueError, "batch: expected form 'jacobian', for which the solver was made, got 'delassus'",
                     lambda: SteppingSolver(2, max_rows=6, form="jacobian").step(
                         Batch.from_delassus(A, b), np.zeros((2, 2), np.uint64), 0.01)),
    "no form": (ValueError, "form: expected 'delassus', 'jacobian' or 'bodies', got 'pyramids'",
                lambda: SteppingSolver(2, max_rows=6, form="pyramids")),
    "multigrid in a loop": (ValueError, "'multigrid', which works on bodies alone",
                            lambda: SteppingSolver(2, max_rows=6, solver="multigrid")),
    "ids": (TypeError, "ids: expected uint64 (2, 2)",
            lambda: SteppingSolver(2, max_rows=6).step(Batch.from_delassus(A, b), np.zeros((2, 2), np.int32), 0.01)),
    "step of no length": (stiction.Error, "dt", lambda: SteppingSolver(2, max_rows=6).step(
        Batch.from_delassus(A, b), np.arange(4, dtype=np.uint64).reshape(2, 2), 0.0)),
    "mask": (ValueError, "mask: expected bool (2,)",
             lambda: SteppingSolver(2, max_rows=6).reset(mask=np.zeros(3, bool))),
    "reset beyond": (stiction.Error, "5", lambda: SteppingSolver(2, max_rows=6).reset(ids=[5])),
    "no progress": (ValueError, "progress: expected the share of the training", lambda: AccuracyPolicy.curriculum().apply()),
    "late curriculum": (ValueError, "stages: expected the first to begin at progress 0",
                        lambda: AccuracyPolicy.curriculum([(0.5, 10, 1e-3)])),
    "env_tolerance": (TypeError, "env_tolerance: expected float64 (2,)",
                      lambda: Batch.from_delassus(A, b, env_tolerance=np.zeros(2, np.float32))),
    "no such file": (stiction.Error, "nowhere.h5", lambda: Batch.from_file("nowhere.h5")),
}


def one_body(contacts):
    """A body on the floor with that many contacts under it."""
    points = np.zeros((1, contacts, 3))
    return Batch.from_bodies(np.ones((1, 1)), np.array([[[1.0, 0, 0, 1, 0, 1]]]), np.zeros((1, 1, 6)),
                             np.full((1, contacts), -1, np.int32), np.zeros((1, contacts), np.int32), points, points,
                             points + [0.0, 0, 1], np.ones((1, contacts)), np.zeros((1, contacts)))


def solve_into(lambda_):
    Solver().solve(Batch.from_delassus(A, b), out={"lambda_": lambda_, "status": np.zeros((2, 32), np.uint8)})


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_named(mistake):
    refused(*MISTAKES[mistake])


def test_errors_say_their_code():
    assert refused(stiction.Error, "", lambda: Solver(tolerance=-1)).code == "invalid_argument"
    assert refused(stiction.Error, "", lambda: Batch.from_file("nowhere.h5")).code == "io"
    assert issubclass(stiction.Error, RuntimeError)


def test_kernels_that_no_build_has_are_refused_with_those_that_there_are(monkeypatch):
    monkeypatch.setenv("STICTION_ISA", "mmx")
    refused(stiction.Error, "STICTION_ISA = 'mmx': expected one of widest, ", Solver)
    said = str(refused(stiction.Error, "", Solver))
    names = said.split("expected one of ")[1].split(", the kernels of this build")[0].split(", ")
    assert len(names) > 1
    for name in names:
        monkeypatch.setenv("STICTION_ISA", name)
        Solver()


def test_a_gpu_that_is_not_there_is_refused_with_the_reason():
    if any(report["device"].startswith("cuda") and report["usable"] for report in stiction.devices()):
        pytest.skip("there is a GPU")
    assert refused(stiction.Error, "is not usable", lambda: Solver(device="cuda")).code in ("no_device", "unsupported")


def test_an_attribute_that_is_not_there_is_named():
    refused(AttributeError, "has no 'J'; it has A, b", lambda: Batch.from_delassus(A, b).J)


def test_an_environment_that_is_not_there_is_named():
    refused(IndexError, "env: expected 0 to 1, got 2", lambda: Solver().solve(Batch.from_delassus(A, b))[2])


def test_refused_calls_leave_the_answer_alone():
    out = {"lambda_": np.full((2, 6), 3.0), "status": np.zeros((2, 32), np.uint8)}
    with pytest.raises(stiction.Error):
        Solver(invalid="reject").solve(Batch.from_delassus(A * np.nan, b), out=out)
    assert (out["lambda_"] == 3).all()
