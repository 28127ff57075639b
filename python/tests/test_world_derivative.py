"""Derivatives of a world's step and of rollouts: against finite differences of the steps themselves."""

import numpy as np
import pytest
from worlds import heap, solids, started

from stiction import Body, Shape, World, WorldStep


def after(make, begin, shapes=None):
    world = make() if shapes is None else make(shapes)
    world.reset(position=begin.position, orientation=begin.orientation, twist=begin.twist)
    world.step(begin.wrench)
    return world.state()


def moved(begin, name, by):
    other = type(begin)(**vars(begin))
    setattr(other, name, getattr(begin, name) + by)
    return other


@pytest.mark.parametrize("restitution", [0.0, 0.6])
@pytest.mark.parametrize("law", ["convex", "coulomb"])
def test_a_steps_derivative_is_that_of_differences(law, restitution):
    make, begin, shapes = heap(restitution=restitution, law=law)
    rng = np.random.default_rng(5)
    by_twist, by_position = rng.normal(size=begin.twist.shape), rng.normal(size=begin.position.shape)
    world = make()
    world.reset(position=begin.position, orientation=begin.orientation, twist=begin.twist)
    step = WorldStep(world, begin.wrench)
    assert len(world.contacts()) > 8 * 5
    gradients = step.vjp(twist=by_twist, position=by_position)
    assert gradients.valid.all() and not gradients.flagged("subgradient").any()
    assert gradients.status["forward_residual"].max() < 1e-11

    def loss(state):
        return (state.twist * by_twist).sum() + (state.position * by_position).sum()

    size = 1e-6
    for name, scale in (("twist", 1.0), ("wrench", 100.0)):
        along = scale * rng.normal(size=begin.twist.shape)
        differences = (loss(after(make, moved(begin, name, size * along)))
                       - loss(after(make, moved(begin, name, -size * along)))) / (2 * size)
        found = getattr(gradients, name) * along
        assert abs(differences - found.sum()) < 1e-6 * np.abs(found).sum(), name
    for place, shape in enumerate(shapes):
        other = [[Shape(**vars(s) | {"mu": s.mu + sign * size}) if s is shape else s for s in shapes] for sign in (1, -1)]
        differences = (loss(after(make, begin, other[0])) - loss(after(make, begin, other[1]))) / (2 * size)
        found = gradients.friction[:, place]
        assert abs(differences - found.sum()) < 1e-5 * np.abs(found).sum() + 1e-9, place


@pytest.mark.parametrize("law", ["convex", "coulomb"])
def test_kappa_tells_of_a_floor_that_is_not_reached(law):
    """A ball above the floor, whose contact is found and open. With kappa its speed after the step follows that before
    by less than all of it, by the contact's own equation."""
    kappa, dt, gap, speed = 1e-3, 1e-2, 2e-3, -0.05
    ball, floor = Shape("sphere", 0.1, body=0, mu=0.5), Shape("plane", mu=0.5)
    body = solids(ball)[0]
    slopes, states = [], []
    for relaxed in (0.0, kappa):
        world = World([body], [floor, ball], 1, dt=dt, margin=0.01, law=law, tolerance=1e-12, gravity=(0, 0, 0),
                      dtype="float64")
        world.reset(position=np.array([[[0, 0, 0.1 + gap]]]), twist=np.array([[[0, 0, speed, 0, 0, 0.0]]]))
        step = WorldStep(world, kappa=relaxed)
        assert len(world.contacts()) == 1
        by = np.zeros((1, 1, 6))
        by[..., 2] = 1
        found = step.vjp(twist=by)
        assert found.valid.all()
        slopes.append(found.twist[0, 0, 2])
        states.append(world.state().twist.copy())
    np.testing.assert_array_equal(*states)
    assert slopes[0] == 1.0
    assert 0.5 < slopes[1] < 0.999


def test_single_precision_has_the_derivative_of_double_to_its_own_rounding():
    found = []
    for dtype in ("float64", "float32"):
        make, begin, _ = heap(dtype=dtype, tolerance=1e-6)
        world = make()
        world.reset(*(None, *(part.astype(dtype) for part in (begin.position, begin.orientation, begin.twist))))
        step = WorldStep(world, begin.wrench.astype(dtype))
        found.append(step.vjp(twist=np.ones((8, 4, 6), dtype)))
        assert found[-1].wrench.dtype == dtype and found[-1].valid.all()
    for name in ("twist", "wrench", "friction"):
        wide, narrow = (getattr(gradients, name) for gradients in found)
        assert np.abs(wide - narrow).max() < 1e-3 * np.abs(wide).max(), name


def test_a_step_that_is_kept_is_an_ordinary_step():
    kept, plain = started(cfm=1e-4), started(cfm=1e-4)
    for _ in range(30):
        WorldStep(kept)
        plain.step()
    assert kept.hash() == plain.hash()


def test_a_body_on_four_hard_corners_has_no_derivative_and_is_flagged():
    box = Shape("box", (0.1, 0.1, 0.1), body=0)
    gradients = []
    for cfm in (0.0, 1e-4):
        world = World([Body.solid(box, 1000.0, position=(0, 0, 0.1))], [Shape("plane"), box], 1, cfm=cfm,
                      tolerance=1e-10, max_iterations=5000)
        gradients.append(WorldStep(world).vjp(twist=np.ones((1, 1, 6))))
    assert gradients[0].flagged("singular").all() and not gradients[0].valid.any() and not gradients[0].twist.any()
    assert gradients[1].valid.all() and gradients[1].twist.any()


@pytest.mark.parametrize("mu", [0.0, 0.4])
def test_a_rollouts_derivative_is_that_of_differences(mu):
    """32 steps of balls that are thrown, bounce, slide and roll. With friction nothing moves them up or down: arms, which
    the derivative freezes, follow heights.
    """
    ball = Shape("sphere", 0.1, body=0, mu=mu, restitution=0.5)
    body = Body.solid(ball, 1000.0, position=(0, 0, 0.0995))
    rng = np.random.default_rng(4)
    wrench, along_wrench = rng.uniform(-2, 2, (2, 32, 3, 1, 6))
    by_twist, along_twist = rng.normal(size=(2, 3, 1, 6))
    twist = np.zeros((3, 1, 6))
    twist[:, 0, 0] = [0.2, 1.0, 2.0]
    if mu == 0:
        twist[:, 0, 2] = [-0.3, -0.5, 0.1]
    else:
        along_wrench[..., 2] = along_twist[..., 2] = 0

    def rollout(twist, wrench):
        world = World([body], [Shape("plane", mu=1.0), ball], 3, cfm=1e-3, tolerance=1e-13, max_iterations=20000)
        world.reset(twist=twist)
        return world, [WorldStep(world, force) for force in wrench]

    world, steps = rollout(twist, wrench)
    bar, by_wrench = {"twist": by_twist, "position": by_twist[..., :3].copy()}, np.zeros_like(wrench)
    for k in reversed(range(32)):
        found = steps[k].vjp(**bar)
        assert found.valid.all()
        by_wrench[k] = found.wrench
        bar = {"twist": found.twist, "position": found.position}

    def loss(twist, wrench):
        end = rollout(twist, wrench)[0].state()
        return (end.twist * by_twist).sum() + (end.position * by_twist[..., :3]).sum()

    size = 1e-6
    differences = [(loss(twist + size * along_twist, wrench) - loss(twist - size * along_twist, wrench)) / (2 * size),
                   (loss(twist, wrench + size * along_wrench) - loss(twist, wrench - size * along_wrench)) / (2 * size)]
    for found, terms in zip(differences, (bar["twist"] * along_twist, by_wrench * along_wrench)):
        assert abs(found - terms.sum()) < 1e-6 * np.abs(terms).sum()
