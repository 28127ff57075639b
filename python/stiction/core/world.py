"""Worlds of rigid bodies: contacts are found, solved and stepped by the library."""

from __future__ import annotations

import collections.abc
import dataclasses
from typing import NamedTuple

import numpy as np

from .. import _core
from .arguments import number, whole, word
from .arrays import FLOATS, STATUS_DTYPE, apart, look, status_bytes, take
from .batch import Batch
from .progress import Progress
from .solution import SOLVED

#: Kinds of shapes by number, and how many sizes each has.
_KINDS = {"sphere": 1, "capsule": 2, "box": 3, "plane": 0}
#: Methods that solve bodies.
_METHODS = ("npgs", "pgs", "newton", "multigrid")
#: Arrays of a checkpoint.
_CHECKPOINT = ("position", "orientation", "twist", "contact_offsets", "contact_id", "impulse")
#: Into how many calls many steps are divided where progress is shown.
_PIECES = 100


def _numbers(owner, name, value, length):
    """Returns that many numbers as a tuple of floats."""
    try:
        numbers = tuple(float(number) for number in np.asarray(value, np.float64).reshape(-1))
    except (TypeError, ValueError):
        raise TypeError(f"{owner}.{name}: expected {length} numbers, got {value!r}") from None
    if len(numbers) != length:
        raise ValueError(f"{owner}.{name}: expected {length} numbers, got {len(numbers)}")
    return numbers


@dataclasses.dataclass(frozen=True)
class Shape:
    """A shape fixed to a body, or to the world. Lengths in m.

    kind, size: "sphere" and its radius. "capsule": radius, and half length of the segment along its z axis. "box": half
        extents. "plane": no size; the half space below its x-y plane, of the world alone.
    body: its place in the world's list of bodies, -1: the world. position, orientation: of its centre and axes, in the
        body's axes; a unit quaternion (w, x, y, z).
    mu: friction, at most 1e12; a pair has the square root of the product of its two [-]. restitution: a pair has the
        larger of its two, in [0, 1].
    """

    kind: str
    size: tuple = ()
    body: int = -1
    position: tuple = (0.0, 0.0, 0.0)
    orientation: tuple = (1.0, 0.0, 0.0, 0.0)
    mu: float = 0.5
    restitution: float = 0.0

    def __post_init__(self):
        if not isinstance(self.kind, str) or self.kind not in _KINDS:
            raise ValueError(f"Shape.kind: expected one of {', '.join(_KINDS)}, got {self.kind!r}")
        size = np.atleast_1d(self.size)
        object.__setattr__(self, "size", _numbers("Shape", "size", size, _KINDS[self.kind]))
        object.__setattr__(self, "body", whole("Shape.body", self.body))
        object.__setattr__(self, "position", _numbers("Shape", "position", self.position, 3))
        object.__setattr__(self, "orientation", _numbers("Shape", "orientation", self.orientation, 4))
        for name in ("mu", "restitution"):
            object.__setattr__(self, name, *_numbers("Shape", name, [getattr(self, name)], 1))

    @property
    def _kind(self):
        return tuple(_KINDS).index(self.kind)

    @property
    def _sizes(self):
        return self.size + (0.0,) * (3 - len(self.size))


@dataclasses.dataclass(frozen=True)
class Body:
    """A rigid body, and where every environment begins. Its axes are its principal axes.

    mass [kg]. inertia: principal moments about the centre of mass [kg m2]. position: of the centre of mass [m].
    orientation: unit quaternion (w, x, y, z), from its axes to the world's. twist: velocity [m/s] and spin [rad/s].
    """

    mass: float
    inertia: tuple
    position: tuple = (0.0, 0.0, 0.0)
    orientation: tuple = (1.0, 0.0, 0.0, 0.0)
    twist: tuple = (0.0,) * 6

    def __post_init__(self):
        object.__setattr__(self, "mass", *_numbers("Body", "mass", [self.mass], 1))
        for name, length in (("inertia", 3), ("position", 3), ("orientation", 4), ("twist", 6)):
            object.__setattr__(self, name, _numbers("Body", name, getattr(self, name), length))

    @classmethod
    def solid(cls, shape: Shape, density: float, **begin) -> Body:
        """The body of uniform density [kg/m3] that has this shape. begin: position, orientation or twist instead of
        the shape's.
        """
        mass, inertia, position, orientation = _core.solid_body(checked("shape", shape, Shape),
                                                                number("density", density))
        return cls(mass, inertia, **{"position": position, "orientation": orientation} | begin)


def checked(name, value, expected):
    if not isinstance(value, expected):
        raise TypeError(f"{name}: expected a stiction.{expected.__name__}, got {type(value).__name__}")
    return value


class WorldState(NamedTuple):
    """Bodies of all environments. position: of the centres of mass (B, bodies, 3) [m]. orientation: unit quaternions
    (w, x, y, z) (B, bodies, 4). twist (B, bodies, 6) [m/s, rad/s].
    """

    position: object
    orientation: object
    twist: object


class World:
    """Many environments of the same rigid bodies, stepped together (docs/howto/stepping.md): contacts are found, solved by
    the body solver and integrated. Environments differ in state and forces. An environment's bits depend on the
    description, the options and its own state, and on nothing else. They are those of C++ and of `stiction step`.

        floor, ball = stiction.Shape("plane"), stiction.Shape("sphere", 0.1, body=0)
        world = stiction.World([stiction.Body.solid(ball, 1000.0, position=(0, 0, 0.5))], [floor, ball], 4096)
        for _ in range(200):
            world.step(wrench)                       # float64 (B, bodies, 6), or None
        world.state().position, world.status["residual"], world.hash()

    bodies, shapes: of Body and of Shape. env_count: environments. device: as for Solver. gravity [m/s2]. dtype:
    "float64" or "float32". dt [s], erp, slop [m], cfm [m/(N s)], restitution_threshold [m/s]: as for Batch.from_bodies.
    A restitution_threshold of None is the speed that gravity gives in five steps, at most 0.1.
    law: "coulomb", "convex" or "boxed" (docs/math/box_friction.md, for "npgs" and "pgs").
    solver: "npgs" (sequential impulses with momentum, the default), "pgs" (without), "newton" or "multigrid". Bodies
    that lie on others a thousand times lighter need "newton"; `solved` shows where sweeps did not suffice.
    max_iterations: of each step, at most; 4000 by default, in float32 2000. tolerance: on the relative residual, 1e-7 by
    default, in float32 1e-4; 0: all iterations. omega: relaxation. blocks: "pairs" for "npgs" and "pgs"
    (docs/howto/blocks.md).
    margin: gap up to which a pair is a contact even if it does not close [m]. warm_start: share of a contact's last
    impulse that its next one starts from, in [0, 1]. max_contacts_per_env: the deepest are solved, 0: all.
    threads: 0: all cores; the bits do not depend on it.

    A world may be used by several threads, which take turns; Python goes on while it steps. Raises stiction.Error for
    arguments that the library refuses, and changes nothing then.
    """

    def __init__(self, bodies, shapes, env_count: int, device: str = "cpu", *, gravity=(0.0, 0.0, -9.81),
                 dtype: str = "float64", dt: float = 0.005, erp: float = 0.2, slop: float = 0.0, cfm: float = 0.0,
                 restitution_threshold: float | None = None, law: str = "coulomb", solver: str = "npgs",
                 max_iterations: int | None = None, tolerance: float | None = None, omega: float = 1.0,
                 margin: float = 0.01, warm_start: float = 0.95, max_contacts_per_env: int = 0, threads: int = 0,
                 blocks: str = "cones"):
        if solver not in _METHODS:
            raise ValueError(f"solver: expected one of {', '.join(_METHODS)}, got {solver!r}")
        self.dtype = str(np.dtype(dtype))
        if self.dtype not in FLOATS:
            raise TypeError(f"dtype: expected float32 or float64, got {self.dtype}")
        self.bodies = tuple(checked(f"bodies[{i}]", body, Body) for i, body in enumerate(bodies))
        self.shapes = tuple(checked(f"shapes[{i}]", shape, Shape) for i, shape in enumerate(shapes))
        self.gravity = _numbers("World", "gravity", gravity, 3)
        self.env_count, self.law, self.solver = whole("env_count", env_count), word("law", law), solver
        if restitution_threshold is None:
            restitution_threshold = _core.slowest_bounce(self.gravity, number("dt", dt))
        self.stepping = (number("dt", dt), number("erp", erp), number("slop", slop), number("cfm", cfm),
                         number("restitution_threshold", restitution_threshold), 1,
                         whole("max_contacts_per_env", max_contacts_per_env))
        iterations, error = _core.until_solved(self.dtype == "float64")
        options = _core.Options("npgs" if solver == "multigrid" else solver, None,
                                number("tolerance", error if tolerance is None else tolerance),
                                whole("max_iterations", iterations if max_iterations is None else max_iterations), 0,
                                number("omega", omega), whole("threads", threads), True, "together", 1024, None,
                                blocks=word("blocks", blocks))
        self._core = _core.World(str(device), self.bodies, self.shapes, self.gravity, self.env_count,
                                 _core.BodyOptions(options, solver, law, *self.stepping), number("margin", margin),
                                 number("warm_start", warm_start), self.dtype == "float64")
        self.device = self._core.device

    def __len__(self) -> int:
        return self.env_count

    def __repr__(self):
        return (f"<stiction.World of {self.env_count} environments, {len(self.bodies)} bodies, {len(self.shapes)} "
                f"shapes, {self.dtype} on {self.device}>")

    @property
    def dt(self) -> float:
        """Length of a step [s]."""
        return self.stepping[0]

    def _shape(self, width):
        return (self.env_count, len(self.bodies), width)

    def _taken(self, name, value, width):
        return None if value is None else take(name, value, self.dtype, self._shape(width), "cpu")

    def step(self, wrench=None, count: int = 1, progress: bool = False) -> None:
        """Makes `count` steps. Ctrl-C ends between two of them, and the world goes on from there.

        wrench: force [N] and torque about the centre of mass [N m] on every body in these steps, world axes. An array
            (B, bodies, 6) of any framework on the host; None: no forces.
        progress: a bar on the terminal (stiction.monitor.Progress). The bits are the same.

        An environment whose state or wrench is not finite ends as "invalid_input" and stays where it is; no other
        environment changes a bit.
        """
        count = whole("count", count, 2**63 - 1)
        if count < 0:
            raise ValueError(f"count: expected at least 0 steps, got {count}")
        forces, done = self._taken("wrench", wrench, 6), 0
        if not progress:
            return self._core.step(forces, count)
        with Progress(total=count, title="steps", unit="step") as bar:
            while done < count:
                piece = min(max(1, count // _PIECES), count - done)
                self._core.step(forces, piece)
                bar.update(piece)
                done += piece

    def state(self, out=None) -> WorldState:
        """Positions, orientations and twists of all environments, in new NumPy arrays.

        out: a WorldState, or a dict of `position`, `orientation` and `twist`: arrays of any framework on the host that
            are written instead.
        """
        if out is None:
            out = WorldState(*(np.empty(self._shape(width), self.dtype) for width in (3, 4, 6)))
        elif isinstance(out, dict):
            if set(out) != set(WorldState._fields):
                raise ValueError(f"out: expected position, orientation and twist, got {', '.join(map(str, out))}")
            out = WorldState(**out)
        elif not isinstance(out, WorldState):
            raise TypeError(f"out: expected a WorldState or a dict of arrays, got {type(out).__name__}")
        seen = [take(f"out.{name}", value, self.dtype, self._shape(width), "cpu", writable=True)
                for (name, value), width in zip(out._asdict().items(), (3, 4, 6))]
        apart([f"out.{name}" for name in out._fields], seen)
        self._core.state(*seen)
        return out

    def reset(self, mask=None, position=None, orientation=None, twist=None) -> None:
        """Puts environments into another state and forgets their contacts.

        mask: bool or uint8 (B,), which ones; None: all.
        position, orientation, twist: as of state(). An argument that is not given stays as it is. If none is given,
            environments begin at the description's. Quaternions are normalised. Nothing is read for environments that
            are not chosen.
        """
        if mask is None:
            mask = np.ones(self.env_count, np.uint8)
        elif look("mask", mask).dtype == "bool":
            take("mask", mask, "bool", (self.env_count,), "cpu")
            mask = np.asarray(mask).view(np.uint8)
        self._core.reset(take("mask", mask, "uint8", (self.env_count,), "cpu"), self._taken("position", position, 3),
                         self._taken("orientation", orientation, 4), self._taken("twist", twist, 6))

    def checkpoint(self) -> dict:
        """The world between two steps: all that the next ones depend on but description, options and forces.

        New NumPy arrays, for np.savez for instance. position, orientation, twist: as of state(). contact_offsets int64
        (B + 1), contact_id uint64 (contacts,) and impulse (contacts, 3) [N s]: of the last step's contacts.
        """
        found = self._core.checkpoint()
        widths = {"position": self._shape(3), "orientation": self._shape(4), "twist": self._shape(6), "impulse": (-1, 3)}
        return {name: array.reshape(widths.get(name, -1)) for name, array in found.items()}

    def resume(self, checkpoint) -> None:
        """Goes on from a checkpoint() of a world with the same description, options and env_count, on any device.

        The next steps have the bits that its next steps had. Until the next step `status` is all zero.

        checkpoint: a mapping of these six arrays, an open np.load file too. Nothing is changed if one does not fit.
        """
        if not isinstance(checkpoint, collections.abc.Mapping):
            raise TypeError(f"checkpoint: expected a mapping of arrays, got {type(checkpoint).__name__}")
        missing = [name for name in _CHECKPOINT if name not in checkpoint]
        if missing:
            raise ValueError(f"checkpoint: expected {', '.join(_CHECKPOINT)}, got no {', '.join(missing)}")
        ids = np.asarray(checkpoint["contact_id"])
        shapes = {"position": (self.dtype, self._shape(3)), "orientation": (self.dtype, self._shape(4)),
                  "twist": (self.dtype, self._shape(6)), "contact_offsets": ("int64", (self.env_count + 1,)),
                  "contact_id": ("uint64", ids.shape[:1]), "impulse": (self.dtype, (*ids.shape[:1], 3))}
        self._core.resume(*(take(f"checkpoint[{name!r}]", checkpoint[name], *shapes[name], "cpu")
                            for name in _CHECKPOINT))

    @property
    def status(self) -> np.ndarray:
        """Outcome of the last step's solve: records (B,) of stiction.STATUS_DTYPE, all zero before the first step."""
        records = np.zeros(self.env_count, STATUS_DTYPE)
        self._core.status(_core.Array(status_bytes(records)))
        return records

    @property
    def solved(self) -> np.ndarray:
        """True for each environment whose last step reached the tolerance, bool (B,)."""
        return self.status["code"] == SOLVED

    def contacts(self) -> WorldContacts:
        """Contacts of the last step and their final impulses."""
        return WorldContacts(self)

    def motion(self) -> dict:
        """Quantities that are conserved, or should be, summed in float64. kinetic, potential: energy (B,) [J].
        momentum (B, 3) [N s]. angular_momentum: about the origin (B, 3) [N m s].
        """
        all_ = np.zeros((self.env_count, 8))
        self._core.motion(_core.Array(all_))
        return {"kinetic": all_[:, 0].copy(), "potential": all_[:, 1].copy(), "momentum": all_[:, 2:5].copy(),
                "angular_momentum": all_[:, 5:].copy()}

    def hash(self) -> str:
        """Hash of the bits of all positions, orientations and twists, as `stiction step` prints it."""
        return f"{self._core.hash():016x}"

    def seconds(self) -> dict:
        """Time of all steps by part [s]: detect, plan, solve, integrate."""
        return self._core.seconds()


class WorldContacts:
    """Contacts of a world's last step, of all environments one after another, in NumPy arrays of their own.

    offsets: int64 (B + 1), where each environment's begin. body_a, body_b: int32 (contacts,), -1 the world. arm_a,
    arm_b (contacts, 3): the point from the centres of mass [m]. normal (contacts, 3): unit, from a to b. mu, depth [m],
    restitution (contacts,). id: uint64 (contacts,), 64 times the pair of shapes and the feature. impulse (contacts, 3):
    normal and two tangents, on b [N s]. inv_mass (B, bodies) [1/kg], inv_inertia (B, bodies, 6): xx, xy, xz, yy, yz,
    zz in world axes [1/(kg m2)], of the step.
    """

    def __init__(self, world):
        for name, array in world._core.contacts().items():
            width = {"arm_a": 3, "arm_b": 3, "normal": 3, "impulse": 3}.get(name)
            if width:
                array = array.reshape(-1, width)
            elif name in ("inv_mass", "inv_inertia"):
                array = array.reshape(world._shape(6) if name == "inv_inertia" else world._shape(6)[:2])
            setattr(self, name, array)
        self._world = world

    def __len__(self) -> int:
        return len(self.body_a)

    def batch(self, twist, twist_change=None) -> Batch:
        """The step's contact problem as a batch of bodies, for the solvers of batches. twist: before the step (B,
        bodies, 6); twist_change: its change by forces but contact over the step, None: nothing.
        """
        world = self._world
        twist, twist_change = (None if value is None else np.ascontiguousarray(value).reshape(-1, 6)
                               for value in (twist, twist_change))
        bodies = np.arange(world.env_count + 1, dtype=np.int64) * len(world.bodies)
        dt, erp, slop, cfm, threshold, _, most = world.stepping
        return Batch.from_bodies(self.inv_mass.reshape(-1), self.inv_inertia.reshape(-1, 6), twist, self.body_a,
                                 self.body_b, self.arm_a, self.arm_b, self.normal, self.mu, self.depth,
                                 self.restitution, twist_change=twist_change, body_offsets=bodies,
                                 contact_offsets=self.offsets, law=world.law, dt=dt, erp=erp, slop=slop, cfm=cfm,
                                 restitution_threshold=threshold, max_contacts_per_env=most)
