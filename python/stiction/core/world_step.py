"""A step of a world that is kept for its derivative."""

from __future__ import annotations

import numpy as np

from .arguments import number, whole
from .arrays import take
from .derivative import GRADIENT_DTYPE, Gradients
from .world import World, checked


class WorldStep:
    """Makes one step of a world, and keeps the input of its derivative; a rollout keeps one for each of its steps.

        step = stiction.WorldStep(world, wrench)
        gradients = step.vjp(twist=loss_by_twist, position=loss_by_position)
        gradients.twist, gradients.wrench, gradients.friction

    It differentiates the solution of the step's contact problem, restitution and stabilisation included, and its use
    in the step. The set of contacts is frozen; normals, arms, inertias and orientations are, too. Hence `twist`,
    `wrench`, `friction`, `contact_mu` and `depth` are exact. `position` has the derivatives by way of depths alone.
    Exact means to the error of the solve: give the world a tolerance. Give contacts compliance (cfm > 0): a body on
    four corners has no derivative otherwise, and is flagged "singular". There is no forward mode.

    wrench: as for World.step. residual_limit, tie_tolerance, max_unknowns, threads, kappa: as for Derivative. kappa [J]
    relaxes the contact problem; how the twists after it turn the bodies is differentiated at the exact twists.
    """

    def __init__(self, world: World, wrench=None, *, residual_limit: float = 1e-3, tie_tolerance: float = 1e-6,
                 max_unknowns: int = 1024, threads: int = 0, kappa: float = 0.0):
        checked("world", world, World)
        self._core = world._core.keep(world._taken("wrench", wrench, 6), number("residual_limit", residual_limit),
                                      number("tie_tolerance", tie_tolerance), whole("max_unknowns", max_unknowns),
                                      whole("threads", threads), number("kappa", kappa))
        self._dtype, self._shape = world.dtype, world._shape
        self._counts = world.env_count, len(world.shapes)

    def vjp(self, *, twist=None, position=None) -> Gradients:
        """Pulls derivatives of a loss by the twists (B, bodies, 6) and positions (B, bodies, 3) after the step back to
        its beginning. None: zeros.

        Returns derivatives by position (B, bodies, 3), twist and wrench (B, bodies, 6). Also by friction of each shape
        (B, shapes), contact_mu and depth (contacts,). `status` has a record of GRADIENT_DTYPE for each environment.
        One that is refused gets zeros and a flag (`valid`, `flagged`).
        """
        seen = []
        for name, value, width in (("twist", twist, 6), ("position", position, 3)):
            value = np.zeros(self._shape(width), self._dtype) if value is None else value
            seen.append(take(name, value, self._dtype, self._shape(width), "cpu"))
        found = self._core.pull(*seen)
        status = found.pop("status").view(GRADIENT_DTYPE)
        shapes = {"position": self._shape(3), "twist": self._shape(6), "wrench": self._shape(6),
                  "friction": self._counts}
        return Gradients(**{name: array.reshape(shapes.get(name, array.shape)) for name, array in found.items()},
                         status=status)
