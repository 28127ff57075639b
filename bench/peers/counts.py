"""Floating-point operations and bytes of one Gauss-Seidel sweep, counted from the sweep's formulas: nothing here is measured.

A multiply-add is two operations; square root and division are one each; comparisons, selections, index arithmetic and
checks of the residual are none. All contacts have three rows, Coulomb's law, and move in every sweep. With s bytes a
number, n = 3 c rows, d degrees of freedom:

    matrix   a cone's step, then y += A[:, cone] d (core/algorithm/sweep/sweep.hpp, local_solve.hpp). Every 16 sweeps y = A x + b
             afresh. Operations: 2 n^2 (1 + 1/16) + STEP c. Bytes: A (1 + 1/16), x and y read and written, three numbers a cone
    factor   u = Y' x afresh, then for each cone y = Y u, its step, and u += Y' d: 6 n d + STEP c operations (a row's product is
             four sums). Bytes: Y twice (for u, and at the cone, whose three rows stay near while they are used again), b and R
             read, x read and written
    bodies   a cone from its two bodies' twists, its step pushed back into them (core/algorithm/rigid/si_sweep.hpp). Operations: see
             CONTACT. Bytes, in packs (body_pack.hpp): 16 numbers of a contact, its tangents and two sides as wide as numbers
             read, x read and written, of every body 7 numbers read and 6 read and written; bodies are counted once, though
             each contact asks for two. Lanes push the same bodies, so no masses are kept by contact

npgs adds per row 3 operations for x and 3 for y (x += beta (x - before)) and reads and writes both before. Bytes are
compulsory traffic. They must come from where the environment (or the pack of environments in lock-step) lies when
nothing is kept nearer between two sweeps. What is read again within a sweep is not counted again.
"""

import dataclasses

REFRESH = 16  # sweeps between two times that y is recomputed (kRefreshInterval)

# Normal: gain 1, multiply-add 2, change 1. Two tangents: gain 1, motion 4, step 4, change 2. Disk: norm 4, quotient 1, scaling 2.
# Then x of three rows 3, size of the step 1.
STEP = 4 + 11 + 7 + 4

# Relative velocity 12 + 12 + 3. Motion of the rows 8 + 9 + 9. The step. Impulse in the world's axes 2 + 15. A body's
# answer 9 (arm x impulse) + 6 (linear) + 18 (angular), for two.
CONTACT = 27 + 26 + STEP + 17 + 2 * 33


@dataclasses.dataclass
class Sweep:
    operations: float
    bytes: float

    @property
    def intensity(self):
        return self.operations / self.bytes


def of_matrix(contacts, size, momentum=False):
    rows, again = 3 * contacts, 1 + 1 / REFRESH
    return Sweep(2 * rows**2 * again + STEP * contacts + 6 * rows * momentum,
                 size * (rows**2 * again + 4 * rows + 3 * contacts + 4 * rows * momentum))


def of_factor(contacts, dofs, size):
    rows = 3 * contacts
    return Sweep(6 * rows * dofs + STEP * contacts, size * (2 * rows * dofs + 4 * rows + 3 * contacts))


def of_bodies(contacts, bodies, size):
    return Sweep(CONTACT * contacts, size * (30 * contacts + 19 * bodies))
