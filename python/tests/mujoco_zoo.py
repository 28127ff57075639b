"""A model with every kind of row, its controls, and a step beside MuJoCo's own; shared by tests of stiction.mujoco."""

import numpy as np
import pytest

mujoco = pytest.importorskip("mujoco", reason="stiction.mujoco is NOT tested: pip install mujoco")

# Every kind of row: equality, friction loss of a joint and of a tendon, limits of both, contacts of 1, 3, 4 and 6 rows.
ZOO = """
<mujoco>
  <option timestep="0.004" integrator="{integrator}" cone="{cone}" jacobian="{jacobian}" tolerance="0" iterations="100"/>
  <default><joint damping="0.2"/></default>
  <worldbody>
    <geom type="plane" size="5 5 1" friction="0.7 0.01 0.001"/>
    <body pos="0 0 0.1"><freejoint/><geom type="box" size=".1 .1 .1" condim="3"/></body>
    <body pos="0.05 0 0.3"><freejoint/><geom type="box" size=".1 .1 .1" condim="4" friction="0.5 0.02 0.001"/></body>
    <body pos="0.6 0 0.1"><freejoint/><geom type="sphere" size=".1" condim="6" friction="0.9 0.05 0.01"/></body>
    <body pos="-0.6 0 0.1"><freejoint/><geom type="sphere" size=".1" condim="1" priority="1"/></body>
    <body pos="0 1 0.5">
      <joint name="a" axis="0 1 0" range="5 10" limited="true" frictionloss="0.3"/>
      <geom type="capsule" fromto="0 0 0 .3 0 0" size=".04"/>
      <body pos=".3 0 0"><joint name="b" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 .3 0 0" size=".04"/></body>
    </body>
    <body pos="0 -1 0.5"><joint name="c" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 .3 0 0" size=".04"/></body>
    <body pos="1 1 1"><joint name="d" type="ball"/><geom type="capsule" fromto="0 0 0 .3 0 0" size=".04"/></body>
  </worldbody>
  <tendon><fixed name="t" frictionloss="0.2" range="-0.05 0.05" limited="true">
    <joint joint="b" coef="1"/><joint joint="c" coef="-0.5"/></fixed></tendon>
  <equality><joint joint1="b" joint2="c"/></equality>
  <actuator><motor joint="a" gear="3"/><motor joint="b" gear="2"/></actuator>
</mujoco>"""


def zoo(cone="elliptic", integrator="Euler", jacobian="dense"):
    return mujoco.MjModel.from_xml_string(ZOO.format(cone=cone, integrator=integrator, jacobian=jacobian))


def controls(model, step, seed=0):
    return np.random.default_rng([seed, step]).uniform(-1, 1, model.nu)


def disturb(simulation):
    """Small velocities, so that no bodies lie symmetrically: see step_side_by_side(). Within a step of RK4 contacts
    are found three more times, from states that the solver's last bits have led to."""
    data = simulation.data[0]
    data.qvel[:] = 1e-3 * np.random.default_rng(7).standard_normal(len(data.qvel))


def step_side_by_side(simulation, peer, ctrl):
    """One step of both from the simulation's state; how far apart their positions are then.

    A trajectory apart from each other's would be no test: where bodies lie symmetrically, MuJoCo's collision detection
    chooses contacts by roundings.
    """
    data = simulation.data[0]
    for field in ("qpos", "qvel", "act", "qacc_warmstart"):
        getattr(peer, field)[:] = getattr(data, field)
    peer.time, peer.ctrl[:] = data.time, ctrl
    simulation.step(ctrl[None])
    mujoco.mj_step(simulation.model, peer)
    return np.abs(data.qpos - peer.qpos).max()
