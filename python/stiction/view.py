"""Recordings to look at, in Rerun (`pip install rerun-sdk`): bodies, contacts, forces, friction cones, slip, islands,
residuals. docs/view.md.

    with stiction.view.Recorder("run.rrd") as recorder:     # then: rerun run.rrd
        for _ in range(200):
            world.step()
            recorder.log(world)                             # or a stiction.mujoco.BatchedSimulation

    python -m stiction.view BATCH.h5 -o batch.rrd           # a recorded batch
"""

from __future__ import annotations

import argparse
import operator
import os
import pathlib
import sys

import numpy as np

from ._batch import Batch
from ._flags import FLAGS
from ._progress import Progress
from ._solution import CODES, Solution
from ._solver import Solver
from ._view_batch import BatchSource
from ._view_frame import colours, places
from ._view_rerun import Stream, load
from ._view_world import WorldSource
from ._world import World

__all__ = ["Recorder"]

_MOST_NODES = 300  # of a graph that is drawn


class Recorder:
    """Records worlds, MuJoCo simulations and batches for Rerun's viewer. It reads, and changes no bit of what it records.

    path: of the .rrd file. None: a viewer is opened; or connect, the address of one (rerun+http://...).
    envs: how many environments are drawn, from the first; or a list of which.
    force_scale: length of an arrow by force [m/N]. None: the weight of an environment is twice as long as it is wide. Of
        a batch the largest reaction of an environment is half as long as the distance between cones.
    slip_scale: length of an arrow by speed [s]. spacing: between environments [m]. None: so that none touch.

    Raises ImportError where Rerun is missing. A recorder records one world, simulation or kind of batch.
    """

    def __init__(self, path: str | os.PathLike | None = None, *, connect: str | None = None, envs=4,
                 force_scale: float | None = None, slip_scale: float = 0.1, spacing: float | None = None):
        self._stream = Stream(None if path is None else os.fspath(path), connect)
        self._envs, self._spacing = envs, spacing
        self.force_scale, self.slip_scale = force_scale, float(slip_scale)
        self._subject, self._source, self._step = None, None, 0

    def __enter__(self) -> Recorder:
        return self

    def __exit__(self, *exception) -> None:
        self.close()

    def close(self) -> None:
        """Writes what is still in memory, and ends the recording."""
        self._stream.close()

    def log(self, subject, solution: Solution | None = None, step: int | None = None) -> None:
        """Records what a World or a BatchedSimulation is now, or all environments of a batch.

        step: of a world or a simulation: its number on the timeline, None: one more than the last.
        solution: of a batch; None: it is solved here, by "auto".
        """
        if isinstance(subject, Batch):
            return self._log_batch(subject, solution)
        if self._source is None or self._subject is not subject:
            self._begin(subject)
        self._step = self._step + 1 if step is None else operator.index(step)
        self._stream.at(step=self._step, time=float(self._step * self._source.dt))
        self._source.look()
        for env in self._drawn:
            self._log_frame(env, self._source.frame(env))
        self._log_status(self._source.status)

    # -- worlds and simulations ---------------------------------------------------------------------------------------

    def _begin(self, subject):
        """What stays: shapes, and where environments are drawn."""
        if self._source is not None:
            raise ValueError("subject: expected the one that this recorder has logged before: make another recorder")
        self._source, self._subject = _source_of(subject), subject
        source = self._source
        self._drawn = _chosen(self._envs, source.env_count)
        source.look()
        middle, extent = _span(source, self._drawn)
        if self.force_scale is None:
            self.force_scale = 2 * extent / source.weight if source.weight > 0 else 1.0
        spacing = 1.5 * extent if self._spacing is None else float(self._spacing)
        self._radius = 0.01 * extent
        up = source.up / (np.linalg.norm(source.up) or 1.0)
        stream, where = self._stream, places(len(self._drawn), spacing)
        views = stream.rr.blueprint
        stream.log(["world"], stream.rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        for env, place in zip(self._drawn, where):
            stream.log(["world", f"env_{env}"], stream.rr.Transform3D(translation=place), static=True)
            for shape in source.geometries:
                is_ground = shape.kind == "plane" and _normal(shape.orientation) @ up > 0.7
                stream.geometry(self._path(env, shape), shape, 0.48 * spacing, is_ground)
        stream.layout(
            stream.scene("world", "bodies and contacts", middle + (where.mean(axis=0) if len(where) else 0.0),
                         0.9 * (extent + where.max(initial=0.0))),
            views.TimeSeriesView(origin="log10_residual", name="log10 of the relative residual"),
            views.TimeSeriesView(origin="slip", name="fastest slip [m/s]"),
            views.TimeSeriesView(origin="iterations", name="iterations"), views.TextLogView(origin="log", name="log"))

    def _path(self, env, shape):
        part = ["ground"] if shape.body < 0 else ["bodies", self._source.bodies[shape.body]]
        return ["world", f"env_{env}", *part, shape.name]

    def _log_frame(self, env, frame):
        stream, root = self._stream, ["world", f"env_{env}"]
        for name, position, orientation in zip(self._source.bodies, frame.position, frame.orientation):
            stream.pose([*root, "bodies", name], position, orientation)
        shown = colours(frame.island)
        for shape in self._source.geometries:
            if shape.body >= 0:
                stream.colour(self._path(env, shape), shape.kind, shown[shape.body])
        stream.contacts(root, frame.contacts, self.force_scale, self.slip_scale, self._radius)
        stream.number(["slip", f"env_{env}"], np.linalg.norm(frame.contacts.finite().slip, axis=1).max(initial=0.0))

    def _log_status(self, status):
        for env in self._drawn:
            self._stream.residual(f"env_{env}", status["residual"][env])
            self._stream.number(["iterations", f"env_{env}"], status["iterations"][env])
            self._stream.trouble(f"env {env}", status[env], CODES, FLAGS)
        finite = status["residual"][np.isfinite(status["residual"])]
        if len(finite):
            self._stream.residual("median", np.median(finite))
            self._stream.residual("largest", finite.max())

    # -- batches ------------------------------------------------------------------------------------------------------

    def _log_batch(self, batch, solution):
        if self._source is not None:
            raise ValueError("batch: expected a recorder that has logged nothing: make another recorder")
        if solution is None:
            solution = Solver(solver="auto").solve(batch)
        source = self._source = BatchSource(batch, solution)
        stream, rr = self._stream, self._stream.rr
        drawn = set(_chosen(self._envs, int(source.simulation.max(initial=-1)) + 1))
        views = rr.blueprint
        stream.log(["batch"], rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        stream.layout(
            stream.scene("batch", "cones, in their own axes", (0, 0, 0), 0.8 * source.width()),
            views.TimeSeriesView(origin="log10_residual", name="log10 of the relative residual"),
            views.TimeSeriesView(origin="iterations", name="iterations"),
            views.GraphView(origin="batch", name="which cones are coupled"),
            views.BarChartView(origin="batch", name="reactions by row"), views.TextLogView(origin="log", name="log"))
        with Progress(total=source.env_count, title="recording", unit="env") as bar:
            for env in range(source.env_count):
                bar.update()
                stream.at(**{source.timeline: int(source.time[env])})
                name = f"simulation_{source.simulation[env]}"
                record = source.status[env]
                stream.residual(name, record["residual"])
                stream.number(["iterations", name], record["iterations"])
                stream.trouble(source.name(env), record, CODES, FLAGS)
                if source.simulation[env] in drawn:
                    self._log_cones(["batch", name], env)

    def _log_cones(self, path, env):
        source, stream, rr = self._source, self._stream, self._stream.rr
        contacts = source.contacts(env)
        scale = source.scale(env) if self.force_scale is None else self.force_scale
        stream.contacts(path, contacts, scale, source.slip_scale, 0.06)
        stream.log([*path, "name"], rr.TextDocument(source.name(env)))
        reactions = source.reactions(env)
        stream.log([*path, "reactions"], rr.BarChart(np.where(np.isfinite(reactions), reactions, 0.0)))
        if len(contacts.island) <= _MOST_NODES:
            stream.graph(path, contacts.island, source.couplings(env))


def _source_of(subject):
    if isinstance(subject, World):
        return WorldSource(subject)
    if "stiction.mujoco" in sys.modules and isinstance(subject, sys.modules["stiction.mujoco"].BatchedSimulation):
        from ._view_mujoco import MujocoSource
        return MujocoSource(subject)
    raise TypeError("subject: expected a stiction.World, a stiction.mujoco.BatchedSimulation or a stiction.Batch, got "
                    f"{type(subject).__name__}")


def _chosen(envs, count):
    """Which environments are drawn."""
    try:
        return list(range(min(operator.index(envs), count)))
    except TypeError:
        chosen = [operator.index(env) for env in envs]
    for env in chosen:
        if not 0 <= env < count:
            raise ValueError(f"envs: expected environments in 0..{count - 1}, got {env}")
    return chosen


def _span(source, drawn):
    """(middle, width) of an environment [m]: its bodies where they begin, and the largest shape."""
    found = [position[np.isfinite(position).all(axis=1)] for position in (source.frame(env).position for env in drawn)]
    spans = [np.ptp(position, axis=0).max() for position in found if len(position)]
    everything = np.concatenate([np.zeros((0, 3)), *found])
    middle = (everything.max(axis=0) + everything.min(axis=0)) / 2 if len(everything) else np.zeros(3)
    return middle, float(max(spans, default=0.0)) + 2 * source.reach or 1.0


def _normal(orientation):
    w, x, y, z = orientation
    return np.array([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)])


def main(arguments=None) -> int:
    """The command `python -m stiction.view`. Returns the exit status."""
    parser = argparse.ArgumentParser(prog="python -m stiction.view", description="Records a contact-batch or FCLIB file "
                                     "for Rerun: cones, reactions, residuals and couplings of every environment.")
    parser.add_argument("file", type=pathlib.Path)
    parser.add_argument("-o", "--out", type=pathlib.Path, help="the recording, default: FILE with .rrd; - opens a viewer")
    parser.add_argument("--solver", default="auto")
    parser.add_argument("--tolerance", type=float, default=1e-6)
    parser.add_argument("--simulations", type=int, default=4, help="of a trajectory, whose cones are drawn")
    options = parser.parse_args(arguments)
    out = options.file.with_suffix(".rrd") if options.out is None else options.out
    try:
        load()
        batch = Batch.from_file(options.file)
        solution = Solver(solver=options.solver, tolerance=options.tolerance).solve(batch)
        with Recorder(None if str(out) == "-" else out, envs=options.simulations) as recorder:
            recorder.log(batch, solution)
    except (ImportError, OSError, ValueError, RuntimeError) as error:
        print(f"stiction.view: {error}", file=sys.stderr)
        return 2
    if str(out) != "-":
        print(f"{len(batch)} environments, {int(solution.solved.sum())} solved: rerun {out}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
