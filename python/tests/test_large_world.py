"""Worlds of thousands of shapes: contacts are those by distances of centres, and those of MuJoCo."""

import numpy as np
import pytest

from stiction import Body, Shape, World

MARGIN = 0.01


def spheres(count, seed):
    """(bodies, shapes, positions (count, 3), radii (count,)) in a cube, on no floor."""
    random = np.random.default_rng(seed)
    side = 0.08 * count ** (1 / 3)
    position, radius = random.uniform(-side, side, (count, 3)), random.uniform(0.03, 0.12, count)
    shapes = [Shape("sphere", float(r), body=k) for k, r in enumerate(radius)]
    bodies = [Body.solid(shape, 1000.0, position=tuple(p)) for shape, p in zip(shapes, position)]
    return bodies, shapes, position, radius


def pairs_of(world):
    contacts = world.contacts()
    return set(zip(contacts.body_a.tolist(), contacts.body_b.tolist()))


def test_spheres_touch_where_their_centres_say_so():
    count = 2500
    bodies, shapes, position, radius = spheres(count, 1)
    world = World(bodies, shapes, 1, gravity=(0, 0, 0), margin=MARGIN, max_iterations=5)
    world.step()
    touching = set()
    for k in range(count - 1):
        distance = np.linalg.norm(position[k + 1:] - position[k], axis=1)
        touching |= {(k, k + 1 + int(j)) for j in np.flatnonzero(distance <= radius[k + 1:] + radius[k] + MARGIN)}
    assert len(touching) > 2500
    assert pairs_of(world) == touching


def test_mujoco_finds_the_same_spheres():
    mujoco = pytest.importorskip("mujoco")
    bodies, shapes, position, radius = spheres(400, 2)
    spec = mujoco.MjSpec()
    for p, r in zip(position, radius):
        body = spec.worldbody.add_body(pos=p)
        body.add_freejoint()
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[r, 0, 0], margin=MARGIN / 2)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    world = World(bodies, shapes, 1, gravity=(0, 0, 0), margin=0.0, max_iterations=5)
    world.step()
    theirs = {tuple(sorted(int(g) for g in data.contact.geom[k])) for k in range(data.ncon) if data.contact.dist[k] <= 0}
    assert len(theirs) > 300
    assert pairs_of(world) == theirs


def test_a_row_of_boxes_stands_on_four_corners_each():
    count = 3000
    boxes = [Shape("box", (0.1, 0.1, 0.1), body=k) for k in range(count)]
    bodies = [Body.solid(box, 1000.0, position=(0.3 * k, 0.0, 0.1)) for k, box in enumerate(boxes)]
    world = World(bodies, [Shape("plane", mu=0.5), *boxes], 1, max_iterations=5)
    world.step()
    contacts = world.contacts()
    assert np.array_equal(contacts.body_b, np.repeat(np.arange(count), 4)) and (contacts.body_a == -1).all()
