#!/usr/bin/env python3
"""MuJoCo Warp's loop with stiction as its constraint solver: a box in each world, pushed up a slope.

    pip install mujoco-warp
    examples/python/12_mujoco_warp.py [--worlds 8] [--njmax 32] [--cone elliptic]

Prints how each world's last solve ended, beside the answer of MuJoCo Warp's own solver from the same states. With
--njmax 8 there is no room for all contacts, which the status shows.
"""

import argparse
import sys

import numpy as np

try:
    import mujoco
    import mujoco_warp
    import warp as wp

    import stiction
    import stiction.mujoco_warp
except ImportError as error:
    print(f"NOT run, because this example needs mujoco_warp: {error}")
    sys.exit(77)

SCENE = """
<mujoco><option timestep="0.004" cone="{cone}" gravity="2 0 -9.6"/><worldbody>
  <geom type="plane" size="9 9 1" friction="0.5"/>
  <body pos="0 0 .1"><freejoint/><geom type="box" size=".1 .1 .1" friction="0.5"/></body>
</worldbody></mujoco>"""


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--worlds", type=int, default=8)
    parser.add_argument("--njmax", type=int, default=32)
    parser.add_argument("--cone", choices=("elliptic", "pyramidal"), default="elliptic")
    parser.add_argument("--steps", type=int, default=60)
    options = parser.parse_args()
    wp.config.quiet = True
    model = mujoco.MjModel.from_xml_string(SCENE.format(cone=options.cone))
    m = mujoco_warp.put_model(model)
    m.opt.warn_overflow = 0  # the status has it, world by world
    d = mujoco_warp.make_data(model, nworld=options.worlds, nconmax=8, njmax=options.njmax)
    qvel = np.zeros((options.worlds, model.nv), np.float32)
    qvel[:, 0] = np.linspace(0, -2, options.worlds)
    d.qvel.assign(qvel)

    for _ in range(options.steps):
        solution = stiction.mujoco_warp.step(m, d)

    mujoco_warp.forward(m, d)  # with its own solver, at the states that the last step has led to
    theirs = d.qacc.numpy().copy()
    solution = stiction.mujoco_warp.solve(m, d)
    difference = np.abs(d.qacc.numpy() - theirs).max(axis=1)
    print("world  rows  x [m]    code    flags              iterations  residual  difference of qacc [m/s2, rad/s2]")
    for world, record in enumerate(solution.status):
        flags = " ".join(name for bit, name in enumerate(stiction.FLAGS) if record["flags"] & 1 << bit) or "-"
        print(f"{world:5d}  {d.nefc.numpy()[world]:4d}  {d.qpos.numpy()[world, 0]:7.4f}  "
              f"{stiction.CODES[record['code']]:6s}  {flags:17s}  {record['iterations']:10d}  "
              f"{record['residual']:8.1e}  {difference[world]:.1e}")
    if not solution.solved.all():
        sys.exit("a world was not solved")


if __name__ == "__main__":
    main()
