#!/usr/bin/env python3
"""Newton's loop with stiction as its solver: a box on a slope in each world, with a friction of its own.

    pip install newton
    examples/python/09_newton.py [--worlds 16] [--slope 0.5] [--law coulomb]

Prints how far each box has slid in a second, the formula's distance, and the outcome of the last solve of each world.
"""

import argparse
import math
import sys

import numpy as np

try:
    import newton
    import warp as wp

    from stiction.newton import SolverStiction
except ImportError as error:
    print(f"NOT run, because this example needs newton: {error}")
    sys.exit(77)

G, DT, STEPS = 9.81, 0.005, 200


def build(frictions, slope):
    """A model of one box on a plane in each world; gravity leans by the slope."""
    builder = newton.ModelBuilder()
    builder.default_shape_cfg.mu = 0.0  # a contact has the mean of both shapes' friction
    builder.add_ground_plane()
    for friction in frictions:
        builder.begin_world()
        builder.default_shape_cfg.mu = 2 * friction
        body = builder.add_body(xform=wp.transform((0, 0, 0.1), wp.quat_identity()))
        builder.add_shape_box(body, hx=0.2, hy=0.2, hz=0.1)
        builder.end_world()
    model = builder.finalize(device="cpu")
    angle = math.atan(slope)
    model.set_gravity((G * math.sin(angle), 0, -G * math.cos(angle)))
    return model, angle


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--worlds", type=int, default=16)
    parser.add_argument("--slope", type=float, default=0.5)
    parser.add_argument("--law", choices=("coulomb", "convex"), default="coulomb")
    options = parser.parse_args()
    wp.config.quiet = True
    frictions = np.linspace(0, 2 * options.slope, options.worlds)
    model, angle = build(frictions, options.slope)

    solver = SolverStiction(model, law=options.law, tolerance=1e-6)
    pipeline = newton.CollisionPipeline(model, contact_matching="latest")
    contacts = pipeline.contacts()
    state, other = model.state(), model.state()
    for _ in range(STEPS):
        state.clear_forces()
        pipeline.collide(state, contacts)
        solver.step(state, other, None, contacts, DT)
        state, other = other, state

    slid = state.joint_q.numpy().reshape(options.worlds, 7)[:, 0]
    pull = np.maximum(0, G * (math.sin(angle) - frictions * math.cos(angle)))
    expected = pull * DT ** 2 * STEPS * (STEPS + 1) / 2  # of steps that end with their velocity
    print("friction  slid [m]  formula [m]  code  iterations  residual")
    for world, record in enumerate(solver.status):
        print(f"{frictions[world]:8.3f}  {slid[world]:8.4f}  {expected[world]:11.4f}  {record['code']:4d}  "
              f"{record['iterations']:10d}  {record['residual']:.1e}")
    if options.law == "coulomb" and not np.allclose(slid, expected, atol=1e-3):
        sys.exit("a box slid otherwise than the formula says")


if __name__ == "__main__":
    main()
