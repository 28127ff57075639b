#!/usr/bin/env python3
"""Records piles that fall, for a viewer: bodies, contacts, forces, friction cones, slip, islands, residuals.

    pip install rerun-sdk                                       # or viser, for -o pile.html, a page for any browser
    examples/python/11_view.py [--envs 64] [--drawn 2] [--steps 120] [-o pile.rrd]
    rerun pile.rrd
"""

import argparse
import sys

import numpy as np

import stiction
import stiction.monitor
import stiction.view


def make_world(envs, seed=0):
    """Boxes, balls and capsules above a floor, thrown differently in each environment."""
    kinds = [("box", (0.09, 0.07, 0.05)), ("sphere", 0.08), ("capsule", (0.05, 0.08))]
    shapes = [stiction.Shape(*kinds[k % 3], body=k, mu=0.5) for k in range(8)]
    places = [(0.2 * (k % 2), 0.2 * (k // 2 % 2), 0.15 + 0.25 * (k // 4)) for k in range(8)]
    bodies = [stiction.Body.solid(shape, 1000.0, position=place) for shape, place in zip(shapes, places)]
    world = stiction.World(bodies, [stiction.Shape("plane", mu=0.6), *shapes], envs, tolerance=1e-6, max_iterations=500)
    world.reset(twist=np.random.default_rng(seed).normal(scale=0.7, size=(envs, len(bodies), 6)))
    return world


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--envs", type=int, default=64)
    parser.add_argument("--drawn", type=int, default=2, help="environments that are drawn")
    parser.add_argument("--steps", type=int, default=120)
    parser.add_argument("-o", "--out", default="pile.rrd")
    options = parser.parse_args()
    world = make_world(options.envs)
    try:
        recorder = stiction.view.Recorder(options.out, envs=options.drawn)
    except ImportError as missing:
        print(f"NOT run: {missing}")
        sys.exit(77)
    with recorder:
        for _ in stiction.monitor.Progress(range(options.steps), title="recording", unit="step"):
            world.step()
            recorder.log(world)
    print(f"{options.steps} steps of {options.envs} environments, {min(options.drawn, options.envs)} drawn; "
          f"hash {world.hash()}; look: {'rerun ' if options.out.endswith('.rrd') else ''}{options.out}")


if __name__ == "__main__":
    main()
