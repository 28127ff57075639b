"""Shapes as meshes, for viewers that have no such primitive."""

import numpy as np

_AROUND, _RINGS = 24, 6


def square(half):
    """The outline (5, 3) of a square in the plane z = 0, with edges twice that long."""
    return half * np.array([(-1.0, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0), (-1, -1, 0)])


def capsule(radius, half):
    """Vertices (n, 3) and triangles (m, 3) of a capsule along z, which face outwards. It is a cylinder from -half to half
    with half a ball at either end."""
    height = np.linspace(-np.pi / 2, np.pi / 2, 2 * _RINGS)  # of rings: as many below as above
    angle = np.arange(_AROUND) * (2 * np.pi / _AROUND)
    shift = np.where(height < 0, -half, half)
    ring = np.stack(np.broadcast_arrays(radius * np.cos(height)[:, None] * np.cos(angle),
                                        radius * np.cos(height)[:, None] * np.sin(angle),
                                        (radius * np.sin(height) + shift)[:, None]), axis=-1)
    low = (np.arange(2 * _RINGS - 1)[:, None] * _AROUND + np.arange(_AROUND)).ravel()
    beside = low - low % _AROUND + (low + 1) % _AROUND
    triangles = np.concatenate([np.stack([low, beside, low + _AROUND], axis=1),
                                np.stack([beside, beside + _AROUND, low + _AROUND], axis=1)])
    return ring.reshape(-1, 3).astype(np.float32), triangles.astype(np.uint32)
