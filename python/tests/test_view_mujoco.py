"""Recordings of MuJoCo simulations hold MuJoCo's own numbers: places of geoms, forces and slip of contacts."""

import numpy as np
import pytest

mujoco = pytest.importorskip("mujoco", reason="recordings of simulations are NOT tested: pip install mujoco")
pytest.importorskip("rerun", reason="stiction.view is NOT tested: pip install rerun-sdk")

from test_view import Recording, verified  # noqa: E402

from stiction import view  # noqa: E402
from stiction.mujoco import BatchedSimulation  # noqa: E402

SCENE = """
<mujoco><option cone="elliptic" timestep="0.002"/>
  <asset><mesh name="wedge" vertex="0 0 0  .2 0 0  0 .2 0  0 0 .2"/></asset>
  <worldbody>
    <geom name="floor" type="plane" size="5 5 1" friction=".2"/>
    <body name="cube" pos="0 0 .05"><freejoint/><geom name="side" type="box" size=".05 .05 .05" friction=".2"/></body>
    <body name="forces" pos="1 0 .1"><freejoint/><geom type="capsule" size=".05 .1" euler="0 90 0"/></body>
    <body pos="2 0 .1"><freejoint/><geom type="cylinder" size=".05 .1"/></body>
    <body pos="3 0 .2"><freejoint/><geom type="ellipsoid" size=".05 .06 .1"/></body>
    <body pos="4 0 .2"><freejoint/><geom type="mesh" mesh="wedge"/><geom type="sphere" size=".02" group="3"/></body>
  </worldbody>
</mujoco>
"""


@pytest.fixture
def model():
    return mujoco.MjModel.from_xml_string(SCENE)


def stepped(model, steps, count=2):
    simulation = BatchedSimulation(model, count, tolerance=1e-10)
    for data in simulation.data:
        data.qvel[0] = 2.0
    simulation.step(nstep=steps)
    return simulation


def test_bodies_contacts_and_forces_are_mujocos(model, tmp_path):
    simulation = stepped(model, 60)
    with view.Recorder(tmp_path / "m.rrd", slip_scale=1.0) as recorder:
        recorder.log(simulation)
    recording = Recording(verified(tmp_path / "m.rrd"))
    data = simulation.data[1]
    for i, name in enumerate(("cube", "forces", "body_3", "body_4", "body_5"), 1):
        path = f"/world/env_1/bodies/{name}"
        np.testing.assert_array_equal(recording.at(path, "Transform3D:translation", 1)[0],
                                      data.xpos[i].astype(np.float32))
        np.testing.assert_array_equal(recording.at(path, "Transform3D:quaternion", 1)[0],
                                      data.xquat[i][[1, 2, 3, 0]].astype(np.float32))
    assert data.ncon >= 5
    points = recording.at("/world/env_1/contacts", "Points3D:positions", 1)
    np.testing.assert_allclose(points, data.contact.pos, atol=1e-7)
    arrows = recording.at("/world/env_1/forces", "Arrows3D:vectors", 1) / recorder.force_scale
    expected = np.zeros((data.ncon, 3))
    for i in range(data.ncon):
        force = np.zeros(6)
        mujoco.mj_contactForce(model, data, i, force)
        expected[i] = force[:3] @ data.contact[i].frame.reshape(3, 3)
    np.testing.assert_allclose(arrows, expected, rtol=1e-5, atol=1e-4)
    assert recording.series("/residual/env_1")[1] == simulation.status["residual"][1]


def test_forces_of_a_body_are_those_that_mujoco_moves_it_by(model, tmp_path):
    """The cube's contacts with the floor: their arrows add up to its constraint force. It slides and hops."""
    simulation = stepped(model, 20)
    data, side = simulation.data[0], model.geom("side").id
    for _ in range(200):
        cube = [i for i in range(data.ncon) if side in data.contact[i].geom]
        if cube and np.abs(data.qfrc_constraint[:2]).max() > 0.1:
            break
        simulation.step()
    assert cube and all(data.contact[i].geom[0] == 0 for i in cube)  # the force is on the second, the cube
    with view.Recorder(tmp_path / "m.rrd", slip_scale=1.0) as recorder:
        recorder.log(simulation)
    recording = Recording(tmp_path / "m.rrd")
    arrows = recording.at("/world/env_0/forces", "Arrows3D:vectors", 1) / recorder.force_scale
    np.testing.assert_allclose(arrows[cube].sum(axis=0), data.qfrc_constraint[:3], rtol=1e-4, atol=1e-4)
    slip = recording.at("/world/env_0/slip", "Arrows3D:vectors", 1)[cube]
    spin = data.xmat[1].reshape(3, 3) @ data.qvel[3:6]
    expected = data.qvel[:3] + np.cross(spin, data.contact.pos[cube] - data.xpos[1])
    assert np.abs(expected).max() > 0.5
    np.testing.assert_allclose(slip, expected * [1, 1, 0], atol=1e-6)


def test_shapes_are_those_of_the_model(model, tmp_path):
    with view.Recorder(tmp_path / "m.rrd", envs=1) as recorder:
        recorder.log(stepped(model, 1))
    recording = Recording(verified(tmp_path / "m.rrd"))
    root = "/world/env_0/bodies"
    assert recording.at(f"{root}/cube/side", "Boxes3D:half_sizes", None).tolist() == [pytest.approx([0.05] * 3)]
    assert recording.at(f"{root}/forces/geom_2", "Capsules3D:lengths", None).tolist() == [pytest.approx(0.2)]
    end = recording.at(f"{root}/forces/geom_2", "Capsules3D:translations", None)[0]
    np.testing.assert_allclose(end, [-0.1, 0, 0], atol=1e-6)  # turned about y, it begins 0.1 behind the centre
    assert recording.at(f"{root}/body_3/geom_3", "Cylinders3D:lengths", None).tolist() == [pytest.approx(0.2)]
    assert recording.at(f"{root}/body_4/geom_4", "Ellipsoids3D:half_sizes", None)[0][2] == pytest.approx(0.1)
    assert len(recording.at(f"{root}/body_5/geom_5", "Mesh3D:vertex_positions", None)) == 4
    assert f"{root}/body_5/geom_6" not in recording.paths  # of a group that MuJoCo's viewer hides


def test_simulations_are_recorded_before_their_first_step(model, tmp_path):
    simulation = BatchedSimulation(model, 3)
    for env, data in enumerate(simulation.data):
        data.qpos[14] += env  # the cylinder's x
    with view.Recorder(tmp_path / "m.rrd") as recorder:
        recorder.log(simulation)
    recording = Recording(verified(tmp_path / "m.rrd"))
    for env in (1, 2):  # of the first one MuJoCo has computed places
        assert recording.at(f"/world/env_{env}/bodies/body_3", "Transform3D:translation", 1)[0].tolist() == [
            2 + env, 0, np.float32(0.1)]
    assert not simulation.data[2].xpos.any(), "a recorder reads, and computes nothing in mjData"


def test_nan_in_a_simulation_is_left_out(model, tmp_path):
    simulation = stepped(model, 20)
    simulation.data[1].xpos[1] = np.nan
    simulation.data[1].qvel[:] = np.nan
    with view.Recorder(tmp_path / "m.rrd") as recorder:
        recorder.log(simulation)
    recording = Recording(verified(tmp_path / "m.rrd"))
    assert "/world/env_1/bodies/cube" not in recording.paths
    assert recording.at("/world/env_1/contacts", "Points3D:positions", 1).size == 0
    assert recording.at("/world/env_0/contacts", "Points3D:positions", 1).size > 0


def test_mujocos_own_solver_has_no_residuals(model, tmp_path):
    simulation = BatchedSimulation(model, 1, solver="mujoco")
    simulation.step()
    with view.Recorder(tmp_path / "m.rrd") as recorder:
        recorder.log(simulation)
    verified(tmp_path / "m.rrd")


def test_a_model_without_bodies(tmp_path):
    simulation = BatchedSimulation(mujoco.MjModel.from_xml_string("<mujoco/>"), 1)
    with view.Recorder(tmp_path / "m.rrd") as recorder:
        recorder.log(simulation)
        simulation.step()
        recorder.log(simulation)
    verified(tmp_path / "m.rrd")
