"""Refusals of stiction.torch at the call, or where a missing derivative is asked for."""

import pytest
from frameworks import framework

torch = framework("torch", "what stiction.torch refuses is")

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
    (lambda: solve(A, B, kappa="small"), TypeError, "kappa: expected a number, got 'small'"),
    (lambda: solve(A, B, max_iterations=1.5), TypeError, "max_iterations: expected an integer, got 1.5"),
    (lambda: solve(A, B, 0.5, 0.1), TypeError, "R: expected a torch.Tensor or None, got float"),
    (lambda: solve(A, B, counts=[3]), TypeError, "counts: expected a torch.Tensor or None, got list"),
], ids=["an array of NumPy", "kappa below 0", "kappa that is no number", "kappa in words", "half an iteration", "R as a number",
        "counts as a list"])
def test_mistakes_are_named(make, error, message):
    with pytest.raises(error, match=message):
        make()


@pytest.mark.parametrize("derivative", ["jvp", "jacfwd"])
def test_forward_mode_does_not_pass_zeros_for_a_derivative(derivative):
    reactions = lambda b: solve(A[0], b, 0.5)[0]  # noqa: E731
    with pytest.raises(RuntimeError, match="b: expected a tensor without a tangent"):
        torch.func.jvp(reactions, (B[0],), (B[0],)) if derivative == "jvp" else torch.func.jacfwd(reactions)(B[0])
