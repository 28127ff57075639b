"""Parts of a recording, for every backend: a frame becomes points, arrows, lines and numbers here, once."""

import abc

import numpy as np

from .frame import colours, cone_lines

GROUND, CONE, FORCE, SLIP = (110, 115, 120), (200, 200, 200), (220, 40, 40), (250, 180, 0)
_NUMERICAL = 3  # codes from here on: the answer is no answer


class Writer(abc.ABC):
    """A recording that is written to a file or shown. Paths are lists of their parts, lengths are in metres."""

    @abc.abstractmethod
    def open(self, origin, middle, width):
        """Begins a scene "world" or "batch" of that width about its middle, with z up."""

    @abc.abstractmethod
    def close(self):
        """Writes frames still in memory, and ends the recording."""

    def wait(self):
        """Shows the recording until the program is interrupted, where no other program does."""

    @abc.abstractmethod
    def at(self, **times):
        """The time of the next frames: integers are steps, others seconds."""

    @abc.abstractmethod
    def place(self, path, position, above):
        """Place at which an environment is drawn, once for all times. above: a point above it, in its own axes."""

    @abc.abstractmethod
    def geometry(self, path, shape, plane_size, is_ground):
        """A shape, once for all times. Its colour follows, unless it is the world's."""

    @abc.abstractmethod
    def colour(self, path, kind, colour):
        """The colour of a shape of that kind from now on: red, green and blue in 0..255."""

    @abc.abstractmethod
    def move(self, path, position, orientation):
        """Place of a body, and its quaternion (w, x, y, z); both are finite."""

    @abc.abstractmethod
    def points(self, path, positions, colour, radius, values):
        """Points (n, 3), coloured (n, 3). values: {name: (n,)}, numbers of each point to read."""

    @abc.abstractmethod
    def arrows(self, path, origins, vectors, colour, radius):
        """Arrows from origins (n, 3) along vectors (n, 3)."""

    @abc.abstractmethod
    def lines(self, path, strips, colour, radius):
        """Broken lines: a list of (points, 3)."""

    @abc.abstractmethod
    def scalar(self, path, value):
        """A point of a time series; it is finite."""

    @abc.abstractmethod
    def warn(self, text):
        """A line of the log."""

    @abc.abstractmethod
    def cones(self, path, title, reactions, positions, island, couplings):
        """Draws a batch environment's parts besides contacts. title: name in the file. reactions: by row. Cones have
        positions (n, 3) and an island (n,). couplings: pairs (m, 2) of them; None where they are too many."""

    # -- what all backends share --------------------------------------------------------------------------------------

    def number(self, path, value):
        """A point of a time series, if it is finite."""
        if np.isfinite(value):
            self.scalar(path, float(value))

    def body(self, path, position, orientation):
        """Place of a body, if that is finite."""
        if np.isfinite(position).all() and np.isfinite(orientation).all():
            self.move(path, position, orientation)

    def contacts(self, path, contacts, force_scale, slip_scale, radius):
        """Points, forces, friction cones and slip of an environment's contacts, without those that are not finite."""
        contacts = contacts.finite()
        self.points([*path, "contacts"], contacts.point, colours(contacts.island), radius, {
            "normal_force": contacts.force[:, 0], "mu": contacts.mu[:, 0], "island": contacts.island,
            "slip": np.linalg.norm(contacts.slip, axis=1)})
        self.arrows([*path, "forces"], contacts.point, force_scale * contacts.world_force(), FORCE, 0.4 * radius)
        self.lines([*path, "cones"], cone_lines(contacts, force_scale), CONE, 0.12 * radius)
        self.arrows([*path, "slip"], contacts.point, slip_scale * contacts.slip, SLIP, 0.4 * radius)

    def status(self, entity, name, record, code_names, flags):
        """Residual and iterations of an environment, and a line of the log if its solve gave no answer."""
        self.residual(entity, record["residual"])
        self.number(["iterations", entity], record["iterations"])
        if record["code"] >= _NUMERICAL:
            raised = [flag for bit, flag in enumerate(flags) if int(record["flags"]) >> bit & 1]
            self.warn(f"{name} ended as {code_names[record['code']]}" + (f": {', '.join(raised)}" if raised else ""))

    def residual(self, entity, value):
        """A residual, and its logarithm, which plots show; zero stands at 1e-17 there."""
        self.number(["residual", entity], value)
        if value >= 0:
            self.number(["log10_residual", entity], np.log10(max(value, 1e-17)))
