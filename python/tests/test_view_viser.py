"""Recordings for viser are written, read back by their format, and compared with their subjects."""

import subprocess
import sys
import urllib.request

import numpy as np
import pytest
import worlds
from conftest import DATA, ROOT
from viser_files import Recording

import stiction
from stiction import view
from stiction.view.frame import islands, tangents
from stiction.view.shapes import capsule


def arrows(nodes, name):
    """Origins and vectors (n, 3) of arrows."""
    ends = nodes[name]["points"].reshape(-1, 2, 3)
    return ends[:, 0], ends[:, 1] - ends[:, 0]


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """A pile that was recorded, with its state at each step."""
    world, seen = worlds.started(envs=3), {}
    path = tmp_path_factory.mktemp("viser") / "pile.viser"
    with view.Recorder(path, envs=[0, 2]) as recorder:
        for step in range(1, 101):
            world.step()
            if step % 50 == 0:
                recorder.log(world, step=step)
                seen[step] = world.state(), world.contacts(), world.status
    return Recording(path), seen, recorder, world


def shown(recorded):
    """(recorded state, the world's state) of each step. A recording begins with its first step."""
    recording, seen, _, world = recorded
    first = min(seen)
    assert recording.duration == pytest.approx((max(seen) - first) * world.dt)
    for step, state in seen.items():
        yield recording.at((step - first) * world.dt), state


def test_bodies_are_where_the_world_has_them(recorded):
    world = recorded[3]
    for nodes, (state, _, _) in shown(recorded):
        for env in (0, 2):
            for body in range(len(world.bodies)):
                node = nodes[f"/world/env_{env}/bodies/body_{body}"]
                np.testing.assert_array_equal(node["position"], state.position[env, body])
                np.testing.assert_array_equal(node["wxyz"], state.orientation[env, body])
                assert node["visible"]
        assert not [name for name in nodes if name.startswith("/world/env_1")]


def test_arrows_are_forces_at_the_contacts_and_bodies_have_their_islands_colour(recorded):
    world, scale = recorded[3], recorded[2].force_scale
    for nodes, (_, contacts, _) in shown(recorded):
        for env in (0, 2):
            root, part = f"/world/env_{env}", slice(*contacts.offsets[env:env + 2])
            force = np.einsum("ni,nij->nj", contacts.impulse[part], tangents(contacts.normal[part])) / world.dt
            origins, vectors = arrows(nodes, f"{root}/forces")
            assert len(force) > 5 and len(force) == len(vectors)
            # Ends of arrows are float32, some 1 m from the origin.
            np.testing.assert_allclose(vectors, scale * force, atol=1e-6 + 1e-5 * np.abs(scale * force).max())
            points = nodes[f"{root}/contacts"]["points"].reshape(-1, 3)
            np.testing.assert_array_equal(points, origins)
            on_world = contacts.body_a[part] < 0
            np.testing.assert_allclose(points[on_world], contacts.arm_a[part][on_world], atol=1e-6)
            pairs = np.stack([contacts.body_a[part], contacts.body_b[part]], axis=1)
            label = islands(len(world.bodies), pairs)
            colours = {}
            for i, shape in enumerate(world.shapes):
                if shape.body >= 0:
                    node = nodes[f"{root}/bodies/body_{shape.body}/shape_{i}"]
                    colours.setdefault(label[shape.body], set()).add(tuple(node["color"]))
            assert all(len(of_island) == 1 for of_island in colours.values())
            assert len(set().union(*colours.values())) == len(colours)
            found = nodes[f"{root}/contacts"]["colors"].reshape(-1, 3)
            assert [{tuple(map(int, colour))} for colour in found] == [colours[k] for k in label[pairs.max(axis=1)]]


def test_labels_say_the_residual_of_each_environment_and_of_all(recorded):
    for nodes, (_, _, status) in shown(recorded):
        for env in (0, 2):
            said = nodes[f"/world/env_{env}/label"]["text"]
            assert said.startswith(f"env_{env}: residual {status['residual'][env]:.1e}, {status['iterations'][env]} iter")
        assert nodes["/world/all"]["text"] == (f"all: median residual {np.median(status['residual']):.1e}, "
                                               f"largest residual {status['residual'].max():.1e}")
        assert nodes["/world/log"]["text"] == ""


def test_shapes_have_the_sizes_of_the_description(recorded):
    recording, _, _, world = recorded
    nodes = recording.at(0)
    for i, shape in enumerate(world.shapes):
        node = nodes[f"/world/env_2/{'ground' if shape.body < 0 else f'bodies/body_{shape.body}'}/shape_{i}"]
        if shape.kind == "box":
            np.testing.assert_allclose(node["dimensions"], 2 * np.array(shape.size))
        elif shape.kind == "sphere":
            assert node["radius"] == shape.size[0]
        elif shape.kind == "capsule":
            reach = np.abs(node["vertices"].reshape(-1, 3)).max(axis=0)
            np.testing.assert_allclose(reach, [shape.size[0], shape.size[0], sum(shape.size)], rtol=0.02)
    # The floor is a grid, and the four walls are outlines.
    assert [nodes[f"/world/env_0/ground/shape_{i}"]["kind"] for i in range(5)] == ["GridMessage"] + 4 * [
        "LineSegmentsMessage"]


def test_a_capsule_has_its_volume_and_faces_outwards():
    radius, half = 0.3, 0.7
    vertices, triangles = capsule(radius, half)
    a, b, c = (vertices[triangles[:, k]].astype(float) for k in range(3))
    volume = np.einsum("ni,ni->", a, np.cross(b, c)) / 6  # by the divergence theorem; negative if it faced inwards
    expected = np.pi * radius**2 * (4 / 3 * radius + 2 * half)
    assert 0.95 * expected < volume < expected  # inscribed: 24 edges around lose 1.1 % of the area, rings the rest


def test_a_recorder_changes_no_bit_and_nan_is_left_out_and_said(tmp_path):
    alone, watched = worlds.started(envs=2), worlds.started(envs=2)
    wrench = np.zeros((2, 12, 6))
    wrench[1, 3, 0] = np.nan
    with view.Recorder(tmp_path / "a.viser") as recorder:
        for step in range(60):
            alone.step(wrench if step == 59 else None)
            watched.step(wrench if step == 59 else None)
            recorder.log(watched)
    assert alone.hash() == watched.hash()
    nodes = Recording(tmp_path / "a.viser").at(np.inf)
    assert nodes["/world/log"]["text"] == "env 1 ended as invalid_input: non_finite_input"
    assert "residual" in nodes["/world/env_0/label"]["text"]
    assert "residual" not in nodes["/world/env_1/label"]["text"]
    for node in nodes.values():
        assert all(np.isfinite(node[key]).all() for key in ("position", "wxyz", "points") if key in node)


def test_slip_is_that_of_a_block_that_slides(tmp_path):
    bodies, shapes, options = worlds.slide()
    world = stiction.World(bodies, shapes, 1, tolerance=1e-8, max_iterations=500, **options)
    twist = np.zeros((1, 2, 6))
    twist[0, :, 0] = 1.0
    world.reset(position=np.array([[[0, 0, 0.05], [0, 1, 0.05]]]), twist=twist)
    with view.Recorder(tmp_path / "slide.viser", slip_scale=0.5) as recorder:
        world.step(count=20)
        recorder.log(world)
    nodes = Recording(tmp_path / "slide.viser").at(0)
    contacts, speed = world.contacts(), world.state().twist[0, :, 0]
    np.testing.assert_allclose(arrows(nodes, "/world/env_0/slip")[1][:, 0] / 0.5, speed[contacts.body_b], rtol=1e-3,
                               atol=1e-5)
    # Forces of sliding contacts end on the rings of their cones: 24 segments, and 4 spokes.
    points, force = arrows(nodes, "/world/env_0/forces")
    cones = nodes["/world/env_0/cones"]["points"].reshape(len(force), 28, 2, 3)
    for point, arrow, cone, mu in zip(points, force, cones, contacts.mu):
        ring = cone[:24].reshape(-1, 3)
        np.testing.assert_allclose(ring[:, 2], point[2] + arrow[2], atol=1e-6)
        radius = np.linalg.norm(ring[:, :2] - point[:2], axis=1)
        np.testing.assert_allclose(radius, mu * arrow[2], rtol=1e-3)
        assert np.linalg.norm(arrow[:2]) == pytest.approx(mu * arrow[2], rel=1e-2)


def test_both_backends_draw_the_same_entities(tmp_path):
    pytest.importorskip("rerun.chunk", reason="viser is not compared with Rerun: pip install rerun-sdk")
    from test_view import Recording as RerunRecording
    for name in ("a.rrd", "a.viser"):
        world = worlds.started(envs=2)
        world.step(count=60)
        with view.Recorder(tmp_path / name) as recorder:
            recorder.log(world)
    theirs = {path for path in RerunRecording(tmp_path / "a.rrd").paths if path.startswith("/world/env")}
    ours = {name for name in Recording(tmp_path / "a.viser").at(0) if name.startswith("/world/env")}
    assert ours - theirs == {"/world/env_0/label", "/world/env_1/label"} and not theirs - ours


def test_a_batch_is_recorded_as_a_page_with_its_reactions_and_couplings(tmp_path, capsys):
    assert view.main([str(DATA / "pile.h5"), "--backend", "viser", "-o", str(tmp_path / "batch.html")]) == 0
    batch = stiction.Batch.from_file(DATA / "pile.h5")
    assert capsys.readouterr().out.endswith(f" solved: {tmp_path / 'batch.html'}\n")
    solution = stiction.Solver(solver="auto", tolerance=1e-6).solve(batch)
    recording = Recording(tmp_path / "batch.html")
    starts, ends = batch.cone_row_offsets[:-1], batch.cone_row_offsets[1:]
    for env in range(len(batch)):
        nodes, cones = recording.at(0.5 * env), slice(*batch.env_cone_offsets[env:env + 2])
        own = np.zeros((cones.stop - cones.start, 3))
        for k, (start, end) in enumerate(zip(starts[cones], ends[cones])):
            own[k, :end - start] = solution.lambda_[start:end][:3]  # not the torsional one
        largest = np.abs(solution.lambda_[batch.rows_of(env)]).max(initial=0.0) or 1.0
        vectors = arrows(nodes, "/batch/simulation_0/forces")[1]
        np.testing.assert_allclose(vectors[:, [2, 0, 1]], own / largest, atol=2e-6)
        coupled = set()
        cone_of = np.repeat(np.arange(len(own)), (ends - starts)[cones])
        rows = batch.rows_of(env)
        for row in range(rows.start, rows.stop):
            for slot in range(*batch.row_offsets[row:row + 2]):
                pair = cone_of[row - rows.start], cone_of[batch.column[slot]]
                if batch.A[slot] != 0 and pair[0] < pair[1]:
                    coupled.add(pair)
        points = nodes["/batch/simulation_0/contacts"]["points"].reshape(-1, 3)
        lines = nodes["/batch/simulation_0/couplings"]["points"].reshape(-1, 2, 3)
        expected = {(tuple(points[a]), tuple(points[b])) for a, b in coupled}
        assert {(tuple(a), tuple(b)) for a, b in lines} == expected and len(lines) == len(coupled)
    assert len(own) > 5 and coupled


def test_the_example_makes_a_page(tmp_path):
    out = tmp_path / "example.html"
    program = [sys.executable, str(ROOT / "examples" / "python" / "11_view.py"), "--envs", "3", "--drawn", "1", "--steps",
               "5", "-o", str(out)]
    done = subprocess.run(program, capture_output=True, text=True)
    assert done.returncode == 0 and not done.stderr, done.stderr
    assert done.stdout.startswith("5 steps of 3 environments, 1 drawn; hash ") and done.stdout.endswith(f"look: {out}\n")
    assert Recording(out).duration == pytest.approx(4 * 0.005)  # steps of 5 ms, from the first to the last


def test_a_page_is_served_and_the_slider_goes_back(monkeypatch):
    world, seen = worlds.started(envs=1), []
    with view.Recorder(backend="viser", port=0) as recorder:
        for _ in range(3):
            world.step()
            seen.append(world.state().position[0, 0].copy())
            recorder.log(world)
        writer = recorder._writer
        monkeypatch.setattr(writer._timeline, "run", lambda: None)
        recorder.wait()
        page = urllib.request.urlopen(f"http://127.0.0.1:{writer._server.get_port()}", timeout=10).read()
        assert b"<html" in page.lower()
        body = writer._handles["/world/env_0/bodies/body_0"]
        np.testing.assert_array_equal(body.position, seen[2])
        slider = writer._timeline._slider
        assert (slider.value, slider.max) == (2, 2)
        slider.value = 0
        np.testing.assert_array_equal(body.position, seen[0])
        assert writer._timeline._title.content.startswith("step 1, ")
        writer._timeline._play.value = True
        assert writer._timeline._advance() > 0
        np.testing.assert_array_equal(body.position, seen[1])
        # Frames recorded while an older one is seen do not move it.
        world.step()
        recorder.log(world)
        recorder.wait()
        np.testing.assert_array_equal(body.position, seen[1])
        assert slider.max == 3 and len(writer._timeline._plot.data[0]) == 4


@pytest.mark.parametrize("arguments, message", [
    ({"path": "a.rrd", "backend": "viser"}, "path: expected a name that ends in .html or .viser, got 'a.rrd'"),
    ({"backend": "paper"}, "backend: expected 'rerun' or 'viser', got 'paper'"),
    ({"backend": "viser", "connect": "x:1"}, "connect: expected None with backend 'viser', got 'x:1'")])
def test_what_it_cannot_write_is_refused_by_name(arguments, message):
    with pytest.raises(ValueError, match=message):
        view.Recorder(**arguments)


def test_shapes_of_mujoco_are_those_of_the_model(tmp_path):
    mujoco = pytest.importorskip("mujoco", reason="recordings of simulations are NOT tested: pip install mujoco")
    from stiction.mujoco import BatchedSimulation
    model = mujoco.MjModel.from_xml_string("""
<mujoco><asset><mesh name="wedge" vertex="0 0 0  .2 0 0  0 .2 0  0 0 .2"/></asset><worldbody>
  <geom type="plane" size="5 5 1"/>
  <body name="can/1" pos="2 0 .1"><freejoint/><geom type="cylinder" size=".05 .1"/></body>
  <body pos="3 0 .2" euler="30 0 20"><freejoint/><geom type="ellipsoid" size=".05 .06 .1"/></body>
  <body pos="4 0 .2"><freejoint/><geom type="mesh" mesh="wedge"/></body></worldbody></mujoco>""")
    simulation = BatchedSimulation(model, 1)
    simulation.step(nstep=5)
    with view.Recorder(tmp_path / "m.viser") as recorder:
        recorder.log(simulation)
    nodes, data = Recording(tmp_path / "m.viser").at(0), simulation.data[0]
    for i, name in enumerate(("can_1", "body_2", "body_3"), 1):  # a slash would name a node below
        np.testing.assert_array_equal(nodes[f"/world/env_0/bodies/{name}"]["position"], data.xpos[i])
        turn = nodes[f"/world/env_0/bodies/{name}"].get("wxyz", [1, 0, 0, 0])  # viser leaves this one out
        np.testing.assert_allclose(turn, data.xquat[i], atol=1e-8)
    can, egg, wedge = (nodes[f"/world/env_0/bodies/{name}"] for name in ("can_1/geom_1", "body_2/geom_2", "body_3/geom_3"))
    assert (can["radius"], can["height"]) == (0.05, 0.2) and egg["scale"] == [0.05, 0.06, 0.1]
    corners = wedge["vertices"].reshape(-1, 3)
    edges = np.sort([np.linalg.norm(corners[a] - corners[b]) for a in range(4) for b in range(a)])
    np.testing.assert_allclose(edges, [0.2] * 3 + [0.2 * np.sqrt(2)] * 3, rtol=1e-6)
    assert data.ncon > 0
    data.xpos[1], data.qvel[:] = np.nan, np.nan
    with view.Recorder(tmp_path / "nan.viser") as recorder:
        recorder.log(simulation)
    nodes = Recording(tmp_path / "nan.viser").at(0)
    assert nodes["/world/env_0/contacts"]["points"].size == 0 and nodes["/world/env_0/bodies/can_1"]["visible"] is False
