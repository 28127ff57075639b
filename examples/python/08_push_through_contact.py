"""A push that is planned through contact: one ball rolls into another, which is to be at a goal when time is up. The
forces of all steps are found by gradient descent, for several goals side by side.

The derivative of where the second ball ends goes back through every step, friction with the floor included. It goes
through the impact, without which no force on the first ball would reach the second one.
"""

import numpy as np

import stiction

GOALS = np.array([0.3, 0.4, 0.5, 0.6])  # of the second ball [m]
STEPS, ROUNDS = 60, 12


def make_world():
    floor = stiction.Shape("plane", mu=0.5)
    balls = [stiction.Shape("sphere", 0.1, body=body, mu=0.5) for body in (0, 1)]
    bodies = [stiction.Body.solid(ball, 1000.0, position=(x, 0, 0.1)) for ball, x in zip(balls, (-0.25, 0.0))]
    return stiction.World(bodies, [floor, *balls], len(GOALS), dt=0.01, cfm=1e-5, tolerance=1e-10, max_iterations=2000)


def plan(world, force):
    """(loss of each goal, its derivative by the force of each step)."""
    world.reset()
    wrench = np.zeros((STEPS, len(GOALS), 2, 6))
    wrench[:, :, 0, 0] = force
    steps = [stiction.WorldStep(world, push) for push in wrench]
    miss = world.state().position[:, 1, 0] - GOALS
    position, twist = np.zeros((len(GOALS), 2, 3)), np.zeros((len(GOALS), 2, 6))
    position[:, 1, 0] = 2 * miss
    by_force = np.empty_like(force)
    for k in reversed(range(STEPS)):
        gradients = steps[k].vjp(position=position, twist=twist)
        position, twist, by_force[k] = gradients.position, gradients.twist, gradients.wrench[:, 0, 0]
    return miss ** 2, by_force


def main():
    world = make_world()
    force = np.zeros((STEPS, len(GOALS)))
    force[:20] = 20.0  # enough to reach the other ball
    losses = []
    for _ in stiction.monitor.Progress(range(ROUNDS), title="planning", unit="round"):
        loss, gradient = plan(world, force)
        losses.append(loss)
        force = force - loss / (gradient ** 2).sum(0) * gradient  # Polyak's step: the least loss is known, 0
    losses.append(plan(world, force)[0])
    for goal, first, last, x in zip(GOALS, losses[0], losses[-1], world.state().position[:, 1, 0]):
        print(f"goal {goal:.1f} m: loss {first:.5f} -> {last:.1e}, the ball ends at {x:.3f} m")
    assert (losses[-1] < 0.01 * losses[0]).all(), "gradient descent did not lower the loss a hundredfold"


if __name__ == "__main__":
    main()
