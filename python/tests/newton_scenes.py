"""Models for the tests of stiction.newton, and their steps. Skips where newton or warp is lacking."""

import numpy as np
from frameworks import framework
from warp_quickly import wp

newton = framework("newton", "stiction.newton is")

from stiction.newton import SolverStiction  # noqa: E402


def quat(axis, angle):
    return wp.quat_from_axis_angle(wp.vec3(*axis), float(angle))


def on_ground(add, worlds=1, **ground):
    """A model of so many worlds on one plane; add(builder, world) puts a world's bodies there."""
    builder = newton.ModelBuilder()
    for name, value in ground.items():
        setattr(builder.default_shape_cfg, name, value)
    builder.add_ground_plane()
    for world in range(worlds):
        builder.begin_world()
        add(builder, world)
        builder.end_world()
    return builder.finalize(device="cpu")


def box(half=0.1, height=None, speed=(0, 0, 0), **shape):
    """Puts a box of 8 kg on the ground."""
    def add(builder, world):
        for name, value in shape.items():
            setattr(builder.default_shape_cfg, name, value)
        body = builder.add_body(xform=wp.transform((0, 0, half if height is None else height), wp.quat_identity()))
        builder.add_shape_box(body, hx=half, hy=half, hz=half)
        builder.joint_qd[-6:-3] = speed
    return add


class Run:
    """Steps a model; the last states, contacts and solver can be looked at."""

    def __init__(self, model, contact_matching="latest", **options):
        self.model, self.solver = model, SolverStiction(model, **options)
        self.state, self.other, self.control = model.state(), model.state(), model.control()
        self.pipeline = self.contacts = None
        if model.shape_count:
            self.pipeline = newton.CollisionPipeline(model, contact_matching=contact_matching)
            self.contacts = self.pipeline.contacts()
        self.iterations = 0

    def step(self, count, dt, each=None, **options):
        for _ in range(count):
            if self.pipeline is not None:
                self.pipeline.collide(self.state, self.contacts)
            self.solver.step(self.state, self.other, self.control, self.contacts, dt, **options)
            self.state, self.other = self.other, self.state
            self.iterations += int(self.solver.status["iterations"].sum())
            if each is not None:
                each(self)
        return self

    @property
    def q(self):
        return self.state.joint_q.numpy().copy()

    @property
    def qd(self):
        return self.state.joint_qd.numpy().copy()


def rod(builder, joint, **options):
    """A rod of 1 kg whose centre hangs 1 m below a joint at the origin, inertia 0.01 kg m2 about it."""
    body = builder.add_link(mass=1.0, com=wp.vec3(0, 0, -1), inertia=wp.mat33(np.eye(3) * 0.01))
    made = getattr(builder, f"add_joint_{joint}")(-1, body, **options)
    builder.add_articulation([made])


def hinge(angle=0.0, speed=0.0, **options):
    builder = newton.ModelBuilder()
    rod(builder, "revolute", axis=(1, 0, 0), **options)
    builder.joint_q[-1], builder.joint_qd[-1] = angle, speed
    return builder.finalize(device="cpu")


def pile(order):
    """Worlds of capsules that fall on each other, each world with places and speeds of its own."""
    def add(builder, world):
        rng = np.random.default_rng(int(order[world]))
        for level in range(3):
            body = builder.add_body(xform=wp.transform((*rng.uniform(-0.05, 0.05, 2), 0.12 + 0.25 * level),
                                                       quat(rng.normal(size=3) / 2, rng.uniform(0, 0.3))))
            builder.add_shape_capsule(body, radius=0.08, half_height=0.1)
            builder.joint_qd[-6:] = rng.normal(size=6) / 2
    return on_ground(add, len(order), mu=0.6)
