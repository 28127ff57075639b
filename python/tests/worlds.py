"""The scenes of `stiction step`, described in Python, and small worlds for tests."""

import math
import types

import numpy as np

from stiction import Body, Shape, World, WorldState

DENSITY = 1000.0


def solids(*shapes):
    """(bodies, shapes) of shapes that are a body each; the floor comes first."""
    return [Body.solid(shape, DENSITY) for shape in shapes]


def on_slope(tangent):
    c = 1 / math.sqrt(1 + tangent * tangent)
    return (9.81 * c * tangent, 0.0, -9.81 * c)


def pile():
    half = math.sqrt(0.5)
    walls = [((-0.35, 0, 0), (half, 0, half, 0)), ((0.35, 0, 0), (half, 0, -half, 0)),
             ((0, -0.35, 0), (half, -half, 0, 0)), ((0, 0.35, 0), (half, half, 0, 0))]
    fixed = [Shape("plane", mu=0.6)] + [Shape("plane", position=p, orientation=q, mu=0.3) for p, q in walls]
    moving = []
    for k in range(4):
        grown = 1 + 0.1 * k
        for kind, size in (("sphere", (0.08,)), ("capsule", (0.05, 0.08)), ("box", (0.09, 0.07, 0.05))):
            moving.append(Shape(kind, tuple(s * grown for s in size), body=len(moving), mu=0.5, restitution=0.1))
    return solids(*moving), fixed + moving, {}


def walker():
    half, foot_radius, spoke = math.sqrt(0.5), 0.01, 1 - 0.01
    cos, sin = math.sqrt((1 + math.sqrt(0.5)) / 2), math.sqrt((1 - math.sqrt(0.5)) / 2)
    hub = Body(1.0, (0.375, 0.5, 0.375), position=(0, 0, spoke * cos + foot_radius))
    shapes, x, z = [Shape("plane", mu=4)], sin, -cos
    for _ in range(8):
        shapes.append(Shape("capsule", (foot_radius, 0.3), body=0, position=(spoke * x, 0, spoke * z),
                            orientation=(half, half, 0, 0), mu=4))
        x, z = half * (x + z), half * (z - x)
    return [hub], shapes, {"gravity": on_slope(0.1), "dt": 0.002}


def stack():
    boxes = [Shape("box", (0.1, 0.1, 0.1), body=k, mu=0.5) for k in range(5)]
    return solids(*boxes), [Shape("plane", mu=0.5), *boxes], {}


def bounce():
    balls = [Shape("sphere", 0.1, body=k, mu=0.5, restitution=e) for k, e in enumerate((0.3, 0.6, 0.9))]
    return solids(*balls), [Shape("plane", mu=0.5), *balls], {"dt": 0.001, "restitution_threshold": 0.1}


def slide():
    blocks = [Shape("box", (0.15, 0.1, 0.05), body=k, mu=mu * mu) for k, mu in enumerate((0.2, 0.5))]
    return solids(*blocks), [Shape("plane", mu=1), *blocks], {"gravity": on_slope(0.3)}


SCENES = {scene.__name__: scene for scene in (pile, walker, stack, bounce, slide)}


def started(envs=6, device="cpu", dtype="float64", order=None, **options):
    """Piles that begin differently: environments `order` of the six."""
    bodies, shapes, _ = pile()
    rng = np.random.default_rng(1)
    grid = np.array([[x, y, z] for z in (0.2, 0.54, 0.88) for y in (-0.17, 0.17) for x in (-0.17, 0.17)])
    state = WorldState(grid + rng.uniform(-0.01, 0.01, (envs, 12, 3)), rng.normal(size=(envs, 12, 4)),
                       rng.uniform(-1, 1, (envs, 12, 6)))
    order = np.arange(envs) if order is None else np.asarray(order)
    options = {"tolerance": 1e-4, "max_iterations": 100, "threads": 1} | options
    world = World(bodies, shapes, len(order), device, dtype=dtype, **options)
    world.reset(**{name: np.ascontiguousarray(part[order].astype(dtype)) for name, part in state._asdict().items()})
    return world


def heap(envs=8, restitution=0.0, law="coulomb", **options):
    """A ball, a box and a brick on the floor, and a ball on the box: sliding, rolling, bouncing, apart. They are the
    world, and arrays to begin with: position, orientation, twist, wrench.
    """
    moving = [Shape("sphere", 0.1, body=0, mu=0.4, restitution=restitution),
              Shape("box", (0.2, 0.2, 0.2), body=1, mu=0.5), Shape("box", (0.1, 0.2, 0.3), body=2, mu=0.3),
              Shape("sphere", 0.1, body=3, mu=0.7)]
    shapes = [Shape("plane", mu=0.6, restitution=restitution), *moving]
    rng = np.random.default_rng(3)
    over = np.where(np.arange(envs) % 3 == 2, -1e-3, 1e-4)
    position = np.tile(np.array([[0, 0, 0.1], [1, 0, 0.2], [3, 0, 0.3], [1, 0, 0.5]], float), (envs, 1, 1))
    position[:, :, 2] -= over[:, None] * [1, 1, 1, 2]
    twist = rng.uniform(-1, 1, (envs, 4, 6))
    twist[:, :, 2] = -0.4 + 0.3 * twist[:, :, 2]
    begin = types.SimpleNamespace(position=position, orientation=np.tile([1.0, 0, 0, 0], (envs, 4, 1)), twist=twist,
                                  wrench=rng.uniform(-20, 20, (envs, 4, 6)))
    exact = {"cfm": 1e-3, "max_iterations": 20000, "tolerance": 1e-13, "warm_start": 0.0, "threads": 1}

    def make(changed=shapes, **more):
        return World(solids(*moving), changed, envs, law=law, **exact | options | more)

    return make, begin, shapes


def read_states(rows, envs, dtype):
    """Lines of `stiction step -o` as a state."""
    names = ("x", "y", "z"), ("qw", "qx", "qy", "qz"), ("vx", "vy", "vz", "wx", "wy", "wz")
    return WorldState(*(np.ascontiguousarray(np.stack([rows[name] for name in group], -1).astype(dtype)
                                             .reshape(envs, -1, len(group))) for group in names))
