"""stiction as MJX's constraint solver: answers as MuJoCo has them in double, jitted, vmapped and differentiated."""

import numpy as np
import pytest
from frameworks import framework

mujoco = pytest.importorskip("mujoco", reason="stiction.mjx is NOT tested: pip install mujoco")
jax = framework("jax", "stiction.mjx is")
mjx = framework("mujoco.mjx", "stiction.mjx is")

import stiction.jax  # noqa: E402
import stiction.mjx  # noqa: E402
from mujoco.mjx._src import solver as theirs  # noqa: E402
from stiction.core.replaced import replaced  # noqa: E402

# Few geoms: MJX has rows for every pair of them, touching or not.
SCENE = """
<mujoco><option timestep="0.004" cone="{cone}" integrator="{integrator}" iterations="60" tolerance="1e-12"/>
<worldbody><geom type="plane" size="5 5 1" friction="0.5 0.01 0.001"/>
  <body pos="0 0 .0995"><freejoint/><geom type="sphere" size=".1" condim="{condim}" friction="0.6 0.02 0.001"/></body>
  <body pos="-1 0 .5"><joint name="a" axis="0 1 0" range="0 1" limited="true" frictionloss="0.3"/>
    <geom type="capsule" fromto="0 0 0 .3 0 0" size=".04" contype="0" conaffinity="0"/>
    <body pos=".3 0 0"><joint name="b" axis="0 1 0"/>
      <geom type="sphere" size=".05" contype="0" conaffinity="0"/></body>
  </body>
</worldbody><equality><joint joint1="a" joint2="b"/></equality></mujoco>"""


def scene(cone="elliptic", condim=3, integrator="Euler"):
    return mujoco.MjModel.from_xml_string(SCENE.format(cone=cone, condim=condim, integrator=integrator))


def states(model, count):
    """MuJoCo's data of a few states, in contact and not, and the same as MJX's of a leading axis."""
    datas = []
    for seed in range(count):
        data = mujoco.MjData(model)
        data.qvel[:] = np.random.default_rng(seed).uniform(-1, 1, model.nv)
        data.qpos[2] += 0.2 * (seed % 3 == 2)
        mujoco.mj_forward(model, data)
        datas.append(data)
    one = mjx.put_data(model, datas[0])
    stack = {name: jax.numpy.asarray(np.stack([getattr(data, name) for data in datas]), jax.numpy.float32)
             for name in ("qpos", "qvel")}
    many = jax.tree_util.tree_map(lambda x: jax.numpy.stack([jax.numpy.asarray(x)] * count), one)
    return datas, many.replace(**stack)


def solved(model, data):
    """Returns MJX's state before its solver, and the solve."""
    with replaced(theirs, "solve", lambda model, data: data):
        data = mjx.forward(model, data)
    return stiction.mjx.solve(model, data, tolerance=1e-6)


@pytest.mark.parametrize("cone, condim", [("pyramidal", 3), ("elliptic", 4)])
def test_answers_are_those_of_mujoco(cone, condim):
    model = scene(cone, condim)
    datas, many = states(model, 6)
    ours, status = jax.jit(jax.vmap(solved, (None, 0)))(mjx.put_model(model), many)
    record = stiction.jax.status(status)
    assert (record["code"] == 0).all() and (record["residual"] <= 1e-6).all()
    assert {data.ncon for data in datas} == {0, 1}
    for world, data in enumerate(datas):
        assert np.abs(ours.qacc[world] - data.qacc).max() < 2e-5 * max(1, np.abs(data.qacc).max())
        pushed = ours._impl.efc_J[world].T @ ours._impl.efc_force[world]
        limit = 2e-5 * max(1, np.abs(data.qfrc_constraint).max())
        for found in (ours.qfrc_constraint[world], pushed):
            np.testing.assert_allclose(found, data.qfrc_constraint, rtol=0, atol=limit)


def test_steps_are_those_of_mjx():
    model = scene()
    _, many = states(model, 3)
    m, own = mjx.put_model(model), theirs.solve
    ours, status = jax.jit(jax.vmap(lambda m, d: stiction.mjx.step(m, d, tolerance=1e-6), (None, 0)))(m, many)
    their = jax.jit(jax.vmap(mjx.step, (None, 0)))(m, many)
    assert (stiction.jax.status(status)["code"] == 0).all()
    for name, limit in (("qpos", 1e-6), ("qvel", 1e-5)):
        assert np.abs(np.asarray(getattr(ours, name)) - np.asarray(getattr(their, name))).max() < limit
    assert theirs.solve is own


def test_a_runge_kutta_step_has_the_status_of_its_last_solve(monkeypatch):
    model = scene(integrator="RK4")
    m, one = mjx.put_model(model), mjx.put_data(model, states(model, 1)[0][0])
    _, status = jax.eval_shape(lambda d: stiction.mjx.step(m, d), one)
    assert status.shape == (32,)
    solves = []
    monkeypatch.setattr(stiction.mjx, "solve", lambda m, d: (d, solves.append(len(solves)) or solves[-1]))
    monkeypatch.setattr(mjx, "step", lambda m, d: [theirs.solve(m, d) for _ in range(4)][-1])
    assert stiction.mjx.step(m, one) == (one, 3)


def test_accelerations_have_derivatives_through_the_contact():
    """By velocities, against differences of MuJoCo in double."""
    model = scene()
    datas, many = states(model, 1)
    m, one = mjx.put_model(model), jax.tree_util.tree_map(lambda x: x[0], many)

    def accelerations(qvel):
        return solved(m, one.replace(qvel=qvel))[0].qacc

    found = np.asarray(jax.jit(jax.jacfwd(accelerations))(one.qvel))
    data, expected = datas[0], np.zeros((model.nv, model.nv))
    start = data.qvel.copy()
    for i in range(model.nv):
        for sign in (1, -1):
            data.qvel[:] = start
            data.qvel[i] += sign * 1e-5
            mujoco.mj_forward(model, data)
            expected[:, i] += sign * data.qacc / 2e-5
    np.testing.assert_allclose(found, expected, rtol=0, atol=2e-3 * np.abs(expected).max())


def test_other_implementations_are_refused():
    class Data:
        _impl = object()

    with pytest.raises(TypeError, match="expected mjx data of impl='jax', got object"):
        stiction.mjx.solve(None, Data())


FALLING = """<mujoco><worldbody>{floor}<body pos="0 0 {height}"><freejoint/><geom size=".1" {contact}/></body></worldbody></mujoco>"""


@pytest.mark.parametrize("floor, contact", [('<geom type="plane" size="5 5 1"/>', ""), ("", 'contype="0" conaffinity="0"')],
                         ids=["rows", "no rows"])
def test_a_world_whose_motion_is_no_number_is_not_solved(floor, contact):
    model = mujoco.MjModel.from_xml_string(FALLING.format(floor=floor, contact=contact, height=0.0995))
    _, many = states(model, 3)
    many = many.replace(qvel=many.qvel.at[1, 4].set(np.nan))
    _, status = jax.jit(jax.vmap(solved, (None, 0)))(mjx.put_model(model), many)
    codes = [stiction.CODES[code] for code in stiction.jax.status(status)["code"]]
    assert codes[0] == codes[2] == "solved" and codes[1] == ("invalid_input" if floor else "numerical")
