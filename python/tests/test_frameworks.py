"""Arrays of other frameworks, and the functions made for them. Each is skipped, and says so, where it is not installed."""

import numpy as np
import pytest
from frameworks import OtherArray, framework

import stiction
from stiction import Batch, Solver

OPTIONS = {"solver": "npgs", "tolerance": 1e-9}


@pytest.fixture
def problem():
    rng = np.random.default_rng(5)
    J = rng.normal(size=(5, 6, 9))
    return J @ J.transpose(0, 2, 1), rng.normal(size=(5, 6)) - 1


@pytest.fixture
def wanted(problem):
    return Solver(**OPTIONS).solve(Batch.from_delassus(*problem, mu=0.5, law="coulomb"))


class TestTorch:
    @pytest.fixture(autouse=True)
    def _torch(self):
        self.torch = framework("torch")

    def tensors(self, problem):
        return [self.torch.from_numpy(array.copy()) for array in problem]

    def test_tensors_are_read_and_answers_are_tensors(self, problem, wanted):
        A, b = self.tensors(problem)
        mu = self.torch.full_like(b, 0.5)
        batch = Batch.from_delassus(A, b, mu=mu, law="coulomb")
        assert batch._seen["A"].pointer == A.data_ptr() and batch._seen["mu"].pointer == mu.data_ptr()
        solution = Solver(**OPTIONS).solve(batch)
        assert isinstance(solution.lambda_, self.torch.Tensor) and solution.hash() == wanted.hash()
        out = {"lambda_": self.torch.zeros_like(b), "status": self.torch.zeros((5, 32), dtype=self.torch.uint8)}
        Solver(**OPTIONS).solve(batch, out=out)
        np.testing.assert_array_equal(out["lambda_"].numpy(), wanted.lambda_)

    def test_a_tensor_of_another_type_is_named(self, problem):
        A, b = self.tensors(problem)
        with pytest.raises(TypeError, match=r"b: expected float64 \(5, 6\) .* got float32 \(5, 6\)"):
            Batch.from_delassus(A, b.float())
        with pytest.raises(ValueError, match="not C-contiguous"):
            Batch.from_delassus(A.transpose(0, 2), b)
        with pytest.raises(TypeError, match="A: expected an array without a gradient"):
            Batch.from_delassus(A.requires_grad_(), b)

    def test_loops_take_tensors(self, problem):
        A, b = self.tensors(problem)
        solver = stiction.SteppingSolver(5, max_rows=6, beta=1.0)
        batch, ids = Batch.from_delassus(A, b, mu=0.5), self.torch.arange(10).reshape(5, 2)
        solver.step(batch, ids, 0.01)
        solver.reset(mask=self.torch.tensor([True, False, False, False, False]))
        assert (solver.step(batch, ids, 0.01).iterations[1:] == 0).all()

    def test_loops_of_jacobians_take_tensors(self):
        J = self.torch.from_numpy(np.random.default_rng(5).normal(size=(5, 6, 9)))
        batch = Batch.from_jacobian(J, self.torch.ones(5, 9).double(), -J.sum(1), mu=0.5)
        loop = stiction.SteppingSolver(5, form="jacobian", max_rows=6, beta=1.0, tolerance=1e-6)
        first, again = (loop.step(batch, self.torch.arange(10).reshape(5, 2), 0.01) for _ in range(2))
        assert isinstance(first.velocities, self.torch.Tensor) and first.iterations.max() > 0
        assert (again.iterations == 0).all()

    def test_loops_of_bodies_take_tensors(self):
        torch = self.torch
        points, normal = torch.zeros(3, 1, 3), torch.tensor([0.0, 0.0, 1.0]).repeat(3, 1, 1)
        twist = torch.tensor([1.0, 0, -1, 0, 0, 0]).repeat(3, 1, 1)
        batch = Batch.from_bodies(torch.ones(3, 1), torch.tensor([1.0, 0, 0, 1, 0, 1]).repeat(3, 1, 1), twist,
                                  torch.full((3, 1), -1, dtype=torch.int32), torch.zeros(3, 1, dtype=torch.int32),
                                  points, points, normal, torch.full((3, 1), 0.5), torch.zeros(3, 1))
        loop = stiction.SteppingSolver(3, form="bodies", max_rows=3, dtype="float32")
        solution = loop.step(batch, torch.arange(3).reshape(3, 1))
        # 1 kg that falls with 1 m/s and slides with 1 m/s over friction of 1/2 [N s, m/s].
        assert torch.allclose(solution.lambda_[:, 0].norm(dim=1), torch.tensor(1.25).sqrt(), atol=1e-3)
        assert torch.allclose(solution.velocities[:, 0, 0], torch.tensor(0.5), atol=1e-3)
        assert loop.step(batch, torch.arange(3).reshape(3, 1)).solved.all()
        assert loop.stats()["warm_start_hits"] == 3

    def test_the_operator(self, problem, wanted):
        import stiction.torch

        A, b = self.tensors(problem)
        lambda_, w, records = stiction.torch.solve(A, b, 0.5, law="coulomb", **OPTIONS)
        np.testing.assert_array_equal(lambda_.numpy(), wanted.lambda_)
        np.testing.assert_array_equal(w.numpy(), wanted.w)
        np.testing.assert_array_equal(stiction.torch.status(records), wanted.status)
        one, _, record = stiction.torch.solve(A[1], b[1], 0.5, law="coulomb", **OPTIONS)
        np.testing.assert_array_equal(one.numpy(), wanted.lambda_[1])
        assert stiction.torch.status(record)["iterations"] == wanted.iterations[1]
        rows = [("friction", 3), "box", "unilateral", "free"]
        assert stiction.torch.solve(A, b, 0.5, cones=rows)[0].shape == (5, 6)

    def test_the_operator_can_be_traced(self, problem):
        import stiction.torch

        A, b = self.tensors(problem)
        arguments = (A, b, self.torch.full_like(b, 0.5), None, None, None, None, None, "friction", "coulomb", "npgs", 1e-9, 100)
        self.torch.library.opcheck(self.torch.ops.stiction.solve.default, arguments)


class TestJax:
    @pytest.fixture(autouse=True)
    def _jax(self):
        self.jax = framework("jax")
        self.jax.config.update("jax_enable_x64", True)

    def test_arrays_are_read_where_they_are(self, problem, wanted):
        A, b = (self.jax.numpy.asarray(array) for array in problem)
        batch = Batch.from_delassus(A, b, mu=0.5, law="coulomb")
        assert batch._seen["A"].pointer == A.unsafe_buffer_pointer()
        assert Solver(**OPTIONS).solve(batch).hash() == wanted.hash()
        with pytest.raises(ValueError, match="expected a writable array"):
            Solver().solve(batch, out={"lambda_": b, "status": np.zeros((5, 32), np.uint8)})

    @pytest.mark.parametrize("by", ["custom call", "callback"])
    def test_the_function_and_its_transformations(self, problem, wanted, by):
        import stiction.jax

        if by == "custom call" and not stiction.jax.uses_ffi:
            pytest.skip("the package was built without JAX, its custom call is NOT tested: scripts/test.sh --frameworks")

        def solve(A, b):
            return stiction.jax.solve(A, b, 0.5, law="coulomb", allow_ffi=by == "custom call", **OPTIONS)

        for transformed in (solve, self.jax.jit(solve), self.jax.vmap(solve), self.jax.jit(self.jax.vmap(solve))):
            lambda_, w, records = transformed(*problem)
            np.testing.assert_array_equal(lambda_, wanted.lambda_)
            np.testing.assert_array_equal(w, wanted.w)
            np.testing.assert_array_equal(stiction.jax.status(records), wanted.status)

    def test_mistakes_come_out_of_a_compiled_function(self, problem):
        import stiction.jax

        with pytest.raises(Exception, match="solver 'magic' is not known|expected one of auto"):
            stiction.jax.solve(*problem, solver="magic")[0].block_until_ready()
        with pytest.raises(ValueError, match=r"A: expected \(..., 5, 5\), got \(5, 6, 6\)"):
            stiction.jax.solve(problem[0], problem[1][:, :5])

    def test_narrow_numbers(self, problem):
        import stiction.jax

        A, b = (array.astype(np.float32) for array in problem)
        lambda_, _, _ = stiction.jax.solve(A, b, 0.5)
        assert lambda_.dtype == np.float32


def test_any_array_that_speaks_dlpack(problem, wanted):
    batch = Batch.from_delassus(*(OtherArray(array) for array in problem), mu=0.5, law="coulomb")
    assert batch._seen["A"].pointer == problem[0].ctypes.data
    assert Solver(**OPTIONS).solve(batch).hash() == wanted.hash()


class Stream:
    def __init__(self, **attributes):
        self.__dict__.update(attributes)


@pytest.mark.parametrize("stream", [0, Stream(cuda_stream=0), Stream(ptr=0), Stream(__cuda_stream__=lambda: (0, 0))])
def test_streams_of_every_kind(problem, wanted, stream):
    solver = Solver(device="emulated", **OPTIONS)
    solution = solver.solve(Batch.from_delassus(*problem, mu=0.5, law="coulomb"), stream=stream)
    assert solution.hash() == wanted.hash()
