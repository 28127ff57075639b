"""Contact batches built here, by formulas that share nothing with the project's scenes: unit tests of claims need known answers.

Every problem is (A, b, cones, parameter): dense matrix, right-hand side, a list of (kind, rows), friction of every row.
Motion is velocity, reactions are impulses; a step is 0.005 s, gravity 9.81 m/s^2.
"""

import h5py
import numpy as np

UNILATERAL, FRICTION = 1, 3
WEIGHT = 9.81 * 0.005  # what a unit mass gains in a step [m/s]


def write(path, law, problems):
    """The batch of these problems; R = 0. Entries that are exactly zero between two cones are not stored."""
    rows = np.cumsum([0] + [len(b) for _, b, _, _ in problems])
    cones = np.cumsum([0] + [len(kinds) for _, _, kinds, _ in problems])
    cone_rows = np.cumsum([0] + [size for _, _, kinds, _ in problems for _, size in kinds])
    lengths, columns, values = [], [], []
    for A, _, kinds, _ in problems:
        cone_of = np.repeat(np.arange(len(kinds)), [size for _, size in kinds])
        coupled = np.zeros((len(kinds), len(kinds)), bool)
        np.logical_or.at(coupled, (cone_of[:, None], cone_of[None, :]), A != 0)
        stored = coupled[cone_of][:, cone_of] | np.eye(len(A), dtype=bool)
        lengths.append(stored.sum(axis=1))
        columns.append(np.nonzero(stored)[1])
        values.append(A[stored])
    with h5py.File(path, "w") as file:
        file.attrs.update(format="contact-batch", version=1, law=law, source="bench/studies/problems.py")
        file["env_row_ptr"], file["env_cone_ptr"] = rows.astype("i8"), cones.astype("i8")
        file["cone_row_ptr"] = cone_rows.astype("i8")
        file["cone_kind"] = np.array([kind for _, _, kinds, _ in problems for kind, _ in kinds], "u1")
        file["row_param"] = np.concatenate([parameter for *_, parameter in problems])
        file["A/ptr"] = np.concatenate(([0], np.cumsum(np.concatenate(lengths)))).astype("i8")
        file["A/col"] = np.concatenate(columns).astype("i4")
        file["A/val"] = np.concatenate(values)
        file["b"] = np.concatenate([b for _, b, _, _ in problems])
        file["R"] = np.zeros(rows[-1])
    return path


def normals_only(A, b):
    return A, b, [(UNILATERAL, 1)] * len(b), np.zeros(len(b))


def column(masses, rng=None):
    """Bodies on one vertical line, each resting on the one before, the first on the ground: A is tridiagonal.

    All contacts are closed: contact k carries the weight of everything above it (`carried`).
    """
    inverse = 1 / np.asarray(masses, float)
    A = np.diag(inverse + np.concatenate(([0], inverse[:-1]))) - np.diag(inverse[:-1], 1) - np.diag(inverse[:-1], -1)
    b = np.zeros(len(masses))
    b[0] = -WEIGHT
    if rng is not None:
        b -= 1e-3 * WEIGHT * rng.random(len(b))
    return normals_only(A, b)


def carried(masses):
    """The exact reactions of `column` without perturbation."""
    return WEIGHT * np.cumsum(np.asarray(masses, float)[::-1])[::-1]


def cubes(masses, rng, mu=0.5, edge=0.2):
    """Cubes on top of each other, four friction contacts at the corners of every face between; slightly moving."""
    count = len(masses)
    corners = 0.5 * edge * np.array([(-1, -1, -1), (1, -1, -1), (1, 1, -1), (-1, 1, -1)], float)
    J = np.zeros((12 * count, 6 * count))
    for k in range(count):
        for c, arm in enumerate(corners):
            for axis, direction in enumerate(np.eye(3)[[2, 0, 1]]):
                row = 12 * k + 3 * c + axis
                J[row, 6 * k:6 * k + 6] = np.concatenate((direction, np.cross(arm, direction)))
                if k:  # the same point seen from the cube below
                    J[row, 6 * k - 6:6 * k] = -np.concatenate((direction, np.cross(arm + [0, 0, edge], direction)))
    inverse = np.concatenate([np.r_[np.full(3, 1 / m), np.full(3, 6 / (m * edge**2))] for m in masses])
    free = np.tile([0, 0, -WEIGHT, 0, 0, 0], count) + 0.2 * WEIGHT * rng.standard_normal(6 * count)
    return (J * inverse) @ J.T, J @ free, [(FRICTION, 3)] * (4 * count), np.tile([0, mu, mu], 4 * count)


def face(contacts, rng, mu=0.5, edge=0.2):
    """A cube on the ground with its contacts in a square grid on one face, slightly moving: A is full, of rank six."""
    side = int(np.ceil(np.sqrt(contacts)))
    grid = np.linspace(-0.5, 0.5, side) * edge if side > 1 else np.zeros(1)
    arms = np.array([(x, y, -0.5 * edge) for x in grid for y in grid])[:contacts]
    J = np.zeros((3 * contacts, 6))
    for c, arm in enumerate(arms):
        for axis, direction in enumerate(np.eye(3)[[2, 0, 1]]):
            J[3 * c + axis] = np.concatenate((direction, np.cross(arm, direction)))
    free = np.array([0, 0, -WEIGHT, 0, 0, 0]) + 0.2 * WEIGHT * rng.standard_normal(6)
    A = (J * np.r_[np.ones(3), np.full(3, 6 / edge**2)]) @ J.T
    return A, J @ free, [(FRICTION, 3)] * contacts, np.tile([0, mu, mu], contacts)


def first_contacts(problem, contacts):
    """The principal part that belongs to the first contacts of three rows."""
    A, b, kinds, parameter = problem
    rows = 3 * contacts
    return A[:rows, :rows], b[:rows], kinds[:contacts], parameter[:rows]


def sliding_blocks(count, mu=0.5, speed=3.0):
    """Unit masses on the ground, pressed on and sliding fast, in `count` directions."""
    angle = 2 * np.pi * (np.arange(count) + 0.5) / count
    return [(np.eye(3), np.array([-2, speed * np.cos(a), speed * np.sin(a)]), [(FRICTION, 3)], np.array([0, mu, mu]))
            for a in angle]


def closed(A, rng):
    """Frictionless problem with this A whose contacts all carry: A x + b = 0 with x > 0."""
    return normals_only(A, -A @ rng.uniform(0.5, 1.5, len(A)))


def with_spectrum(count, condition, rng):
    """Symmetric matrix with eigenvalues from 1/condition to 1, evenly spread in logarithm, in random directions."""
    directions, _ = np.linalg.qr(rng.standard_normal((count, count)))
    return (directions * np.logspace(0, -np.log10(condition), count)) @ directions.T


def random_complementarity(count, rng):
    """A = B B' / n + 0.1 I, b normal: about half of the rows carry."""
    B = rng.standard_normal((count, count))
    return normals_only(B @ B.T / count + 0.1 * np.eye(count), rng.standard_normal(count))


def side_by_side(problems):
    """One environment of several that do not touch."""
    size = sum(len(b) for _, b, _, _ in problems)
    A, start = np.zeros((size, size)), 0
    for block, b, _, _ in problems:
        A[start:start + len(b), start:start + len(b)] = block
        start += len(b)
    return (A, np.concatenate([b for _, b, _, _ in problems]), [kind for _, _, kinds, _ in problems for kind in kinds],
            np.concatenate([parameter for *_, parameter in problems]))


def dense(path, environment=0, compliance=True):
    """(A + diag R or A, b, cones, parameter) of one environment of a file."""
    with h5py.File(path) as batch:
        first, last = batch["env_row_ptr"][environment:environment + 2]
        pointer = batch["A/ptr"][first:last + 1]
        A = np.zeros((last - first, last - first))
        rows = np.repeat(np.arange(last - first), np.diff(pointer))
        np.add.at(A, (rows, batch["A/col"][pointer[0]:pointer[-1]]), batch["A/val"][pointer[0]:pointer[-1]])
        if compliance:
            A += np.diag(batch["R"][first:last])
        low, high = batch["env_cone_ptr"][environment:environment + 2]
        kinds = list(zip(batch["cone_kind"][low:high].tolist(), np.diff(batch["cone_row_ptr"][low:high + 1]).tolist()))
        return A, batch["b"][first:last], kinds, batch["row_param"][first:last]
