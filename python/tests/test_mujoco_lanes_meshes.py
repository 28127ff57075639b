"""engine="lanes": convex hulls of meshes on planes, beside MuJoCo."""

import numpy as np
import pytest
from lanes_models import compare_contacts_and_rows, mujoco, step_beside
from lanes_pairs import MESHES, assets

import stiction.mujoco

COUNT = 120


def lanes(model, data, **options):
    return stiction.mujoco.BatchedSimulation(model, data, engine="lanes", **options)


def meshes(shape, margin=0.004, gap=0.003, count=COUNT):
    """A model of that mesh and another one, and data with both near a tilted plane: at random, or flat but for 0.001."""
    model = mujoco.MjModel.from_xml_string(f"""
<mujoco><option timestep="0.002"/>{assets()}<worldbody>
<geom type="plane" size="0 0 1" euler="6 -4 20" margin="{margin}" gap="{gap}"/>
<body name="one"><freejoint/><geom type="mesh" mesh="{shape}" pos=".02 0 .01" euler="0 10 0"/></body>
<body name="other" pos="2 0 0"><freejoint/><geom type="mesh" mesh="stone"/></body>
</worldbody><contact><exclude body1="one" body2="other"/></contact></mujoco>""")
    rng, found = np.random.default_rng(7), [mujoco.MjData(model) for _ in range(count)]
    for i, data in enumerate(found):
        for body, geom in enumerate((1, 2)):
            orientation = rng.standard_normal(4)
            if i % 2:  # a face of the mesh down: its vertex frame upright, or turned over
                lean = np.empty(4)
                mujoco.mju_axisAngle2Quat(lean, np.array([1.0, 0, 0]), np.pi * (i // 2 % 2))
                mujoco.mju_mulQuat(orientation, model.geom_quat[0], lean)
                mujoco.mju_mulQuat(orientation, orientation.copy(), model.mesh_quat[model.geom_dataid[geom]])
                orientation = orientation + 1e-3 * rng.standard_normal(4)
            orientation /= np.linalg.norm(orientation)
            place, back, at, turn = np.empty(3), np.empty(4), np.empty(3), np.empty(4)
            mujoco.mju_negPose(place, back, model.geom_pos[geom], model.geom_quat[geom])
            mujoco.mju_mulPose(at, turn, np.array([.3 + 2 * body, .1, rng.uniform(-.04, .09)]), orientation, place, back)
            data.qpos[7 * body:7 * body + 7] = [*at, *turn]
        data.qvel[:] = 0.3 * rng.standard_normal(12)
        mujoco.mj_forward(model, data)
    return model, found


@pytest.mark.parametrize("margin, gap", [(0.004, 0.003), (0.0, 0.0), (0.2, 0.0)])
@pytest.mark.parametrize("shape", MESHES)
def test_contacts_of_hulls_with_planes_are_mujocos(shape, margin, gap):
    model, data = meshes(shape, margin, gap)
    found = lanes(model, data).probe()
    for i, one in enumerate(data):
        compare_contacts_and_rows(model, found, i, one)
    counts = found["contacts"]
    assert counts.max() >= (6 if shape == "stone" else 7) and (margin > .1 or len(set(counts.tolist())) >= 4)


@pytest.mark.parametrize("shape", MESHES)
def test_contacts_of_hulls_in_single_precision_are_near(shape):
    model, data = meshes(shape)
    narrow, wide = (lanes(model, data, dtype=dtype).probe() for dtype in ("float32", "float64"))
    same = narrow["contacts"] == wide["contacts"]
    assert same.mean() > 0.97, np.flatnonzero(~same)
    near = [np.abs(narrow["contact"][i] - wide["contact"][i]).max() < 2e-4 for i in np.flatnonzero(same)]
    assert np.mean(near) > 0.97  # others have vertices at one height but for rounding


@pytest.mark.parametrize("shape", MESHES)
def test_a_hull_steps_as_in_mujoco_and_comes_to_rest(shape):
    model, data = meshes(shape, 0.0, 0.0, 24)
    simulation = lanes(model, data, tolerance=1e-10)
    step_beside(simulation, model, data, 1, 1e-9)
    model.opt.gravity[:] = [1.0, .7, -9.7]  # along the plane's normal but for what friction holds
    resting = lanes(model, [data[i] for i in range(1, 24, 2)], tolerance=1e-8)
    resting.step(nstep=3000)
    assert resting.solved.all() and np.abs(resting.qvel).max() < 0.05
