"""Worlds with default options of the solver: their steps are solved."""

import numpy as np
import pytest

from stiction import Body, Shape, World


def test_a_stack_of_light_and_heavy_boxes_stands_by_default():
    shapes, bodies = [Shape("plane", mu=0.6)], []
    for k in range(5):
        mass = 10.0 if k % 2 == 0 else 0.1
        shapes.append(Shape("box", (0.2, 0.2, 0.2), body=k, mu=0.6))
        bodies.append(Body(mass, (mass * 0.4**2 / 6,) * 3, position=(0, 0, 0.2 + 0.4 * k)))
    world = World(bodies, shapes, 1, dt=0.01)
    for _ in range(100):
        world.step()
        assert world.solved.all()
    begin = np.array([body.position for body in bodies])
    np.testing.assert_allclose(world.state().position[0], begin, atol=1e-6)


@pytest.mark.parametrize("dtype, drift", [("float64", 1e-8), ("float32", 1e-4)])
def test_a_box_that_falls_flat_bounces_straight_by_default(dtype, drift):
    floor, box = Shape("plane", mu=0.5), Shape("box", (0.5, 0.5, 0.5), body=0, mu=0.5, restitution=1.0)
    world = World([Body.solid(box, 1000.0, position=(0, 0, 2.5))], [floor, box], 1, dtype=dtype)
    fastest = 0.0
    for _ in range(300):
        world.step()
        state = world.state()
        fastest = max(fastest, state.twist[0, 0, 2])
        assert abs(state.position[0, 0, :2]).max() < drift and abs(state.orientation[0, 0, 1:]).max() < drift
    assert fastest > 6.0


@pytest.mark.parametrize("scale", [1e-4, 1e-2, 1e2])
def test_a_ball_bounces_alike_in_any_unit_of_length(scale):
    def heights(length):
        ball = Shape("sphere", 0.1 * length, body=0, restitution=0.8)
        body = Body.solid(ball, 1000.0, position=(0, 0, 0.6 * length))
        world, seen = World([body], [Shape("plane"), ball], 1, dt=0.002 * length**0.5), []  # gravity stays as it is
        for _ in range(20):
            world.step(count=25)
            seen.append(world.state().position[0, 0, 2] / length)
        return np.array(seen)

    alone = heights(1.0)
    assert alone[8:].max() > 0.3  # it has bounced
    np.testing.assert_allclose(heights(scale), alone, atol=1e-3)


def test_what_is_at_rest_does_not_bounce_by_default():
    ball = Shape("sphere", 0.1, body=0, restitution=1.0)
    world = World([Body.solid(ball, 1000.0, position=(0, 0, 0.1))], [Shape("plane"), ball], 1, dt=0.01)
    world.step(count=200)
    assert abs(world.state().position[0, 0, 2] - 0.1) < 1e-6
    with pytest.raises(Exception, match="dt = nan"):
        World([Body.solid(ball, 1000.0)], [ball], 1, dt=float("nan"))
