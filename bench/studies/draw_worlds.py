#!/usr/bin/env python3
"""Pictures of stepped worlds from the side: the pile at three instants, the walker's spokes every 0.4 s.

    bench/studies/draw_worlds.py build/bin/stiction [-o docs/images/worlds.png]
"""

import argparse
import csv
import io
import subprocess

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.patches  # noqa: E402  the backend has to be chosen first
import matplotlib.pyplot as plt  # noqa: E402
from scipy.spatial import ConvexHull  # noqa: E402

COLOURS = ["tab:blue", "tab:orange", "tab:green"]
BIN_HALF = 0.35
SPOKES, LENGTH = 8, 1.0


def pile_shape(body):
    """(kind, sizes) of a body of scene `pile`, as scenes/worlds.cpp makes it."""
    grown = 1 + 0.1 * (body // 3)
    return [("sphere", [0.08 * grown]), ("capsule", [0.05 * grown, 0.08 * grown]),
            ("box", [0.09 * grown, 0.07 * grown, 0.05 * grown])][body % 3]


def states(stiction, scene, steps, every):
    """{step: [(position, rotation), ...]} of environment 0."""
    command = [stiction, "step", scene, "--envs", "1", "--steps", str(steps), "--every", str(every), "-o", "-", "--quiet"]
    text = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    found = {}
    for row in csv.DictReader(io.StringIO(text)):
        w, x, y, z = (float(row["q" + name]) for name in "wxyz")
        rotation = np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                             [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                             [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])
        found.setdefault(int(row["step"]), []).append((np.array([float(row[k]) for k in "xyz"]), rotation))
    return found


def outline(kind, size, position, rotation):
    """Corners of the shape's outline in the plane of x and z."""
    if kind == "box":
        corners = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)]) * size
        points = (position + corners @ rotation.T)[:, [0, 2]]
    else:
        angle = np.linspace(0, 2 * np.pi, 60)
        circle = size[0] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        half = rotation[:, 2] * size[1] if kind == "capsule" else np.zeros(3)
        points = np.concatenate([circle + (position + sign * half)[[0, 2]] for sign in (-1, 1)])
    return points[ConvexHull(points).vertices]


def draw_pile(axis, bodies, title):
    for body in sorted(range(len(bodies)), key=lambda k: -bodies[k][0][1]):  # the nearer ones on top
        kind, size = pile_shape(body)
        axis.add_patch(matplotlib.patches.Polygon(outline(kind, size, *bodies[body]), facecolor=COLOURS[body % 3],
                                                  edgecolor="black", linewidth=0.8, alpha=0.9))
    axis.plot([-BIN_HALF, -BIN_HALF, BIN_HALF, BIN_HALF], [0.5, 0, 0, 0.5], color="black")
    axis.set(xlim=(-0.45, 0.45), ylim=(-0.05, 1.2), aspect="equal", title=title, xlabel="x [m]")


def draw_walker(axis, found, dt):
    slope = np.arctan(0.1)
    down = np.array([[np.cos(slope), np.sin(slope)], [-np.sin(slope), np.cos(slope)]])  # the ground is z = 0 in the scene
    for step, bodies in found.items():
        position, rotation = bodies[0]
        for spoke in range(SPOKES):
            angle = np.pi / SPOKES + spoke * 2 * np.pi / SPOKES
            foot = position + rotation @ (LENGTH * np.array([np.sin(angle), 0, -np.cos(angle)]))
            line = np.stack([position[[0, 2]], foot[[0, 2]]]) @ down.T
            axis.plot(*line.T, color=plt.cm.viridis(step / max(found)), linewidth=1)
    ends = np.array([[-1, 0], [max(bodies[0][0][0] for bodies in found.values()) + 1, 0]]) @ down.T
    axis.plot(*ends.T, color="black")
    axis.set(aspect="equal", title=f"walker, every {dt:g} s", xlabel="x [m]")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("stiction")
    parser.add_argument("-o", "--output", default="docs/images/worlds.png")
    arguments = parser.parse_args()
    figure = plt.figure(figsize=(11, 7.5), layout="constrained")
    grid = figure.add_gridspec(2, 3, height_ratios=[1.3, 1])
    pile = states(arguments.stiction, "pile", 400, 10)
    for column, step in enumerate((0, 80, 400)):
        draw_pile(figure.add_subplot(grid[0, column]), pile[step], f"pile, {step * 0.005:g} s")
    draw_walker(figure.add_subplot(grid[1, :]), states(arguments.stiction, "walker", 2000, 200), 0.4)
    figure.savefig(arguments.output, dpi=110)


if __name__ == "__main__":
    main()
