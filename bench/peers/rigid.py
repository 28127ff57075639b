"""Scenes of rigid bodies in contact, as engines take them, from the J and M of contact batches (docs/file_formats.md)."""

import dataclasses

import h5py
import numpy as np
from environments import FRICTION, Environment


@dataclasses.dataclass
class Scene:
    """World axes; the reaction (n, t1, t2) of a contact acts on body b, -1 is the world."""

    mass: np.ndarray  # [kg]  (bodies)
    inertia: np.ndarray  # [kg m^2]  (bodies, 3, 3)
    position: np.ndarray  # [m]  (bodies, 3)
    twist: np.ndarray  # at the end of a step without contacts  (bodies, 6)
    pairs: np.ndarray  # a, b  (contacts, 2)
    point: np.ndarray  # [m]  (contacts, 3)
    axes: np.ndarray  # n, t1, t2  (contacts, 3, 3)
    mu: np.ndarray  # (contacts)

    def environment(self):
        """A = J M^-1 J' and b = J v of these numbers, law coulomb."""
        contacts, bodies = len(self.pairs), len(self.mass)
        jacobian = np.zeros((contacts, 3, bodies, 6))
        for k, (a, b) in enumerate(self.pairs):
            for body, sign in ((a, -1), (b, 1)):
                if body >= 0:
                    jacobian[k, :, body, :3] = sign * self.axes[k]
                    jacobian[k, :, body, 3:] = sign * np.cross(self.point[k] - self.position[body], self.axes[k])
        inverse = np.zeros((bodies, 6, 6))
        inverse[:, :3, :3] = np.eye(3) / self.mass[:, None, None]
        inverse[:, 3:, 3:] = np.linalg.inv(self.inertia)
        J = jacobian.reshape(3 * contacts, 6 * bodies)
        A = np.einsum("rbi,bij->rbj", J.reshape(-1, bodies, 6), inverse).reshape(J.shape) @ J.T
        coupled = np.abs(A).reshape(contacts, 3, contacts, 3).max(axis=(1, 3)) > 0
        stored = np.repeat(np.repeat(coupled, 3, axis=0), 3, axis=1)
        return Environment(np.concatenate(([0], np.cumsum(stored.sum(axis=1)))), np.nonzero(stored)[1], A[stored],
                           J @ self.twist.ravel(), np.zeros(3 * contacts), np.full(contacts, FRICTION),
                           3 * np.arange(contacts + 1), np.column_stack((np.zeros(contacts), self.mu, self.mu)).ravel())

    def records(self):
        """The bytes that engine_run.hpp reads."""
        principal, axes = np.linalg.eigh(self.inertia)
        axes[..., 2] *= np.linalg.det(axes)[:, None]
        bodies = np.column_stack((self.mass, self.inertia.reshape(-1, 9), principal, axes.reshape(-1, 9), self.position,
                                  self.twist))
        contacts = np.zeros(len(self.pairs), [("pair", "<i8", 2), ("numbers", "<f8", 13)])
        contacts["pair"] = self.pairs
        contacts["numbers"] = np.column_stack((self.point, self.axes.reshape(-1, 9), self.mu))
        return np.array([len(bodies), len(contacts)], "<i8").tobytes() + bodies.astype("<f8").tobytes() + contacts.tobytes()


def read_scenes(path):
    """The scenes of a batch of free bodies whose cones are contacts of three rows. Its targets are left out."""
    with h5py.File(path) as file:
        rows, dofs = file["env_row_ptr"][:], file["env_dof_ptr"][:]
        matrices = {name: [file[name][part][:] for part in ("ptr", "col", "val")] for name in ("J", "M")}
        velocity, param = file["v_free"][:], file["row_param"][:]
    return [scene(block(matrices["J"], first, last, end - start), block(matrices["M"], start, end, end - start),
                  velocity[start:end], param[first:last])
            for first, last, start, end in zip(rows, rows[1:], dofs, dofs[1:])]


def block(matrix, first, last, columns):
    """Rows first to last as a dense matrix."""
    offsets, column, value = matrix
    dense = np.zeros((last - first, columns))
    entries = slice(offsets[first], offsets[last])
    np.add.at(dense, (np.repeat(np.arange(last - first), np.diff(offsets[first:last + 1])), column[entries]), value[entries])
    return dense


def scene(jacobian, mass, velocity, param):
    bodies = len(velocity) // 6
    blocks = mass.reshape(bodies, 6, bodies, 6)[np.arange(bodies), :, np.arange(bodies)]
    contacts = jacobian.reshape(-1, 3, bodies, 6)
    pairs, arms, axes = [], [], []
    for rows in contacts:
        touched = np.flatnonzero(np.abs(rows).max(axis=(0, 2)))
        # The body on which the reaction acts turns (n, t1, t2) into themselves; the other one sees them negative.
        sense = [np.linalg.det(rows[:, body, :3]) for body in touched]
        b, a = touched[np.argmax(sense)], touched[np.argmin(sense)] if len(touched) == 2 else -1
        pairs.append((a, b))
        axes.append(rows[:, b, :3])
        # An arm r enters as r x d in three orthonormal directions d, whose d x (r x d) add up to 2 r.
        arms.append([0.5 * np.cross(rows[:, body, :3], rows[:, body, 3:]).sum(axis=0) if body >= 0 else np.zeros(3)
                     for body in (a, b)])
    pairs, arms = np.array(pairs), np.array(arms)
    position = placed(bodies, pairs, arms)
    return Scene(blocks[:, 0, 0], blocks[:, 3:, 3:], position, velocity.reshape(bodies, 6), pairs,
                 position[pairs[:, 1]] + arms[:, 1], np.array(axes), param.reshape(-1, 3)[:, 1])


def placed(bodies, pairs, arms):
    """Centres of mass at which both arms of every contact lead to one point; the first of each island is at the origin."""
    position, known = np.zeros((bodies, 3)), np.zeros(bodies, bool)
    for first in range(bodies):
        ready, known[first] = [] if known[first] else [first], True
        while ready:
            body = ready.pop()
            for (a, b), (arm_a, arm_b) in zip(pairs, arms):
                for one, other, step in ((a, b, arm_a - arm_b), (b, a, arm_b - arm_a)):
                    if one == body and other >= 0 and not known[other]:
                        position[other], known[other] = position[body] + step, True
                        ready.append(other)
    return position
