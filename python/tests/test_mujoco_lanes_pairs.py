"""engine="lanes": two shapes that touch, of every pair of kinds, beside MuJoCo; and boxes at rest."""

import numpy as np
import pytest
from lanes_models import apart, compare_contacts_and_rows, mujoco, step_beside
from lanes_pairs import PAIRS, encounters, model_of_pair, place_geom

import stiction.mujoco

COUNT = 90
# MuJoCo's second point of a capsule that is parallel to a box's edge hangs on the signs of zeros.
ALONG = [pair for pair in PAIRS if pair != ("capsule", "box")]


def lanes(model, data, **options):
    return stiction.mujoco.BatchedSimulation(model, data, engine="lanes", **options)


def name_of(pair):
    return "-".join(pair) if isinstance(pair, tuple) else None


def compare_all(model, data):
    found = lanes(model, data).probe()
    for i, one in enumerate(data):
        compare_contacts_and_rows(model, found, i, one)
    return found["contacts"]


@pytest.mark.parametrize("margin, gap", [(0.01, 0.0), (0.02, 0.03), (0.0, 0.0)])
@pytest.mark.parametrize("pair", PAIRS, ids=name_of)
def test_contacts_of_two_shapes_are_mujocos(pair, margin, gap):
    model = model_of_pair(*pair, margin, gap)
    counts = compare_all(model, encounters(model, COUNT, False, seed=1))
    assert (counts > 0).sum() > COUNT // 3 and counts.max() >= {"box": 5, "capsule": 1 + (pair[1] == "box"), "sphere": 1}[pair[0]]


@pytest.mark.parametrize("size", [".03 .5", ".1 .05"])
def test_contacts_of_a_box_with_longer_and_shorter_capsules_are_mujocos(size):
    """Longer ones leave the part that they are nearest to at its side, or at its end, before they end."""
    model = model_of_pair("capsule", "box", size_a=size)
    counts = compare_all(model, encounters(model, 3 * COUNT, False, seed=5))
    assert (counts == 2).sum() > 10


@pytest.mark.parametrize("pair", ALONG, ids=name_of)
def test_contacts_of_shapes_that_lie_along_each_other_are_mujocos(pair):
    model = model_of_pair(*pair)
    counts = compare_all(model, encounters(model, COUNT, True, seed=2))
    assert counts.max() == {"box": 4, "capsule": 2, "sphere": 1}[pair[0]]


@pytest.mark.parametrize("pair", PAIRS, ids=name_of)
def test_contacts_in_single_precision_are_near(pair):
    model = model_of_pair(*pair)
    data = encounters(model, COUNT, False, seed=3)
    narrow, wide = (lanes(model, data, dtype=dtype).probe() for dtype in ("float32", "float64"))
    same = narrow["contacts"] == wide["contacts"]
    assert same.mean() > 0.97, np.flatnonzero(~same)
    for i in np.flatnonzero(same):
        assert np.abs(narrow["contact"][i] - wide["contact"][i]).max() < 2e-4, i


@pytest.mark.parametrize("angle", [0.0, 0.9e-4, 1.1e-4, 0.3, np.pi])  # a ten thousandth is the bound
@pytest.mark.parametrize("offset", [0.0, 0.1, -0.25, 0.35])
def test_capsules_that_are_parallel_or_nearly_so_touch_twice(angle, offset):
    """Beside, past and over each other's ends; past them both points are one."""
    model = model_of_pair("capsule", "capsule")
    data = encounters(model, 2, False)
    for one, axis in zip(data, ([0, 1, 0], [1, 0, 0])):
        place_geom(model, one, 0, np.zeros(3), np.array([1.0, 0, 0, 0]))
        place_geom(model, one, 1, np.array([0.09, 0, offset]), np.array([np.cos(angle / 2), *np.sin(angle / 2) * np.array(axis)]))
        mujoco.mj_forward(model, one)
    # Just beyond the bound a point's place has eight digits, in MuJoCo too.
    counts = lanes(model, data).probe()["contacts"] if angle == 1.1e-4 else compare_all(model, data)
    assert [one.ncon for one in data] == counts.tolist() == [1 if 1e-4 < angle < 3 else 2] * 2


@pytest.mark.parametrize("angle", [0.0, 0.2, 0.8])
def test_a_capsule_that_lies_on_a_box_touches_as_in_mujoco(angle):
    """Flat on its face, about its normal turned, and over its edge."""
    model = model_of_pair("capsule", "box")
    data = encounters(model, 4, False)
    turn = np.array([np.sqrt(.5), np.sqrt(.5) * np.sin(angle), np.sqrt(.5) * np.cos(angle), 0])
    for one, at in zip(data, ([0, 0, .139], [.15, .02, .139], [.21, .01, .13], [.05, .12, .138])):
        place_geom(model, one, 0, np.array(at), turn)
        place_geom(model, one, 1, np.zeros(3), np.array([1.0, 0, 0, 0]))
        mujoco.mj_forward(model, one)
    assert compare_all(model, data).max() == 2


def test_boxes_rest_on_each_other_where_they_rest_in_mujoco():
    body = '<body pos="{x} {y} {z}" euler="{turn}"><freejoint/><geom type="box" size="{size}"/></body>'
    rest = [body.format(x=.02 * k, y=-.01 * k, z=.1 + .2 * k, turn=f"0 0 {15 * k}", size=f"{.2 - .03 * k} .15 .1") for k in range(3)]
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><worldbody><geom type="plane" size="0 0 1"/>{"".join(rest)}</worldbody></mujoco>')
    model.opt.tolerance, model.opt.iterations = 1e-12, 200
    simulation = lanes(model, 3, tolerance=1e-10)
    one = mujoco.MjData(model)
    simulation.step(nstep=500)
    mujoco.mj_step(model, one, 500)
    assert simulation.solved.all() and (simulation.qpos == simulation.qpos[0]).all()
    assert apart(simulation.qpos[0], one.qpos) < 1e-6
    assert np.abs(simulation.qvel).max() < 1e-4
    depths = simulation.probe()["contact"][0, :simulation.probe()["contacts"][0], 0]
    assert -1e-3 < depths.min() < 0


CYLINDER = """
<mujoco><option timestep="0.002"/><worldbody><geom type="plane" size="0 0 1" euler="6 -4 20" margin="{margin}" gap="{gap}"/>
<body><freejoint/><geom type="cylinder" size=".1 .07" pos=".02 0 .01" euler="0 10 0"/></body></worldbody></mujoco>"""


def cylinders(margin=0.004, gap=0.003, count=COUNT):
    """A model, and data with a cylinder that stands, lies, or leans at random, near a tilted plane."""
    model = mujoco.MjModel.from_xml_string(CYLINDER.format(margin=margin, gap=gap))
    rng, found = np.random.default_rng(7), [mujoco.MjData(model) for _ in range(count)]
    upright = model.geom_quat[0]
    for i, data in enumerate(found):
        turn, lean, orientation = np.empty(4), np.empty(4), rng.standard_normal(4)
        if i % 3 < 2:  # stands on either end, or lies
            mujoco.mju_axisAngle2Quat(lean, np.array([1.0, 0, 0]), [0, np.pi, np.pi / 2][i % 9 // 3] + (i % 2) * 1e-3)
            mujoco.mju_mulQuat(orientation, upright, lean)
        orientation /= np.linalg.norm(orientation)
        place, back, at = np.empty(3), np.empty(4), np.empty(3)
        mujoco.mju_negPose(place, back, model.geom_pos[1], model.geom_quat[1])
        mujoco.mju_mulPose(at, turn, np.array([.3, .1, rng.uniform(-.02, .14)]), orientation, place, back)
        data.qpos[:] = [*at, *turn]
        data.qvel[:] = 0.3 * rng.standard_normal(6)
        mujoco.mj_forward(model, data)
    return model, found


@pytest.mark.parametrize("margin, gap", [(0.004, 0.003), (0.0, 0.0)])
def test_contacts_of_cylinders_with_planes_are_mujocos(margin, gap):
    model, data = cylinders(margin, gap)
    counts = compare_all(model, data)
    assert set(counts.tolist()) == {0, 1, 2, 3, 4}


def test_a_cylinder_comes_to_rest_on_its_end_as_in_mujoco():
    model, data = cylinders(0.0, 0.0, 9)
    data = [data[i] for i in (0, 1, 3, 4)]  # those that stand
    simulation = lanes(model, data, tolerance=1e-10)
    step_beside(simulation, model, data, 1, 1e-9)
    simulation.step(nstep=2000)
    assert simulation.solved.all() and np.abs(simulation.qvel).max() < 0.01
