"""Models that are stepped in lanes, states of them, and a measure; shared by tests of engine="lanes"."""

import pathlib

import numpy as np
import pytest

mujoco = pytest.importorskip("mujoco", reason='engine="lanes" is NOT tested: pip install mujoco')

# A ball after a slide, offsets of everything, two trees and a body without mass of its own frame.
JOINTS = """
<mujoco><option timestep="0.004" gravity="0.3 -0.2 -9.81" integrator="{integrator}" cone="{cone}"/>
<default><geom contype="0" conaffinity="0"/></default><worldbody>
<body pos="0 0 1"><freejoint/><geom type="box" size=".2 .1 .05" pos=".02 .01 .03" euler="10 20 30"/>
  <body pos=".2 .1 0" euler="15 -20 40">
    <joint type="ball" pos=".02 -.03 .01" damping=".3" armature=".01"/>
    <geom type="ellipsoid" size=".05 .08 .2" pos="0 0 -.2"/>
    <body pos="0 .02 -.4" gravcomp=".7"><joint type="slide" axis="1 2 3" damping="2" stiffness="50" springref=".1"/>
      <joint name="h" type="hinge" axis="0 -1 0" pos="0 0 .05" damping=".2" stiffness="3" ref=".2" actuatorfrcrange="-2 1"/>
      <geom type="capsule" fromto="0 0 0 .1 .2 -.3" size=".03"/></body></body>
  <body pos="-.2 0 0"><joint type="ball" damping=".1"/><geom type="sphere" size=".08" pos="0 0 -.1"/></body></body>
<body pos="2 0 1"><joint name="s" type="slide" axis="0 0 1"/><joint type="ball" pos="0 .1 0" damping=".2"/>
  <geom type="box" size=".1 .2 .3"/><body pos="0 .3 .1"><geom type="capsule" size=".04 .2" euler="30 0 0"/></body></body>
</worldbody><actuator><motor joint="s" gear="1"/><position joint="h" kp="20" kv="2"/></actuator></mujoco>"""

# A quadruped with servos, dry friction, limits and joints that follow others; feet of spheres, a trunk that is a box, on a tilted plane.
DOG = """
<mujoco><option timestep="0.003" integrator="{integrator}" cone="{cone}" impratio="2"/>
<default><joint damping=".4" armature=".02" frictionloss=".3" solimplimit=".8 .97 .02 .3 3" limited="true"/>
<geom condim="3" friction=".8 .02 .001" solref=".015 1.1"/></default>
<worldbody><geom name="ground" type="plane" size="0 0 1" euler="4 -3 10" margin=".01" contype="3" conaffinity="3"/>
<body name="trunk" pos="0 0 .45"><freejoint/>
<geom type="box" size=".25 .12 .06" mass="5" priority="1" friction=".6 .1 .1" contype="2" conaffinity="2"/>
{legs}</body></worldbody><actuator>{servos}</actuator>
<contact><exclude body1="trunk" body2="foot0"/></contact><equality>
<joint joint1="knee0" joint2="hip1" polycoef=".1 .8 .3 -.2 .1" solref=".03 1"/>
<joint joint1="hip3" polycoef=".2 0 0 0 0"/><joint joint1="hip0" joint2="hip2" active="false"/></equality></mujoco>"""
LEG = """<body pos="{x} {y} 0"><joint name="hip{i}" axis="0 1 0" range="-60 60" margin=".02"/>
<geom type="capsule" fromto="0 0 0 0 0 -.2" size=".03" mass=".6"/>
<body name="foot{i}" pos="0 0 -.2"><joint name="knee{i}" axis="0 1 0" range="-20 110" solreflimit="-400 -20"/>
<geom type="capsule" fromto="0 0 0 0 0 -.18" size=".02" mass=".3"/>
<geom type="sphere" size=".03" pos="0 0 -.2" mass=".05" condim="6" friction="1.1 .03 .01" margin=".004" gap=".002"/></body></body>"""
SERVOS = ('<position joint="hip{i}" kp="40" kv="1" forcerange="-15 15" ctrlrange="-1 1"/>'
          '<velocity joint="knee{i}" kv="2" gear="2"/>')

# Spheres and capsules on each other, bars over a pole that stands still, every number of directions.
HEAP = """
<mujoco><option timestep="0.004" integrator="{integrator}" cone="{cone}"/><worldbody>
<geom type="plane" size="0 0 1" friction=".5 .01 .001" solmix="3" contype="3" conaffinity="3"/>
<geom name="pole" type="capsule" fromto="-.1 .3 .3 .5 .4 .3" size=".05" condim="4"/>
<body pos="0 0 .15"><freejoint/><geom type="sphere" size=".1" condim="1" solref="-900 -40"/></body>
<body pos=".03 .02 .36"><freejoint/><geom type="sphere" size=".1" condim="4" solimp=".7 .95 .01 .4 2"/></body>
<body pos=".02 .3 .6"><freejoint/><geom name="bar" type="capsule" size=".06 .2" euler="80 20 0" condim="6" margin=".02"/></body>
<body pos=".3 .35 .9"><freejoint/><geom type="capsule" size=".05 .15" euler="40 70 0" solmix=".2" priority="0"/></body>
<body pos="-.5 0 .3" euler="20 30 0"><freejoint/><geom type="box" size=".1 .07 .2" contype="2" conaffinity="2"/></body>
</worldbody><contact><pair geom1="pole" geom2="bar" condim="4" friction=".9 .4 .02 .001 .001" solreffriction=".05 1"
 solimp=".8 .96 .02 .5 1"
 margin=".03" gap=".01"/></contact></mujoco>"""

# Boxes, capsules and spheres on a table that is a box and on each other. A cylinder is on the ground.
BLOCKS = """
<mujoco><option timestep="0.003" integrator="{integrator}" cone="{cone}"/><default><geom friction=".7 .01 .001"/></default><worldbody>
<geom type="plane" size="0 0 1" contype="3" conaffinity="3"/><geom type="box" size=".5 .4 .1" pos=".1 0 .1" euler="0 3 20" condim="4"/>
<body pos="0 0 .32" euler="0 2 10"><freejoint/><geom type="box" size=".15 .1 .08"/></body>
<body pos=".04 .02 .5" euler="5 0 40"><freejoint/><geom type="box" size=".1 .12 .07" condim="6" margin=".01"/></body>
<body pos=".3 .1 .4" euler="80 10 0"><freejoint/><geom type="capsule" size=".05 .12" margin=".004" gap=".002"/></body>
<body pos=".32 .06 .55" euler="85 15 5"><freejoint/><geom type="capsule" size=".04 .15"/></body>
<body pos="-.15 -.2 .3"><freejoint/><geom type="sphere" size=".08" condim="1"/></body>
<body pos="0 .05 .7" euler="70 0 30"><freejoint/><geom type="capsule" size=".04 .1"/>
  <body pos="0 0 .2"><joint axis="0 1 0"/><geom type="box" size=".05 .04 .08"/></body></body>
</worldbody></mujoco>"""

GYM = ("ant", "humanoid", "half_cheetah", "walker2d", "hopper", "humanoidstandup", "inverted_double_pendulum",
       "inverted_pendulum", "reacher")
OWN = ("joints", "dog", "heap", "blocks")
NAMES = (*OWN, *GYM)


def xml_of(name, cone="pyramidal", integrator="Euler"):
    given = dict(cone=cone, integrator=integrator)
    if name == "dog":
        legs = "".join(LEG.format(i=i, x=(-.2, .2)[i % 2], y=(-.14, .14)[i // 2]) for i in range(4))
        given.update(legs=legs, servos="".join(SERVOS.format(i=i) for i in range(4)))
    return {"joints": JOINTS, "dog": DOG, "heap": HEAP, "blocks": BLOCKS}[name].format(**given)


def model_of(name, cone="pyramidal", integrator="Euler"):
    """A model by name, its solver as accurate as it gets. Skips those that Gymnasium has where it is not installed."""
    if name in OWN:
        model = mujoco.MjModel.from_xml_string(xml_of(name, cone, integrator))
    else:
        gymnasium = pytest.importorskip("gymnasium", reason=f"{name} is NOT tested: pip install gymnasium")
        assets = pathlib.Path(gymnasium.__file__).parent / "envs" / "mujoco" / "assets"
        model = mujoco.MjModel.from_xml_path(str(assets / f"{name}.xml"))
    model.opt.cone = getattr(mujoco.mjtCone, f"mjCONE_{cone.upper()}")
    model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}")
    model.opt.iterations, model.opt.tolerance, model.opt.ls_tolerance = 500, 1e-15, 1e-6
    return model


def random_states(model, count, seed=0):
    """Data with coordinates, velocities and controls at random, touching or not."""
    rng = np.random.default_rng(seed)
    found = [mujoco.MjData(model) for _ in range(count)]
    for data in found:
        mujoco.mj_integratePos(model, data.qpos, rng.standard_normal(model.nv), 0.5)
        data.qvel[:] = rng.standard_normal(model.nv)
        data.ctrl[:] = rng.standard_normal(model.nu)
        data.qfrc_applied[:] = 0.1 * rng.standard_normal(model.nv)
        mujoco.mj_forward(model, data)
    return found


def fallen_states(model, count, seed=0):
    """Data after some time of random controls."""
    rng = np.random.default_rng(seed)
    found = [mujoco.MjData(model) for _ in range(count)]
    for i, data in enumerate(found):
        data.qvel[:] = 0.3 * rng.standard_normal(model.nv)
        for _ in range(60 + 20 * i):
            data.ctrl[:] = 0.8 * data.ctrl + 0.2 * rng.standard_normal(model.nu)
            mujoco.mj_step(model, data)
        mujoco.mj_forward(model, data)
    return found


def apart(found, expected):
    """Largest difference over the largest expected number."""
    found, expected = np.asarray(found, float), np.asarray(expected, float)
    return 0.0 if not expected.size else float(np.abs(found - expected).max() / max(np.abs(expected).max(), 1e-9))


def full_mass(model, data):
    M = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, M)
    return np.tril(M)


def jacobian(model, data):
    if not mujoco.mj_isSparse(model):
        return data.efc_J.reshape(data.nefc, model.nv)
    J = np.zeros((data.nefc, model.nv))
    mujoco.mju_sparse2dense(J, data.efc_J, data.efc_J_rownnz, data.efc_J_rowadr, data.efc_J_colind)
    return J


def compare_smooth(model, found, i, one):
    """Roundings of some hundred operations on numbers of unlike sizes: M 1e-14, solutions with it 1e-12."""
    errors = {"M": apart(found["M"][i], full_mass(model, one)) / 1e-13, "bias": apart(found["bias"][i], one.qfrc_bias) / 1e-12,
              "passive": apart(found["passive"][i], one.qfrc_passive) / 1e-12,
              "actuator": apart(found["actuator"][i], one.qfrc_actuator) / 1e-12,
              "qacc_smooth": apart(found["qacc_smooth"][i], one.qacc_smooth) / 1e-12}
    assert max(errors.values()) < 1, (i, errors)


def compare_contacts_and_rows(model, found, i, one):
    contacts = [contact for contact in one.contact if contact.efc_address >= 0]
    assert (found["contacts"][i], found["rows"][i]) == (len(contacts), one.nefc), i
    compare_contacts(found, i, contacts)
    compare_rows(model, found, i, one)


def compare_contacts(found, i, contacts):
    """Distances, points and normals, both in order of their geoms, and of places of points within a pair."""
    if not contacts:
        return
    count = len(contacts)
    mine = np.column_stack([np.sort(found["geoms"][i, :count], axis=1), found["contact"][i, :count]])
    theirs = np.array([[*sorted(one.geom), one.dist, *one.pos, *one.frame[:3]] for one in contacts])
    order = [np.lexsort(np.round(rows[:, [5, 4, 3, 1, 0]], 9).T) for rows in (mine, theirs)]
    assert np.abs(mine[order[0]] - theirs[order[1]]).max() < 1e-12


def compare_rows(model, found, i, one):
    """References and compliances sorted, and J' R^-1 J and J' aref, which no order reaches. Distances less margins lose
    digits, which compliances of stiff rows show: 1e-9."""
    count = one.nefc
    J, aref, R = found["J"][i, :count], found["aref"][i, :count], found["R"][i, :count]
    theirs = jacobian(model, one)
    errors = {"aref": apart(np.sort(aref), np.sort(one.efc_aref)) / 1e-10, "R": apart(np.sort(R), np.sort(one.efc_R)) / 1e-10,
              "J'R^-1J": apart(J.T @ (J / R[:, None]), theirs.T @ (theirs / one.efc_R[:, None])) / 1e-9,
              "J'R^-1aref": apart(J.T @ (aref / R), theirs.T @ (one.efc_aref / one.efc_R)) / 1e-9}
    assert not count or max(errors.values()) < 1, errors


COUNT = 21  # neither a multiple of the lanes nor less


def after_six_steps(lanes, name, cone, integrator, dtype):
    """Model, data, options, and the simulations that `lanes` has made of them, on one thread, after six steps."""
    model = model_of(name, cone, integrator)
    data = fallen_states(model, COUNT, seed=3)
    simulation = lanes(model, data, dtype=dtype, threads=1)
    simulation.step(nstep=6)
    assert (simulation.status["iterations"] > 0).any() and not simulation.failed.size
    return model, data, dict(dtype=dtype), simulation


def bits(simulation, chosen=slice(None)):
    return simulation.qpos[chosen].tobytes(), simulation.qvel[chosen].tobytes(), simulation.qacc[chosen].tobytes()


def compare_bodies(simulation, i, one, names, kinematics, forces):
    """Errors relative to an array's largest number, those of forces to at least 1."""
    for name in names:
        assert apart(simulation.observed[name][i], getattr(one, name)) < kinematics, (name, i)
    scale = max(np.abs(one.cfrc_ext).max(), 1.0)
    assert np.abs(simulation.observed["cfrc_ext"][i] - one.cfrc_ext).max() < forces * scale, i


def compare_step(simulation, i, one):
    assert apart(simulation.qpos[i], one.qpos) < 1e-8, i
    assert apart(simulation.qvel[i], one.qvel) < 1e-6, i


def step_beside(simulation, models, data, steps, within):
    """Makes steps in lanes and by mj_step, of one model or of each simulation's own, and compares states."""
    simulation.step(nstep=steps)
    assert not simulation.failed.size
    for i, one in enumerate(data):
        for _ in range(steps):
            mujoco.mj_step(models[i] if isinstance(models, list) else models, one)
        assert apart(simulation.qvel[i], one.qvel) < within, (i, simulation.qvel[i], one.qvel)
        assert apart(simulation.qpos[i], one.qpos) < within, i
