"""Rigid bodies and contact points as rows of J and M."""

from __future__ import annotations

import numpy as np

from .arrays import as_numpy
from .layout import KINDS, offsets_of

#: Eigenvalues of an inverse inertia below this share of the largest are of axes about which nothing turns the body.
_LOCKED = 1e-12


def _tangents(n):
    """The two tangents of each normal (contacts, 3), as contact_tangents() of the library makes them."""
    sign = np.where(n[:, 2] < 0, -1.0, 1.0)
    a = -1 / (sign + n[:, 2])
    b = n[:, 0] * n[:, 1] * a
    return (np.stack([1 + sign * n[:, 0] ** 2 * a, sign * b, -sign * n[:, 0]], 1),
            np.stack([b, sign + n[:, 1] ** 2 * a, -n[:, 1]], 1))


def _masses(inv_mass, inv_inertia):
    """M of each body, (bodies, 6, 6), and the part of its motion that contacts change, (bodies, 6, 6). Nothing changes
    the motion of an axis with an inverse of 0: its mass is 1 and stands alone."""
    count = len(inv_mass)
    M, moves = np.zeros((2, count, 6, 6))
    free = ~(inv_mass == 0)  # NaN stays NaN
    M[:, [0, 1, 2], [0, 1, 2]] = np.where(free, 1 / np.where(free, inv_mass, 1), 1)[:, None]
    moves[:, [0, 1, 2], [0, 1, 2]] = free[:, None]
    known = np.isfinite(inv_inertia).all(axis=1)
    size, axes = np.linalg.eigh(np.where(known[:, None], inv_inertia, 0)[:, [0, 1, 2, 1, 3, 4, 2, 4, 5]].reshape(-1, 3, 3))
    size[~known] = np.nan
    free = ~(size <= _LOCKED * np.abs(size).max(axis=1, keepdims=True, initial=0))
    M[:, 3:, 3:] = (axes * np.where(free, 1 / np.where(free, size, 1), 1)[:, None]) @ axes.swapaxes(1, 2)
    moves[:, 3:, 3:] = np.where(free.all(axis=1)[:, None, None], np.eye(3), (axes * free[:, None]) @ axes.swapaxes(1, 2))
    return M, moves


def _wanted(batch, depth, restitution, approach):
    """The velocity that each normal row asks for (docs/howto/bodies.md)."""
    dt, erp, slop, _, threshold = batch.stepping[:5]
    position = np.where(depth < 0, depth, erp * np.maximum(depth - slop, 0)) / dt
    bounces = (restitution > 0) & (approach > threshold) & (approach * dt >= -depth)
    return np.where(bounces, np.maximum(restitution * approach, position), position)


def check(batch):
    """Raises ValueError for a batch of bodies that has no rows of J and M."""
    substeps, most = batch.stepping[5:]
    contacts = as_numpy("contact_offsets", batch._held["env_contact_offsets"])
    if substeps != 1:
        raise ValueError(f"substeps: expected 1, got {substeps}: J and M are those of one instant")
    if most and (np.diff(contacts) > most).any():
        raise ValueError(f"max_contacts_per_env: expected room for all contacts, got {most} and environments with up to "
                         f"{np.diff(contacts).max()}: give 0")


def jacobian_arguments(batch):
    """Returns the arguments of Batch.from_jacobian for a host batch of bodies: a tuple and a dict."""
    check(batch)
    dt, cfm = batch.stepping[0], batch.stepping[3]
    bodies, contacts = (as_numpy(name, batch._held[name]).astype(np.int64)
                        for name in ("env_body_offsets", "env_contact_offsets"))

    def of(name, *width):
        return as_numpy(name, batch.arrays[name]).astype(np.float64).reshape(-1, *width)

    twist = of("twist", 6)
    change = of("twist_change", 6) if "twist_change" in batch.arrays else np.zeros_like(twist)
    held = np.zeros(len(twist), bool)
    if "kinematic" in batch.arrays:
        held = as_numpy("kinematic", batch.kinematic).reshape(-1) != 0
    M, moves = _masses(np.where(held, 0, of("inv_mass")), np.where(held[:, None], 0, of("inv_inertia", 6)))
    v_free = twist + np.where(held[:, None], 0, change)

    count = int(contacts[-1])
    env = np.repeat(np.arange(len(contacts) - 1), np.diff(contacts))
    normal = of("normal", 3)
    frame = np.stack([normal, *_tangents(normal)], 1)
    values, columns = np.zeros((count, 3, 2, 6)), np.zeros((count, 2), np.int64)
    first = bodies[env]
    present, given, start = np.zeros((count, 2), bool), np.zeros((count, 3)), np.zeros((count, 3))
    for side, (name, arm, sign) in enumerate((("body_a", "arm_a", -1.0), ("body_b", "arm_b", 1.0))):
        own = as_numpy(name, batch.arrays[name]).astype(np.int64).reshape(-1)
        there = present[:, side] = own >= 0
        body = np.where(there, first + own, 0)
        if not len(twist):
            continue
        reach = np.where(there[:, None], of(arm, 3), 0)
        row = sign * np.concatenate([frame, np.cross(reach[:, None], frame)], -1) * there[:, None, None]
        start += np.einsum("crk,ck->cr", row, twist[body])
        moved = row @ moves[body]
        given += np.einsum("crk,ck->cr", row - moved, v_free[body])
        values[:, :, side], columns[:, side] = moved, np.where(there, own, 0)
    target = -given
    target[:, 0] += _wanted(batch, of("depth"), of("restitution"), -start[:, 0])
    mu = np.zeros((count, 3))
    mu[:, 1:] = of("mu")[:, None]

    stored = np.broadcast_to(present[:, None, :, None], values.shape)
    indices = np.broadcast_to((6 * columns[:, None, :, None] + np.arange(6)).astype(np.int32), values.shape)
    dtype = batch.dtype
    boxed = batch.law == "boxed"
    return (values[stored].astype(dtype), M.reshape(-1).astype(dtype), v_free.reshape(-1).astype(dtype),
            target.reshape(-1).astype(dtype)), dict(
        kinds=np.full(count, KINDS["box_friction" if boxed else "friction"], np.uint8), dims=np.full(count, 3, np.int64),
        offsets=3 * contacts, dof_offsets=6 * bodies, indptr=offsets_of(np.repeat(6 * present.sum(axis=1), 3)),
        indices=indices[stored], mass_block=6, mu=mu.reshape(-1).astype(dtype),
        R=np.full(3 * count, cfm / dt, dtype), law="coulomb" if boxed else batch.law)
