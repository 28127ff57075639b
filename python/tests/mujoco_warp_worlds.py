"""Worlds of MuJoCo Warp for tests of stiction.mujoco_warp, and their numbers by code that is neither's."""

import numpy as np
import pytest
from frameworks import framework
from warp_quickly import wp  # noqa: F401

mujoco = pytest.importorskip("mujoco", reason="stiction.mujoco_warp is NOT tested: pip install mujoco")
mujoco_warp = framework("mujoco_warp", "stiction.mujoco_warp is")

from mujoco_zoo import controls, zoo  # noqa: E402

#: Capacities that the zoo's worlds fit.
ROOM = {"njmax": 72, "nconmax": 40}

#: A box that sticks on a slope, one that slides, and a joint with friction.
CREEPING = """
<mujoco><option timestep="0.004" gravity="2 1 -9.81" cone="{cone}" jacobian="{jacobian}"/><worldbody>
  <geom type="plane" size="5 5 1" friction="0.1 0.005 0.0001" solimp="0.5 0.5 0.001"/>
  <body pos="0 0 .0999"><freejoint/><geom type="box" size=".1 .1 .1" friction="0.3"/></body>
  <body pos="1 0 .0999"><freejoint/><geom type="box" size=".1 .1 .1" friction="0.1"/></body>
  <body pos="-1 0 1"><joint axis="0 1 0" frictionloss="1"/>
    <geom type="capsule" fromto="0 0 0 .3 0 0" size=".04"/></body>
</worldbody></mujoco>"""


def disturbed(model, seed, steps=30, speed=0.3):
    """MuJoCo's data of the model, some steps after a start with random velocities, and its forward dynamics."""
    data = mujoco.MjData(model)
    data.qvel[:] = speed * np.random.default_rng(seed).uniform(-1, 1, model.nv)
    for step in range(steps):
        data.ctrl[:] = controls(model, step, seed)
        mujoco.mj_step(model, data)
    mujoco.mj_forward(model, data)
    return data


def worlds_of(model, datas, **room):
    """The same states in MuJoCo Warp, a world each."""
    m = mujoco_warp.put_model(model)
    d = mujoco_warp.make_data(model, nworld=len(datas), **{**ROOM, **room})
    for name in ("qpos", "qvel", "ctrl", "qacc_warmstart"):
        getattr(d, name).assign(np.stack([getattr(one, name) for one in datas]).astype(np.float32))
    return m, d


def zoo_worlds(cone="elliptic", jacobian="dense", count=3, integrator="Euler", **room):
    """Worlds of the model with every kind of row, MuJoCo's data of each, and its model."""
    model = zoo(cone, integrator, jacobian)
    datas = [disturbed(model, seed) for seed in range(count)]
    m, d = worlds_of(model, datas, **room)
    return model, datas, m, d


def numbers(d, *names):
    """Copies of arrays of data, or of its efc."""
    return [(getattr(d, name) if hasattr(d, name) else getattr(d.efc, name)).numpy().copy() for name in names]


def dense_rows(model, d, world):
    """J (n, nv) and M (nv, nv) of one world in double."""
    n, nv = int(d.nefc.numpy()[world]), model.nv
    J = np.zeros((n, nv))
    if d.efc.J.shape[1] == 1:
        count, first, column = (a.numpy()[world] for a in (d.efc.J_rownnz, d.efc.J_rowadr, d.efc.J_colind))
        values = d.efc.J.numpy()[world, 0]
        for row in range(n):
            entries = slice(first[row], first[row] + count[row])
            J[row, column[0, entries]] = values[entries]
    else:
        J[:] = d.efc.J.numpy()[world, :n, :nv]
    M, values = np.zeros((nv, nv)), d.M.numpy()[world].astype(float)
    for i in range(nv):
        for k in range(model.M_rowadr[i], model.M_rowadr[i] + model.M_rownnz[i]):
            M[i, model.M_colind[k]] = M[model.M_colind[k], i] = values[k]
    return J, M


def sweep_to_the_end(model, d, world=0, iterations=20_000):
    """Accelerations that MuJoCo's noslip aims at: friction without softness, at the normal forces of d. In double, by
    Nesterov's method on disks and intervals. Also the largest step that it would still make."""
    J, M = dense_rows(model, d, world)
    n = len(J)
    force, aref, loss = (getattr(d.efc, name).numpy()[world, :n].astype(float)
                         for name in ("force", "aref", "frictionloss"))
    kind, ids = d.efc.type.numpy()[world, :n], d.efc.id.numpy()[world, :n]
    friction, dim = d.contact.friction.numpy().astype(float), d.contact.dim.numpy()
    base, directions, sets, row = force.copy(), [], [], 0

    def along(*entries):
        direction = np.zeros(n)
        for place, value in entries:
            direction[place] = value
        directions.append(direction)
        return len(directions) - 1

    while row < n:
        if kind[row] in (1, 2):
            base[row] = 0
            sets.append(([along((row, 1.0))], loss[row]))
        elif kind[row] == 6:
            base[row] = base[row + 1] = half = (force[row] + force[row + 1]) / 2
            sets.append(([along((row, 1.0), (row + 1, -1.0))], max(half, 0)))
            row += 1
        elif kind[row] == 7:
            axes = range(1, dim[ids[row]])
            base[row + 1:row + len(axes) + 1] = 0
            sets.append(([along((row + axis, friction[ids[row], axis - 1])) for axis in axes], force[row]))
            row += len(axes)
        row += 1
    by, push = np.array(directions).T, np.linalg.solve(M, J.T)
    free = d.qacc_smooth.numpy()[world].astype(float)
    H, g = by.T @ J @ push @ by, by.T @ (J @ (free + push @ base) - aref)
    bound = np.linalg.eigvalsh(H)[-1]

    def project(x):
        x = x.copy()
        for places, radius in sets:
            length = np.linalg.norm(x[places])
            if length > radius:
                x[places] *= radius / length
        return x

    x = y = np.zeros(len(g))
    t = 1.0
    for _ in range(iterations):
        following = project(y - (H @ y + g) / bound)
        if (following - x) @ (y - following) > 0:
            t = 1.0
        larger = (1 + np.sqrt(1 + 4 * t * t)) / 2
        y = following + (t - 1) / larger * (following - x)
        x, t = following, larger
    left = np.abs(project(x - (H @ x + g) / bound) - x).max()
    return free + push @ (base + by @ x), left
