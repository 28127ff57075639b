"""Recordings to look at, in Rerun (`pip install rerun-sdk`) or in a browser by viser (`pip install viser`): bodies,
contacts, forces, friction cones, slip, islands, residuals. docs/howto/view.md.

    with stiction.view.Recorder("run.rrd") as recorder:     # then: rerun run.rrd; or "run.html", a page by viser
        for _ in range(200):
            world.step()
            recorder.log(world)                             # or a stiction.mujoco.BatchedSimulation

    stiction view BATCH.h5 -o batch.rrd                     # a recorded batch
"""

from __future__ import annotations

import argparse
import operator
import os
import pathlib
import sys

import numpy as np

from ..core.batch import Batch
from ..core.flags import FLAGS
from ..core.progress import Progress
from ..core.solution import CODES, Solution
from ..core.solver import Solver
from ..core.world import World
from . import rerun as rerun_writer
from . import viser as viser_writer
from .batch import BatchSource
from .frame import colours, places, turned
from .world import WorldSource

__all__ = ["Recorder"]

_BACKENDS = {"rerun": rerun_writer, "viser": viser_writer}
_MOST_NODES = 300  # of a graph that is drawn


class Recorder:
    """Records worlds, MuJoCo simulations and batches for a viewer. It reads, and changes no bit of its subject.

    path: of the file: .rrd for Rerun's viewer; .html, a page for any browser, or .viser by viser. None: a viewer is
        opened, or, by viser, a page is served to browsers of this machine.
    backend: "rerun" or "viser"; None: that of the path, and "rerun" without one.
    connect: address of a viewer of Rerun's (rerun+http://...) instead of a path.
    port: of the page that viser serves, or the next one that is free.
    envs: how many environments are drawn, from the first; or a list of which.
    force_scale: length of an arrow by force [m/N]. None: the weight of an environment is twice as long as it is wide.
        In a batch the largest reaction of an environment is half as long as the distance between cones.
    slip_scale: length of an arrow by speed [s]. spacing: between environments [m]. None: so that none touch.

    Raises ImportError where the backend is missing, ValueError for a path that it does not write. A recorder records one
    world, simulation or kind of batch.
    """

    def __init__(self, path: str | os.PathLike | None = None, *, backend: str | None = None, connect: str | None = None,
                 port: int = 8080, envs=4, force_scale: float | None = None, slip_scale: float = 0.1,
                 spacing: float | None = None):
        path = None if path is None else os.fspath(path)
        backend = _backend(backend, path)
        if backend == "viser" and connect is not None:
            raise ValueError(f"connect: expected None with backend 'viser', got {connect!r}: viser serves at a port")
        self._writer = rerun_writer.RerunWriter(path, connect) if backend == "rerun" else \
            viser_writer.ViserWriter(path, port)
        self._envs, self._spacing = envs, spacing
        self.force_scale, self.slip_scale = force_scale, float(slip_scale)
        self._subject, self._source, self._step = None, None, 0

    def __enter__(self) -> Recorder:
        return self

    def __exit__(self, *exception) -> None:
        self.close()

    def close(self) -> None:
        """Writes frames still in memory, and ends the recording."""
        self._writer.close()

    def wait(self) -> None:
        """Serves viser's page until Ctrl-C; returns at once where a file or another program has the recording."""
        self._writer.wait()

    def log(self, subject, solution: Solution | None = None, step: int | None = None) -> None:
        """Records the present state of a World or a BatchedSimulation, or all environments of a batch.

        step: of a world or a simulation: its number on the timeline, None: one more than the last.
        solution: of a batch; None: it is solved here, by "auto".
        """
        if isinstance(subject, Batch):
            return self._log_batch(subject, solution)
        if self._source is None or self._subject is not subject:
            self._begin(subject)
        self._step = self._step + 1 if step is None else operator.index(step)
        self._writer.at(step=self._step, time=float(self._step * self._source.dt))
        self._source.look()
        for env in self._drawn:
            self._log_frame(env, self._source.frame(env))
        self._log_status(self._source.status)

    # -- worlds and simulations ---------------------------------------------------------------------------------------

    def _begin(self, subject):
        """Logs the constants of a view: shapes, and where environments are drawn."""
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
        writer, where = self._writer, places(len(self._drawn), spacing)
        writer.open("world", middle + (where.mean(axis=0) if len(where) else 0.0), 0.9 * (extent + where.max(initial=0.0)))
        for env, place in zip(self._drawn, where):
            writer.place(["world", f"env_{env}"], place, middle + (0, 0, 0.7 * extent))
            for shape in source.geometries:
                is_ground = shape.kind == "plane" and turned(shape.orientation, (0.0, 0.0, 1.0)) @ up > 0.7
                writer.geometry(self._path(env, shape), shape, 0.48 * spacing, is_ground)

    def _path(self, env, shape):
        part = ["ground"] if shape.body < 0 else ["bodies", self._source.bodies[shape.body]]
        return ["world", f"env_{env}", *part, shape.name]

    def _log_frame(self, env, frame):
        writer, root = self._writer, ["world", f"env_{env}"]
        for name, position, orientation in zip(self._source.bodies, frame.position, frame.orientation):
            writer.body([*root, "bodies", name], position, orientation)
        shown = colours(frame.island)
        for shape in self._source.geometries:
            if shape.body >= 0:
                writer.colour(self._path(env, shape), shape.kind, shown[shape.body])
        writer.contacts(root, frame.contacts, self.force_scale, self.slip_scale, self._radius)
        writer.number(["slip", f"env_{env}"], np.linalg.norm(frame.contacts.finite().slip, axis=1).max(initial=0.0))

    def _log_status(self, status):
        for env in self._drawn:
            self._writer.status(f"env_{env}", f"env {env}", status[env], CODES, FLAGS)
        finite = status["residual"][np.isfinite(status["residual"])]
        if len(finite):
            self._writer.residual("median", np.median(finite))
            self._writer.residual("largest", finite.max())

    # -- batches ------------------------------------------------------------------------------------------------------

    def _log_batch(self, batch, solution):
        if self._source is not None:
            raise ValueError("batch: expected a recorder that has logged nothing: make another recorder")
        if solution is None:
            solution = Solver(solver="auto").solve(batch)
        source = self._source = BatchSource(batch, solution)
        drawn = _chosen(self._envs, int(source.simulation.max(initial=-1)) + 1)
        writer, width = self._writer, source.width()
        where = places(len(drawn), width + 1)
        writer.open("batch", where.mean(axis=0) if len(where) else np.zeros(3), 0.8 * (width + where.max(initial=0.0)))
        for simulation, place in zip(drawn, where):
            writer.place(["batch", f"simulation_{simulation}"], place, (0, 0.5 * width, 1.0))
        with Progress(total=source.env_count, title="recording", unit="env") as bar:
            for env in range(source.env_count):
                bar.update()
                writer.at(**{source.timeline: int(source.time[env])})
                name = f"simulation_{source.simulation[env]}"
                writer.status(name, source.name(env), source.status[env], CODES, FLAGS)
                if source.simulation[env] in drawn:
                    self._log_cones(["batch", name], env)

    def _log_cones(self, path, env):
        source = self._source
        contacts, reactions = source.contacts(env), source.reactions(env)
        scale = source.scale(env) if self.force_scale is None else self.force_scale
        self._writer.contacts(path, contacts, scale, source.slip_scale, 0.06)
        is_drawn = len(contacts.island) <= _MOST_NODES
        self._writer.cones(path, source.name(env), np.where(np.isfinite(reactions), reactions, 0.0), contacts.point,
                           contacts.island, source.couplings(env) if is_drawn else None)


def _backend(name, path):
    """The backend of that name; without one that of the path."""
    if name is None:
        return "viser" if path is not None and pathlib.Path(path).suffix in viser_writer.SUFFIXES else "rerun"
    if name not in _BACKENDS:
        raise ValueError(f"backend: expected {' or '.join(map(repr, _BACKENDS))}, got {name!r}")
    return name


def _source_of(subject):
    if isinstance(subject, World):
        return WorldSource(subject)
    if "stiction.mujoco" in sys.modules and isinstance(subject, sys.modules["stiction.mujoco"].BatchedSimulation):
        from .mujoco import MujocoSource
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


def main(arguments=None, program="stiction view") -> int:
    """The command `stiction view`. Returns the exit status."""
    parser = argparse.ArgumentParser(prog=program, description="Records a contact-batch or FCLIB file "
                                     "for a viewer: cones, reactions, residuals and couplings of every environment.")
    parser.add_argument("file", type=pathlib.Path)
    parser.add_argument("-o", "--out", type=pathlib.Path, help="the recording, default: FILE with .rrd, or .html by "
                        "viser; - opens a viewer, or serves viser's page")
    parser.add_argument("--backend", choices=list(_BACKENDS), help="default: by the name of the recording, else rerun")
    parser.add_argument("--port", type=int, default=8080, help="of the page that viser serves")
    parser.add_argument("--solver", default="auto")
    parser.add_argument("--tolerance", type=float, default=1e-6)
    parser.add_argument("--simulations", type=int, default=4, help="of a trajectory, whose cones are drawn")
    options = parser.parse_args(arguments)
    is_shown = str(options.out) == "-"
    out = options.out or options.file.with_suffix(".html" if options.backend == "viser" else ".rrd")
    try:
        _BACKENDS[_backend(options.backend, None if is_shown else out)].load()
        batch = Batch.from_file(options.file)
        solution = Solver(solver=options.solver, tolerance=options.tolerance).solve(batch)
        with Recorder(None if is_shown else out, backend=options.backend, port=options.port,
                      envs=options.simulations) as recorder:
            recorder.log(batch, solution)
            if is_shown:
                recorder.wait()
    except (ImportError, OSError, ValueError, RuntimeError) as error:
        print(f"stiction.view: {error}", file=sys.stderr)
        return 2
    if not is_shown:
        opens = out if out.suffix == ".html" else f"viser's client, {out}" if out.suffix == ".viser" else f"rerun {out}"
        print(f"{len(batch)} environments, {int(solution.solved.sum())} solved: {opens}")
    return 0
