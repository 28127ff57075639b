"""Environments in arrays of one shape, as batched programs for GPUs want them: the same cones for all, filled up where
one has fewer. A row that fills up stands still whatever happens. It has J = 0, A = 0, R = 1, b = 0, so its reaction is
0 and nothing feels it."""

import numpy as np
from environments import BOX, FREE, FRICTION, UNILATERAL

ORDER = (FREE, BOX, UNILATERAL, FRICTION)  # as MuJoCo sorts its rows
NAMES = {FREE: "free", BOX: "box", UNILATERAL: "unilateral", FRICTION: "friction"}


class Padded:
    """systems.System of as many degrees of freedom, in arrays (environments, ...).

    segments: (kind, rows of a cone, cones, first row) of neighbouring cones of one shape.
    """

    def __init__(self, some):
        shapes = [[(int(kind), int(size)) for kind, size in zip(s.kinds, s.cone_sizes)] for s in some]
        most = {shape: max(own.count(shape) for own in shapes) for own in shapes for shape in own}
        self.segments, row = [], 0
        for kind, size in sorted(most, key=lambda shape: (ORDER.index(shape[0]), shape[1])):
            self.segments.append((kind, size, most[kind, size], row))
            row += size * most[kind, size]
        self.rows, self.dofs = row, len(some[0].M)
        first = {(kind, size): begin for kind, size, _, begin in self.segments}
        self.places = []  # where the rows of each environment are
        for s, own in zip(some, shapes):
            free, found = dict(first), []
            for shape in own:
                found.append(np.arange(free[shape], free[shape] + shape[1]))
                free[shape] += shape[1]
            self.places.append(np.concatenate(found) if found else np.zeros(0, int))
        count = len(some)
        self.A, self.J = np.zeros((count, row, row)), np.zeros((count, row, self.dofs))
        self.b, self.target, self.R = np.zeros((count, row)), np.zeros((count, row)), np.ones((count, row))
        self.mu, self.bound = np.ones((count, row)), np.zeros((count, row))
        for e, (s, at) in enumerate(zip(some, self.places)):
            self.A[e][np.ix_(at, at)] = s.dense() - np.diag(s.compliance)
            self.J[e, at], self.b[e, at], self.target[e, at], self.R[e, at] = s.J, s.b, s.target, s.compliance
            self.mu[e, at] = np.where(s.row_kinds == FRICTION, s.row_param, 1)
            self.bound[e, at] = np.where(s.row_kinds == BOX, s.row_param, 0)
        for kind, size, cones, begin in self.segments:  # the normal has none
            if kind == FRICTION:
                self.mu[:, begin:begin + size * cones:size] = 1
        self.M = np.array([s.M for s in some])
        self.v_free = np.array([s.v_free for s in some])

    def friction(self):
        """mu on the tangents of friction cones, zero elsewhere."""
        found = np.zeros_like(self.mu)
        for kind, size, cones, first in self.segments:
            for row in range(first, first + size * cones) if kind == FRICTION else ():
                found[:, row] = self.mu[:, row] if (row - first) % size else 0
        return found

    def contacts(self):
        """(first row, rows) of every friction cone."""
        return [(first + size * k, size) for kind, size, cones, first in self.segments if kind == FRICTION for k in range(cones)]

    def impratio(self):
        """Compliance of normals over that of first tangents: MuJoCo's impratio, one number for a model."""
        address = np.array([first for first, _ in self.contacts()], int)
        stands = (self.J[:, address] != 0).any(axis=2)  # what does not fill up
        ratio = (self.R[:, address] / self.R[:, address + 1])[stands] if len(address) else np.ones(0)
        if not np.allclose(ratio, ratio[:1], rtol=1e-6):
            raise ValueError("contacts of different ratios of compliance: MuJoCo has one for all")
        return float(ratio[0]) if len(ratio) else 1.0

    def contact_friction(self):
        """mu of every contact's tangents, then ones, as MuJoCo has them (environments, contacts, 5)."""
        found = np.ones((len(self.R), len(self.contacts()), 5))
        for k, (first, size) in enumerate(self.contacts()):
            found[:, k, :size - 1] = self.mu[:, first + 1:first + size]
        return found

    def cones(self):
        """Cones of every environment as stiction takes them."""
        return [(NAMES[kind], size) for kind, size, cones, _ in self.segments for _ in range(cones)]

    def own(self, reactions):
        """Rows of the environments themselves, one environment after another."""
        return np.concatenate([np.asarray(reaction, "f8")[at] for reaction, at in zip(reactions, self.places)])
