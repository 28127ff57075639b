"""Drawing of a stiction.World."""

import numpy as np

from .frame import Contacts, Frame, Geometry, islands, tangents


def _reach(shape):
    """Radius of a ball about the shape's centre that holds it; of a plane 0."""
    size = shape.size
    return {"sphere": lambda: size[0], "capsule": lambda: size[0] + size[1], "box": lambda: float(np.linalg.norm(size)),
            "plane": lambda: 0.0}[shape.kind]()


class WorldSource:
    """Bodies, contacts and residuals of a world as it is now."""

    def __init__(self, world):
        self._world, self._step = world, None
        self.env_count, self.dt = world.env_count, world.dt
        self.up = -np.asarray(world.gravity)
        self.weight = sum(body.mass for body in world.bodies) * float(np.linalg.norm(world.gravity))
        self.bodies = [f"body_{i}" for i in range(len(world.bodies))]
        self.geometries = [Geometry(f"shape_{i}", s.kind, s.size, s.body, s.position, s.orientation)
                           for i, s in enumerate(world.shapes)]
        self.reach = max((_reach(shape) for shape in world.shapes), default=0.0)

    def look(self):
        """Copies the source of the frames of this time."""
        self._state, self._contacts = self._world.state(), self._world.contacts()
        self.status = self._world.status

    def frame(self, env) -> Frame:
        """One environment, after look()."""
        position, orientation, twist = (np.asarray(part[env], np.float64) for part in self._state)
        found, (first, last) = self._contacts, self._contacts.offsets[env:env + 2]
        part = slice(int(first), int(last))
        a, b = (np.asarray(getattr(found, name)[part], int) for name in ("body_a", "body_b"))
        arm_a, arm_b, normal, impulse, mu = (np.asarray(getattr(found, name)[part], np.float64)
                                             for name in ("arm_a", "arm_b", "normal", "impulse", "mu"))
        # Contacts are found where the step began; the world's arms are points.
        began = np.concatenate([position - self.dt * twist[:, :3], np.zeros((1, 3))])
        moving = np.concatenate([twist, np.zeros((1, 6))])
        use_b = (b >= 0)[:, None]
        point = np.where(use_b, began[b] + arm_b, began[a] + arm_a)
        motion = [moving[k, :3] + np.cross(moving[k, 3:], arm) for k, arm in ((a, arm_a), (b, arm_b))]
        relative = motion[1] - motion[0]
        slip = relative - (relative * normal).sum(axis=1, keepdims=True) * normal
        island = islands(len(position), np.stack([a, b], axis=1))
        contacts = Contacts(point, tangents(normal), impulse / self.dt, np.stack([mu, mu], axis=1), slip,
                            np.where(b >= 0, island[b], island[a]) if len(position) else np.zeros(len(a), int) - 1)
        return Frame(position, orientation, island, contacts)
