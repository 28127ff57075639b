"""Drawing of one environment: places of bodies, contacts, forces, slip, islands. NumPy alone, for every backend."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

#: Colour of bodies without contact, and of islands, in turn.
GREY = (150, 150, 150)
PALETTE = np.array([(66, 133, 244), (234, 134, 45), (52, 168, 83), (171, 71, 188), (0, 172, 193), (216, 67, 21),
                    (124, 179, 66), (236, 64, 122), (121, 85, 72), (92, 107, 192), (253, 216, 53), (0, 121, 107)], np.uint8)
_RING, _SPOKES = 24, 4


class Geometry(NamedTuple):
    """A shape fixed to a body. kind: "sphere", "capsule", "box", "plane", "ellipsoid", "cylinder" or "mesh". size: as of
    stiction.Shape, and as MuJoCo has it; of a mesh (vertices, triangles). body: -1, the world. position, orientation (w,
    x, y, z): in the body's axes. colour: r, g, b, a, or None: that of the island.
    """

    name: str
    kind: str
    size: object
    body: int
    position: tuple
    orientation: tuple
    colour: object = None


class Contacts(NamedTuple):
    """Contacts of one environment. point (n, 3) [m]. frame (n, 3, 3): normal and two tangents by rows. force (n, 3): in
    that frame, on the second body [N]. mu (n, 2): by tangent [-]. slip (n, 3): in the world's axes [m/s]. island (n,):
    label, -1 is none.
    """

    point: np.ndarray
    frame: np.ndarray
    force: np.ndarray
    mu: np.ndarray
    slip: np.ndarray
    island: np.ndarray

    @classmethod
    def none(cls):
        """No contacts."""
        return cls(*(np.zeros((0, *shape)) for shape in ((3,), (3, 3), (3,), (2,), (3,))), np.zeros(0, int))

    def finite(self) -> Contacts:
        """Returns those whose numbers are all finite."""
        keep = np.ones(len(self.point), bool)
        for array in self[:5]:
            keep &= np.isfinite(array).all(axis=tuple(range(1, array.ndim)))
        return Contacts(*(array[keep] for array in self))

    def world_force(self) -> np.ndarray:
        """Forces in the world's axes (n, 3) [N]."""
        return np.einsum("ni,nij->nj", self.force, self.frame)


class Frame(NamedTuple):
    """One environment at one time. position (bodies, 3), orientation (bodies, 4) as (w, x, y, z), island (bodies,): -1
    is none.
    """

    position: np.ndarray
    orientation: np.ndarray
    island: np.ndarray
    contacts: Contacts


def turned(orientation, vector):
    """Vectors (..., 3) turned by a quaternion (w, x, y, z)."""
    w, *v = orientation
    v, vector = np.array(v, float), np.array(vector, float)
    return vector + 2 * np.cross(v, np.cross(v, vector) + w * vector)


def tangents(normal):
    """Frames (n, 3, 3) of unit normals (n, 3): the tangents of `stiction::contact_tangents`, in which impulses are."""
    x, y, z = normal.T
    sign = np.where(z < 0, -1.0, 1.0)
    a = -1.0 / (sign + z)
    b = x * y * a
    first = np.stack([1 + sign * x * x * a, sign * b, -sign * x], axis=1)
    second = np.stack([b, sign + y * y * a, -y], axis=1)
    return np.stack([normal, first, second], axis=1)


def islands(count, pairs, touched=()):
    """Labels (count,) of the components of pairs (m, 2): the smallest member's number, -1 of those in no pair.
    touched: members that are islands although they have no partner. Members below 0 join nothing.
    """
    label = np.arange(count)
    pairs = np.asarray(pairs, int).reshape(-1, 2)
    inner = pairs[(pairs >= 0).all(axis=1)]
    while len(inner):
        before = label.copy()
        low = np.minimum(label[inner[:, 0]], label[inner[:, 1]])
        np.minimum.at(label, inner[:, 0], low)
        np.minimum.at(label, inner[:, 1], low)
        label = label[label]
        if np.array_equal(label, before):
            break
    seen = np.zeros(count, bool)
    seen[pairs[pairs >= 0]] = True
    seen[np.asarray(list(touched), int)] = True
    return np.where(seen, label, -1)


def colours(island):
    """Colours (n, 3) of islands by their label."""
    island = np.asarray(island, int)
    return np.where((island < 0)[:, None], np.array(GREY, np.uint8), PALETTE[island % len(PALETTE)])


def cone_lines(contacts, scale):
    """Friction cones of contacts that push, as high as the normal force: a ring and its spokes each. A reaction that
    sticks ends inside the ring, one that slides ends on it.
    """
    strips = []
    angle = np.linspace(0, 2 * np.pi, _RING + 1)
    for i in np.flatnonzero((contacts.force[:, 0] > 0) & (contacts.mu > 0).any(axis=1)):
        height = scale * contacts.force[i, 0]
        local = np.stack([np.full_like(angle, height), contacts.mu[i, 0] * height * np.cos(angle),
                          contacts.mu[i, 1] * height * np.sin(angle)], axis=1)
        ring = contacts.point[i] + local @ contacts.frame[i]
        strips.append(ring)
        strips += [np.stack([contacts.point[i], ring[k * _RING // _SPOKES]]) for k in range(_SPOKES)]
    return strips


def places(count, spacing):
    """Places at which environments are drawn beside each other (count, 3) [m]."""
    columns = int(np.ceil(np.sqrt(max(count, 1))))
    index = np.arange(count)
    return np.stack([index % columns * spacing, index // columns * spacing, np.zeros(count)], axis=1)
