"""Clarabel, an interior point of others, on the associated (convex) law: min 1/2 x'(A + R)x + b'x over the cones.

Needs clarabel and scipy (PyPI). Coulomb's law is no convex problem and is not for this solver. Nor is a linear
complementarity problem whose matrix is not symmetric and positive semidefinite.
"""

import time

import clarabel
import numpy as np
import scipy.sparse as sparse

from environments import BOX, FREE, FRICTION

VERSION = f"Clarabel {clarabel.__version__}"


def cones_of(environment, bound_unit):
    """(G, h, cones) of G x + s = h, s in the cones."""
    entries, h, cones, row = [], [], [], 0

    def add(column, factor, right=0.0):
        nonlocal row
        entries.append((row, column, factor))
        h.append(right)
        row += 1

    for kind, begin, end in zip(environment.kinds, environment.cone_offsets[:-1], environment.cone_offsets[1:]):
        if kind == FREE:
            continue
        if kind != FRICTION:
            bound = environment.row_param[begin] * bound_unit if kind == BOX else 0.0
            add(begin, -1.0, bound)
            if kind == BOX:
                add(begin, 1.0, bound)
            cones.append(clarabel.NonnegativeConeT(2 if kind == BOX else 1))
            continue
        mu = environment.row_param[begin:end]
        gripping = [i for i in range(begin + 1, end) if mu[i - begin] > 0]
        add(begin, -1.0)
        for i in gripping:
            add(i, -1.0 / mu[i - begin])
        cones.append(clarabel.SecondOrderConeT(1 + len(gripping)) if gripping else clarabel.NonnegativeConeT(1))
        slipping = [i for i in range(begin + 1, end) if i not in gripping]
        for i in slipping:
            add(i, 1.0)
        if slipping:
            cones.append(clarabel.ZeroConeT(len(slipping)))
    rows, columns, values = zip(*entries) if entries else ((), (), ())
    return sparse.csc_matrix((values, (rows, columns)), shape=(row, environment.rows)), np.array(h), cones


def solve(environment, tolerance, seconds):
    """(reaction, seconds, whether Clarabel calls it solved).

    Units are taken out first, since Clarabel also stops on absolute gaps. x = unit y with max|b| and the mean diagonal
    of A + R equal to one.
    """
    offsets, columns, values = environment.with_compliance()
    matrix = sparse.csr_matrix((values, columns, offsets), shape=(environment.rows,) * 2).tocsc()
    scale, size = matrix.diagonal().mean(), np.abs(environment.b).max(initial=0.0)
    if not (scale > 0 and size > 0):
        return np.zeros(environment.rows), 0.0, False
    unit = size / scale
    g, h, cones = cones_of(environment, 1 / unit)
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.max_iter = 200
    settings.time_limit = 4 * seconds  # of wall clock, on a machine that may have other work
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = tolerance
    half = sparse.triu((matrix + matrix.T) / (2 * scale), format="csc")
    begin = time.perf_counter(), time.process_time()
    solution = clarabel.DefaultSolver(half, environment.b / size, g, h, cones, settings).solve()
    spent, processor = time.perf_counter() - begin[0], time.process_time() - begin[1]
    if spent > 0.1:  # the processor's clock leaves out other programs, and may tick once in 10 ms
        spent = min(spent, processor)
    return np.array(solution.x) * unit, spent, str(solution.status) in ("Solved", "AlmostSolved")
