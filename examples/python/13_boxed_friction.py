#!/usr/bin/env python3
"""A flat box under the friction of Bullet and under Coulomb's law, by stiction, by Bullet and by hand.

    pip install pybullet        (without it: stiction and the answers by hand)
    examples/python/13_boxed_friction.py

Friction is mu times the weight, on each axis (boxed) or on the whole (Coulomb). It therefore holds a box that is
pulled between the axes with 0.6 of its weight, where mu is 0.5, and Coulomb's law does not.
"""

import math

import numpy as np

import stiction

try:
    import pybullet
except ImportError:
    pybullet = None

MU, GRAVITY, STEP = 0.5, 9.81, 0.005
HALF = (0.2, 0.2, 0.02)  # of the box's edges [m]
# Name, pull along the floor in shares of the weight, its angle from the x axis, first velocity [m/s], steps, lesson.
SCENES = [("pulled along an axis", 0.6, 0.0, (0.0, 0.0), 40, "speed"),
          ("pulled between the axes", 0.6, math.pi / 4, (0.0, 0.0), 40, "speed"),
          ("slides until it stands", 0.0, 0.0, (1.5, 0.6), 100, "place")]


def gravity(pull, angle):
    return pull * GRAVITY * math.cos(angle), pull * GRAVITY * math.sin(angle), -GRAVITY


def by_hand(boxed, pull, angle, velocity, seconds, told):
    """Speed [m/s] or place [m], in continuous time."""
    if told == "speed":
        axes = max(abs(math.cos(angle)), abs(math.sin(angle)))
        return 0.0 if boxed and pull * axes <= MU else (pull - MU) * GRAVITY * seconds  # pulled along an axis, or held
    x, y = velocity
    brakes = 2 * MU * GRAVITY
    if boxed:
        return x * x / brakes, y * y / brakes
    return x * math.hypot(x, y) / brakes, y * math.hypot(x, y) / brakes


def by_stiction(boxed, pull, angle, velocity, steps, told):
    shape = stiction.Shape("box", HALF, body=0, mu=MU)
    body = stiction.Body.solid(shape, 1000.0, position=(0, 0, HALF[2]))
    world = stiction.World([body], [stiction.Shape("plane", mu=MU), shape], 1, gravity=gravity(pull, angle), dt=STEP,
                           law="boxed" if boxed else "coulomb", tolerance=1e-9, max_iterations=4000)
    world.reset(twist=np.array([[[*velocity, 0.0, 0.0, 0.0, 0.0]]]))
    world.step(count=steps)
    state = world.state()
    return math.hypot(*state.twist[0, 0, :2]) if told == "speed" else tuple(state.position[0, 0, :2])


def by_bullet(boxed, pull, angle, velocity, steps, told):
    pybullet.resetSimulation()
    pybullet.setTimeStep(STEP)
    pybullet.setGravity(*gravity(pull, angle))
    pybullet.setPhysicsEngineParameter(enableConeFriction=0 if boxed else 1, numSolverIterations=200)
    floor = pybullet.createMultiBody(0, pybullet.createCollisionShape(pybullet.GEOM_PLANE))
    box = pybullet.createMultiBody(8000.0 * HALF[0] * HALF[1] * HALF[2],
                                   pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=HALF),
                                   basePosition=[0, 0, HALF[2]])
    for one, mu in ((floor, 1.0), (box, MU)):  # a pair of Bullet's has the product of its two
        pybullet.changeDynamics(one, -1, lateralFriction=mu, linearDamping=0, angularDamping=0)
    pybullet.resetBaseVelocity(box, [*velocity, 0])
    for _ in range(steps):
        pybullet.stepSimulation()
    speed, place = pybullet.getBaseVelocity(box)[0], pybullet.getBasePositionAndOrientation(box)[0]
    return math.hypot(*speed[:2]) if told == "speed" else place[:2]


def text(value):
    return " ".join(f"{abs(number):.3f}" for number in np.atleast_1d(value))


def main():
    if pybullet is None:
        print("Bullet is NOT run: no pybullet")
    else:
        pybullet.connect(pybullet.DIRECT)
    print("| box of mu 0.5 | law | by hand | stiction | Bullet |\n|---|---|---|---|---|")
    for name, pull, angle, velocity, steps, told in SCENES:
        for boxed in (True, False):
            hand = by_hand(boxed, pull, angle, velocity, steps * STEP, told)
            ours = by_stiction(boxed, pull, angle, velocity, steps, told)
            theirs = "-" if pybullet is None else text(by_bullet(boxed, pull, angle, velocity, steps, told))
            print(f"| {name}: {told} | {'boxed' if boxed else 'coulomb'} | {text(hand)} | {text(ours)} | {theirs} |")
            # A step's way, or rounding.
            assert np.allclose(ours, hand, atol=1e-6 if told == "speed" else math.hypot(*velocity) * STEP), (name, boxed)


if __name__ == "__main__":
    main()
