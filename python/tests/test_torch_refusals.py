"""What stiction.torch refuses at the call, or where a derivative that there is not is asked for."""

import pytest

torch = pytest.importorskip("torch", reason="PyTorch is not installed: what stiction.torch refuses is NOT tested")

from stiction.torch import solve  # noqa: E402

A, B = torch.eye(3, dtype=torch.float64)[None], torch.tensor([[-1.0, 0.2, 0.1]], dtype=torch.float64)


@pytest.mark.parametrize("kind", ["box_friction", "semidefinite"])
def test_cones_without_a_derivative_do_not_pass_zeros_for_one(kind):
    b = B.clone().requires_grad_()
    lambda_ = solve(A, b, 0.5, cones=[(kind, 3)])[0]
    assert lambda_.abs().sum() > 0
    with pytest.raises(RuntimeError, match=f"cones: expected cones that have a derivative, got {kind}"):
        lambda_.sum().backward()


@pytest.mark.parametrize("make, error, message", [
    (lambda: solve(A.numpy(), B), TypeError, "A: expected a torch.Tensor, got ndarray"),
    (lambda: solve(A, B, kappa=-1.0), ValueError, "kappa: expected a finite number of at least 0, got -1.0"),
    (lambda: solve(A, B, kappa=float("nan")), ValueError, "kappa: expected a finite number"),
    (lambda: solve(A, B, max_iterations=1.5), TypeError, "max_iterations: expected an integer, got 1.5"),
], ids=["an array of NumPy", "kappa below 0", "kappa that is no number", "half an iteration"])
def test_mistakes_are_named(make, error, message):
    with pytest.raises(error, match=message):
        make()
