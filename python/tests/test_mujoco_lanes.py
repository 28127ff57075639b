"""engine="lanes" beside MuJoCo: the smooth dynamics, contacts, rows, and steps."""

import numpy as np
import pytest
from lanes_models import (
    NAMES,
    apart,
    compare_contacts_and_rows,
    compare_smooth,
    compare_step,
    fallen_states,
    model_of,
    mujoco,
    random_states,
    step_beside,
)

import stiction.mujoco

BatchedSimulation = stiction.mujoco.BatchedSimulation
CONES = ("pyramidal", "elliptic")


def lanes(model, data, **options):
    return BatchedSimulation(model, data, engine="lanes", **options)


@pytest.mark.parametrize("name", NAMES)
def test_smooth_dynamics_are_mujocos(name):
    model = model_of(name)
    data = random_states(model, 13)
    found = lanes(model, data).probe()
    for i, one in enumerate(data):
        compare_smooth(model, found, i, one)


@pytest.mark.parametrize("cone", CONES)
@pytest.mark.parametrize("name", NAMES)
def test_contacts_and_rows_are_mujocos(name, cone):
    model = model_of(name, cone)
    for data in (fallen_states(model, 11), random_states(model, 11, seed=1)):
        found = lanes(model, data).probe()
        for i, one in enumerate(data):
            compare_contacts_and_rows(model, found, i, one)


@pytest.mark.parametrize("integrator", ["Euler", "RK4", "implicitfast"])
@pytest.mark.parametrize("name", NAMES)
def test_a_step_is_mujocos(name, integrator):
    """With pyramids, whose problem MuJoCo's Newton solves to its last digits or to 1e-8."""
    model = model_of(name, "pyramidal", integrator)
    data = fallen_states(model, 9)
    simulation = lanes(model, data, tolerance=1e-10)
    simulation.step()
    assert simulation.solved.all(), simulation.status
    for i, one in enumerate(data):
        mujoco.mj_step(model, one)
        compare_step(simulation, i, one)


@pytest.mark.parametrize("cone", CONES)
@pytest.mark.parametrize("name", NAMES)
def test_accelerations_are_those_of_the_solver_by_rows(name, cone):
    """Newton's method on MuJoCo's own rows, as engine="mujoco" has them: one problem, solved twice to 1e-10."""
    model = model_of(name, cone)
    data = fallen_states(model, 9, seed=2)
    found = lanes(model, data, tolerance=1e-10).probe()
    peers = BatchedSimulation(model, data, tolerance=1e-10)
    peers.forward()
    for i, one in enumerate(data):
        assert apart(found["qacc"][i], one.qacc) < 1e-8, (name, i)


@pytest.mark.parametrize("integrator", ["Euler", "RK4"])
def test_trajectories_part_slowly_without_contact(integrator):
    model = model_of("joints", integrator=integrator)
    data = random_states(model, 5)
    for one in data:
        one.qvel[:] *= 0.3
    simulation = lanes(model, data)
    step_beside(simulation, model, data, 100, 1e-9)
    assert simulation.time == pytest.approx([one.time for one in data])


# Actuators that brake: two on one joint, gains by velocity, controls and forces beyond their ranges.
BRAKES = """
<mujoco><option timestep="0.01" integrator="implicitfast" gravity="0 0 -3">{flag}</option><worldbody>
<body><joint name="a" axis="0 1 0" damping=".2" armature=".05" actuatorfrcrange="-3 4"/><geom size=".05" pos=".3 0 0"/>
<body pos=".3 0 0"><joint name="b" axis="0 1 1"/><geom size=".05" pos=".2 0 .1"/>
<body pos=".2 0 .1"><joint name="c" type="slide" axis="1 0 .3"/><geom size=".04"/></body></body></body></worldbody><actuator>
<velocity joint="a" kv="3" gear="-1.5"/><position joint="a" kp="4" kv="1" forcerange="-1 1"/>
<general joint="b" gaintype="affine" biastype="affine" gainprm="1 .2 -.1" biasprm=".1 -2 -.3" ctrlrange="-.5 .5"/>
<general joint="c" gaintype="affine" gainprm="1 0 -.4" ctrlrange="-9 9"/></actuator></mujoco>"""


@pytest.mark.parametrize("flag", ["", '<flag eulerdamp="disable"/>', '<flag damper="disable"/>', '<flag actuation="disable"/>'])
@pytest.mark.parametrize("varies", [(), ("actuator_gainprm", "actuator_biasprm", "dof_damping")])
def test_implicitfast_brakes_as_mujoco_does(flag, varies):
    model = mujoco.MjModel.from_xml_string(BRAKES.format(flag=flag))
    if "damper" in flag:
        varies = varies[:2]
    data = random_states(model, 12, seed=3)
    for i, one in enumerate(data):
        one.ctrl[:] *= 1 + i % 4
    simulation = lanes(model, data, varies=varies)
    for name, array in simulation.varied.items() if varies else ():
        array[:] *= np.linspace(0.5, 1.5, 12).reshape((12,) + (1,) * (array.ndim - 1))
    models = [simulation.model_of(i) for i in range(12)] if varies else model
    step_beside(simulation, models, data, 5, 1e-11)


@pytest.mark.parametrize("inner", ["", '<body pos=".1 0 .2"><geom size=".05 .1 .03" type="box" euler="0 30 0"/></body>',
                                   '<body pos=".1 0 .2"><joint/><geom size=".05 .1 .03" type="box"/></body>'])
def test_implicitfast_turns_free_bodies_as_mujoco_does(inner):
    """Spins of some hundred rad/s, where the gyroscopic moment decides."""
    model = mujoco.MjModel.from_xml_string(f"""<mujoco><option timestep="0.01" integrator="implicitfast"/><default><geom contype="0"/></default><worldbody>
<body pos="0 0 1" euler="20 30 0"><freejoint/><geom type="box" size=".1 .02 .2" pos=".03 .1 0" euler="0 0 30"/>{inner}</body>
<body><joint/><geom size=".1"/></body></worldbody></mujoco>""")
    data = random_states(model, 9, seed=4)
    for one in data:
        one.qvel[3:6] *= 60
    step_beside(lanes(model, data), model, data, 3, 1e-11)


@pytest.mark.parametrize("framework", ["numpy", "torch"])
def test_arrays_are_shared_by_dlpack(framework):
    taker = pytest.importorskip(framework, reason="DLPack to PyTorch is NOT tested: scripts/test.sh --frameworks")
    simulation = lanes(model_of("dog"), 5, dtype="float32")
    qpos, ctrl = taker.from_dlpack(simulation.qpos), taker.from_dlpack(simulation.ctrl)
    if framework == "torch":
        ctrl[2] = 0.5
        assert (simulation.ctrl[2] == 0.5).all() and not simulation.ctrl[1].any()
    before = qpos.tolist()
    simulation.step(nstep=3)
    assert qpos.tolist() == simulation.qpos.tolist() != before


def test_a_brake_that_pushes_harder_than_inertia_is_a_numerical_failure():
    model = mujoco.MjModel.from_xml_string(BRAKES.format(flag=""))
    model.actuator_gainprm[3, 2] = 1e6
    simulation = lanes(model, 3)
    simulation.ctrl[1, 3] = 1
    simulation.step()
    assert list(simulation.failed) == [1] and simulation.status["code"][1] == stiction.CODES.index("numerical")
    assert np.isfinite(simulation.qvel).all()


@pytest.mark.parametrize("name", ["dog", "humanoid", "heap"])
@pytest.mark.parametrize("cone", CONES)
def test_single_precision_is_near_and_says_when_it_is_not(name, cone):
    """Sixteen lanes in place of eight. Compliances of stiff rows keep three digits."""
    model = model_of(name, cone)
    data = fallen_states(model, 21)
    narrow, wide = lanes(model, data, dtype="float32"), lanes(model, data)
    for simulation in (narrow, wide):
        simulation.step()
    near = [apart(narrow.qvel[i], wide.qvel[i]) < 2e-2 for i in range(21)]
    assert np.mean(narrow.solved) > 0.9 and np.mean(near) > 0.9, (narrow.status["code"], near)
    assert apart(narrow.qpos, wide.qpos) < 1e-3


def test_single_precision_is_as_close_as_the_page_says():
    """All models, 99 robots of 100. Roundings choose the normal of capsules whose axes cross."""
    errors = {"M": [], "bias": [], "qacc_smooth": [], "contact": [], "normal": [], "aref": [], "R": []}
    for name, cone in ((name, cone) for name in NAMES for cone in CONES):
        model = model_of(name, cone)
        for data in (random_states(model, 33, seed=1), fallen_states(model, 11, seed=2)):
            narrow, wide = lanes(model, data, dtype="float32").probe(), lanes(model, data).probe()
            assert (narrow["rows"] == wide["rows"]).all() and (narrow["contacts"] == wide["contacts"]).all(), name
            for i, (rows, contacts) in enumerate(zip(wide["rows"], wide["contacts"])):
                for key in ("M", "bias", "qacc_smooth"):
                    errors[key].append(apart(narrow[key][i], wide[key][i]))
                if contacts:
                    one, other = narrow["contact"][i, :contacts], wide["contact"][i, :contacts]
                    errors["contact"].append(apart(one[:, :4], other[:, :4]))
                    errors["normal"].append(np.abs(one[:, 4:] - other[:, 4:]).max())
                for key in ("aref", "R") if rows else ():
                    errors[key].append(apart(narrow[key][i, :rows], wide[key][i, :rows]))
    bounds = {"M": 3e-7, "bias": 3e-6, "qacc_smooth": 2e-5, "contact": 1e-6, "normal": 1e-4, "aref": 2e-4, "R": 2e-4}
    for key, bound in bounds.items():
        assert np.quantile(errors[key], 0.99) < bound, (key, np.quantile(errors[key], [0.5, 0.99, 1]))


def test_what_is_not_stepped_is_refused_with_its_reason():
    body = '<body name="b"><joint type="{joint}" {more}/><geom type="{geom}" size=".1 .1 .1"/></body>'
    cases = {
        "fluid": ('<option density="1"/>', dict(), ""),
        "not Euler, RK4 or implicitfast": ('<option integrator="implicit"/>', dict(), ""),
        "without damping and armature": ('<option integrator="implicitfast"/>', dict(joint="free", more='damping="1"'), ""),
        "ball joints are not stepped": ("", dict(joint="ball", more='limited="true" range="0 60"'), ""),
        "not both planes, height fields, spheres, capsules, cylinders, boxes or meshes": ("", dict(geom="ellipsoid"), ""),
        "equality 0, which is none of joints": ("", dict(more='name="j"'), '<equality><weld body1="b"/></equality>'),
        "activations": ("", dict(more='name="j"'), '<actuator><intvelocity joint="j" actrange="-1 1"/></actuator>'),
    }
    for reason, (option, how, more) in cases.items():
        inner = body.format(**{"joint": "hinge", "geom": "sphere", "more": "", **how})
        text = f'<mujoco>{option}<worldbody><geom type="plane" size="1 1 1"/>{inner}</worldbody>{more}</mujoco>'
        with pytest.raises((ValueError, stiction.Error), match=reason):
            lanes(mujoco.MjModel.from_xml_string(text), 1)
    with pytest.raises(ValueError, match="float16"):
        lanes(model_of("joints"), 1, dtype="float16")
    with pytest.raises(stiction.Error, match="single precision at least 1e-5"):
        lanes(model_of("joints"), 1, dtype="float32", tolerance=1e-7)
    with pytest.raises(ValueError, match="engine"):
        BatchedSimulation(model_of("joints"), 1, engine="threads")
