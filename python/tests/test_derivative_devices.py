"""Derivatives of batches in device memory, which the emulated device takes anywhere: those of the CPU, bit for bit."""

import importlib

import numpy as np
import pytest
from frameworks import framework

import stiction

ENVS, CONTACTS, DOFS = 4, 3, 7


def contact_batch(dtype=np.float64, counted=True, environments=ENVS):
    rng = np.random.default_rng(3)
    rows = 3 * CONTACTS
    J = rng.normal(size=(environments, rows, rows + 1)).astype(dtype)
    counts = np.resize(np.array([3, 1, 2, 3], np.int32), environments) if counted else None
    return stiction.Batch.from_delassus(
        J @ J.transpose(0, 2, 1), rng.normal(size=(environments, rows)).astype(dtype), mu=0.5, law="coulomb",
        R=np.full((environments, rows), 0.01, dtype), cone_counts=counts)


def jacobian_batch():
    rng = np.random.default_rng(5)
    M = np.tile(np.eye(DOFS), (ENVS, 1, 1)) * rng.uniform(1, 2, (ENVS, 1, 1))
    return stiction.Batch.from_jacobian(rng.normal(size=(ENVS, 6, DOFS)), M, rng.normal(size=(ENVS, DOFS)), mu=0.7,
                                        R=np.full((ENVS, 6), 0.01))


def solved(batch):
    tolerance = 1e-8 if batch.dtype == "float64" else 1e-4
    return stiction.Solver(solver="npgs", tolerance=tolerance, threads=1).solve(batch)


def losses(shape, dtype, sets=2):
    return np.random.default_rng(7).normal(size=(sets, *shape)).astype(dtype)


def expect_same(found, expected):
    assert vars(found).keys() == vars(expected).keys()
    np.testing.assert_array_equal(found.status, expected.status)
    assert expected.valid.all()
    for name, array in vars(expected).items():
        if name != "status":
            assert array.any() or name in ("lo", "hi")  # no cone has bounds
            np.testing.assert_array_equal(getattr(found, name), array, err_msg=name)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("kappa", [0.0, 1e-3])
def test_contact_batches_have_the_cpus_derivatives(dtype, kappa):
    batch = contact_batch(dtype)
    solution = solved(batch)
    bar = losses(batch.layout.row_shape, dtype)
    host, device = (stiction.Derivative(name, kappa=kappa, threads=1) for name in ("cpu", "emulated"))
    assert (host.device, device.device) == ("cpu", "emulated")
    expect_same(device.vjp(batch, solution, lambda_=bar, w=bar[::-1].copy()),
                host.vjp(batch, solution, lambda_=bar, w=bar[::-1].copy()))
    expect_same(device.jvp(batch, solution, b=bar), host.jvp(batch, solution, b=bar))


@pytest.mark.parametrize("kappa", [0.0, 1e-3])
def test_jacobians_have_the_cpus_derivatives(kappa):
    batch = jacobian_batch()
    solution = solved(batch)
    bar = losses(batch.dof_shape, np.float64)
    host, device = (stiction.Derivative(name, kappa=kappa, threads=1) for name in ("cpu", "emulated"))
    expect_same(device.vjp(batch, solution, velocities=bar), host.vjp(batch, solution, velocities=bar))
    expect_same(device.jvp(batch, solution, v_free=bar), host.jvp(batch, solution, v_free=bar))


def test_sweeps_have_the_cpus_derivatives():
    batch = contact_batch()
    bar = losses(batch.layout.row_shape, np.float64, sets=1)[0]
    host, device = stiction.Derivative(threads=1), stiction.Derivative("emulated")
    for sweeps in (3, 9, 5):  # more room, and then no less
        expect_same(device.unrolled_vjp(batch, sweeps, warm_start=0.1 * bar, lambda_=bar),
                    host.unrolled_vjp(batch, sweeps, warm_start=0.1 * bar, lambda_=bar))


def test_room_grows_with_the_batches():
    device, host = stiction.Derivative("emulated"), stiction.Derivative(threads=1)
    small = stiction.Batch.from_delassus(np.eye(3)[None], np.array([[-1.0, 0.2, 0.1]]), mu=0.5)
    for batch in (small, contact_batch(environments=9), jacobian_batch(), small):
        solution = solved(batch)
        bar = losses(batch.layout.row_shape, np.float64, sets=1)[0]
        found, expected = (one.vjp(batch, solution, lambda_=bar) for one in (device, host))
        np.testing.assert_array_equal(found.status, expected.status)
        for name, array in vars(expected).items():
            np.testing.assert_array_equal(getattr(found, name), array, err_msg=name)


def test_flat_batches_are_measured_where_their_structure_can_be_read():
    padded = contact_batch(counted=False)
    A, b = padded.arrays["A"], padded.arrays["b"]
    batch = stiction.Batch.from_delassus([A[0], A[1][:3, :3]], [b[0], b[1][:3]], mu=0.5, law="coulomb")
    solution = solved(batch)
    bar = losses(batch.layout.row_shape, np.float64, sets=1)[0]
    expect_same(stiction.Derivative("emulated").vjp(batch, solution, lambda_=bar),
                stiction.Derivative(threads=1).vjp(batch, solution, lambda_=bar))


def test_tensors_get_tensors_where_a_device_differentiates():
    torch = framework("torch")
    host = contact_batch(counted=False)
    arrays = {name: torch.from_numpy(host.arrays[name]) for name in ("A", "b", "R")}
    batch = stiction.Batch.from_delassus(**arrays, mu=0.5, law="coulomb")
    solution = stiction.Solver(device="emulated", solver="npgs", tolerance=1e-8).solve(batch)
    bar = torch.from_numpy(losses(batch.layout.row_shape, np.float64, sets=1)[0])
    found = stiction.Derivative("emulated").vjp(batch, solution, lambda_=bar)
    assert isinstance(found.b, torch.Tensor)
    expected = stiction.Derivative(threads=1).vjp(host, solved(host), lambda_=bar.numpy())
    np.testing.assert_array_equal(found.status, expected.status)  # waits for the stream
    np.testing.assert_array_equal(found.b.numpy(), expected.b)


@pytest.mark.parametrize("derivative", ["implicit", "unrolled"])
def test_torch_differentiates_on_the_device_that_has_the_tensors(monkeypatch, derivative):
    torch = framework("torch")
    operator = importlib.import_module("stiction.torch")
    host = contact_batch(counted=False)
    weights = torch.from_numpy(losses(host.layout.row_shape, np.float64, sets=1)[0])
    iterations = {"max_iterations": 6, "tolerance": 0.0, "solver": "pgs"} if derivative == "unrolled" else \
        {"solver": "npgs", "tolerance": 1e-8}

    def gradients():
        A, b = (torch.from_numpy(host.arrays[name].copy()).requires_grad_() for name in ("A", "b"))
        lambda_, w, _ = operator.solve(A, b, torch.full_like(b, 0.5), torch.full_like(b, 0.01), law="coulomb",
                                       derivative=derivative, **iterations)
        ((lambda_ + w) * weights).sum().backward()
        return A.grad, b.grad

    expected = gradients()
    asked = []
    monkeypatch.setattr(operator, "_device_of", lambda A: asked.append(A) or "emulated")
    found = gradients()
    assert asked
    for one, other in zip(found, expected):
        assert one.abs().sum() > 0 and torch.equal(one, other)


def test_a_batch_elsewhere_and_a_device_that_is_not_there_are_refused():
    with pytest.raises(stiction.Error):
        stiction.Derivative("cuda:97")
    batch = contact_batch()
    batch.device = "cuda:0"
    with pytest.raises(ValueError, match="expected a batch on cpu, got one on cuda:0: make the Derivative with device='cuda:0'"):
        stiction.Derivative().vjp(batch, np.zeros((ENVS, 9)))
