"""Recordings for Rerun are written, read back and compared with their subjects."""

import pathlib
import subprocess
import sys

import numpy as np
import pytest
import worlds
from conftest import DATA, ROOT

import stiction

pytest.importorskip("rerun", reason="stiction.view is NOT tested: pip install rerun-sdk")
chunk = pytest.importorskip("rerun.chunk", reason="stiction.view is NOT tested: it needs rerun-sdk 0.41 or later")
from stiction import view  # noqa: E402
from stiction.view.frame import Contacts, cone_lines, islands, tangents  # noqa: E402


class Recording:
    """Columns of a file: {path: {component: [(step, values)]}}; the step of static ones is None."""

    def __init__(self, path, timeline="step"):
        self.paths = {}
        for piece in chunk.RrdReader(str(path)).stream():
            table = piece.to_record_batch()
            steps = table.column(timeline).to_pylist() if timeline in table.schema.names else [None] * table.num_rows
            for name in set(table.schema.names) - {timeline, "time", "log_time", "log_tick"}:
                rows = zip(steps, table.column(name).to_pylist())
                self.paths.setdefault(str(piece.entity_path), {}).setdefault(name, []).extend(
                    (step, row) for step, row in rows if row is not None)

    def at(self, path, component, step):
        """The value of a component at a step, or the static one."""
        if path not in self.paths:
            raise AssertionError(f"nothing is recorded at {path}, but at {sorted(self.paths)}")
        found = [row for when, row in self.paths[path][component] if when in (step, None)]
        assert len(found) == 1, (path, component, step, len(found))
        return [np.array(row) for row in found[0]] if "strips" in component else np.array(found[0])

    def series(self, path):
        """A time series as {step: value}."""
        return {step: float(row[0]) for step, row in self.paths[path]["Scalars:scalars"]}


def verified(path):
    """The command line of Rerun takes the file."""
    done = subprocess.run([sys.executable, "-m", "rerun", "rrd", "verify", str(path)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return path


@pytest.fixture
def recorded(tmp_path):
    """A pile that was recorded, with its state at each step."""
    world, seen = worlds.started(envs=3), {}
    path = tmp_path / "pile.rrd"
    with view.Recorder(path, envs=[0, 2]) as recorder:
        for step in range(1, 101):
            world.step()
            if step % 50 == 0:
                recorder.log(world, step=step)
                seen[step] = world.state(), world.contacts(), world.status
    return Recording(verified(path)), seen, recorder, world


def test_bodies_are_where_the_world_has_them(recorded):
    recording, seen, _, world = recorded
    for step, (state, _, _) in seen.items():
        for env in (0, 2):
            for body in range(len(world.bodies)):
                path = f"/world/env_{env}/bodies/body_{body}"
                np.testing.assert_array_equal(recording.at(path, "Transform3D:translation", step)[0],
                                              state.position[env, body].astype(np.float32))
                w, x, y, z = state.orientation[env, body].astype(np.float32)
                np.testing.assert_array_equal(recording.at(path, "Transform3D:quaternion", step)[0], [x, y, z, w])
    assert not [path for path in recording.paths if path.startswith("/world/env_1")]


def test_shapes_have_the_sizes_of_the_description(recorded):
    recording, _, _, world = recorded
    for i, shape in enumerate(world.shapes):
        part = "ground" if shape.body < 0 else f"bodies/body_{shape.body}"
        path = f"/world/env_2/{part}/shape_{i}"
        if shape.kind == "sphere":
            found, expected = recording.at(path, "Ellipsoids3D:half_sizes", None)[0], [shape.size[0]] * 3
        elif shape.kind == "box":
            found, expected = recording.at(path, "Boxes3D:half_sizes", None)[0], shape.size
        elif shape.kind == "capsule":
            found = [recording.at(path, f"Capsules3D:{name}", None)[0] for name in ("radii", "lengths")]
            expected = [shape.size[0], 2 * shape.size[1]]
            np.testing.assert_allclose(recording.at(path, "Capsules3D:translations", None)[0], [0, 0, -shape.size[1]],
                                       atol=1e-7)
        else:
            continue
        np.testing.assert_allclose(found, expected, rtol=1e-6)


def test_forces_at_the_contacts_move_the_bodies_as_the_world_did(recorded):
    """Arrows are forces, not only numbers: with gravity they change the momentum as it changed."""
    recording, seen, recorder, world = recorded
    for step, (_, contacts, _) in seen.items():
        assert len(contacts) > 20
        for env in (0, 2):
            part = slice(*contacts.offsets[env:env + 2])
            arrows = recording.at(f"/world/env_{env}/forces", "Arrows3D:vectors", step) / recorder.force_scale
            frames = tangents(contacts.normal[part])
            force = np.einsum("ni,nij->nj", contacts.impulse[part], frames) / world.dt
            np.testing.assert_allclose(arrows, force, rtol=1e-5, atol=1e-5 * np.abs(force).max())
            points = recording.at(f"/world/env_{env}/contacts", "Points3D:positions", step)
            np.testing.assert_array_equal(points, recording.at(f"/world/env_{env}/forces", "Arrows3D:origins", step))
            np.testing.assert_allclose(recording.at(f"/world/env_{env}/contacts", "normal_force", step),
                                       contacts.impulse[part, 0] / world.dt, rtol=1e-12)
            pairs = np.stack([contacts.body_a[part], contacts.body_b[part]], axis=1)
            np.testing.assert_array_equal(recording.at(f"/world/env_{env}/contacts", "island", step),
                                          islands(len(world.bodies), pairs)[pairs.max(axis=1)])


def test_forces_and_gravity_are_what_the_momentum_changes_by(tmp_path):
    world = worlds.started(envs=1, tolerance=0, max_iterations=50)
    world.step(count=99)
    before = world.motion()["momentum"][0]
    with view.Recorder(tmp_path / "one.rrd") as recorder:
        world.step()
        recorder.log(world)
    recording = Recording(tmp_path / "one.rrd")
    arrows = recording.at("/world/env_0/forces", "Arrows3D:vectors", 1) / recorder.force_scale
    contacts = world.contacts()
    on_bodies = (contacts.body_b >= 0).astype(float) - (contacts.body_a >= 0)  # + on b, - on a
    change = (on_bodies @ arrows + sum(body.mass for body in world.bodies) * np.array(world.gravity)) * world.dt
    np.testing.assert_allclose(world.motion()["momentum"][0] - before, change, atol=1e-4)


def test_contact_points_are_on_both_bodies(recorded):
    """From the arms of either body the same point follows, on the world's surface where that is one of them."""
    recording, seen, _, world = recorded
    for step, (state, contacts, _) in seen.items():
        part = slice(*contacts.offsets[0:2])
        points = recording.at("/world/env_0/contacts", "Points3D:positions", step)
        began = state.position[0] - world.dt * state.twist[0, :, :3]
        for body, arm in ((contacts.body_a, contacts.arm_a), (contacts.body_b, contacts.arm_b)):
            own = body[part] >= 0
            assert own.any()
            np.testing.assert_allclose(points[own], began[body[part][own]] + arm[part][own], atol=1e-6)
        np.testing.assert_allclose(points[contacts.body_a[part] < 0], contacts.arm_a[part][contacts.body_a[part] < 0],
                                   atol=1e-6)


def test_residuals_of_environments_are_time_series(recorded):
    recording, seen, _, _ = recorded
    for step, (_, _, status) in seen.items():
        for env in (0, 2):
            assert recording.series(f"/residual/env_{env}")[step] == status["residual"][env]
            assert recording.series(f"/iterations/env_{env}")[step] == status["iterations"][env]
        assert recording.series("/residual/largest")[step] == status["residual"].max()
        assert recording.series("/residual/median")[step] == np.median(status["residual"])
        assert recording.series("/log10_residual/largest")[step] == np.log10(status["residual"].max())


def test_a_recorder_changes_no_bit(tmp_path):
    alone, watched = worlds.started(envs=2), worlds.started(envs=2)
    with view.Recorder(tmp_path / "a.rrd") as recorder:
        for _ in range(30):
            alone.step()
            watched.step()
            recorder.log(watched)
    assert alone.hash() == watched.hash()


def test_slip_is_that_of_a_block_that_slides(tmp_path):
    bodies, shapes, options = worlds.slide()
    world = stiction.World(bodies, shapes, 1, tolerance=1e-8, max_iterations=500, **options)
    twist = np.zeros((1, 2, 6))
    twist[0, :, 0] = 1.0
    world.reset(position=np.array([[[0, 0, 0.05], [0, 1, 0.05]]]), twist=twist)
    with view.Recorder(tmp_path / "slide.rrd", slip_scale=0.5) as recorder:
        for _ in range(20):
            world.step()
            recorder.log(world)
    recording = Recording(tmp_path / "slide.rrd")
    contacts, speed = world.contacts(), world.state().twist[0, :, 0]
    slip = recording.at("/world/env_0/slip", "Arrows3D:vectors", 20) / 0.5
    np.testing.assert_allclose(slip[:, 0], speed[contacts.body_b], rtol=1e-3, atol=1e-5)
    assert recording.series("/slip/env_0")[20] == pytest.approx(speed.max(), rel=1e-3)
    # Forces of sliding contacts end on the rings of their cones.
    force = recording.at("/world/env_0/forces", "Arrows3D:vectors", 20)
    rings = [np.array(strip) for strip in recording.at("/world/env_0/cones", "LineStrips3D:strips", 20)][::5]
    points = recording.at("/world/env_0/contacts", "Points3D:positions", 20)
    assert len(rings) == len(force) == len(points)
    for point, arrow, ring, mu in zip(points, force, rings, contacts.mu):
        np.testing.assert_allclose(ring[:, 2], point[2] + arrow[2], atol=1e-6)
        radius = np.linalg.norm(ring[:, :2] - point[:2], axis=1)
        np.testing.assert_allclose(radius, mu * arrow[2], rtol=1e-4)
        assert np.linalg.norm(arrow[:2]) == pytest.approx(mu * arrow[2], rel=1e-3)


def test_islands_are_what_contacts_join():
    assert islands(6, [[0, 1], [1, 4], [-1, 2]]).tolist() == [0, 0, 2, -1, 0, -1]
    chain = np.stack([np.arange(1, 100), np.arange(0, 99)], axis=1)[::-1]
    assert (islands(101, chain) == np.r_[np.zeros(100), -1]).all()
    assert islands(0, []).tolist() == [] and islands(2, [], touched=[1]).tolist() == [-1, 1]


def test_bodies_of_one_island_have_one_colour(tmp_path):
    boxes = [stiction.Shape("box", (0.1, 0.1, 0.1), body=k) for k in range(3)]
    places = [(0, 0, 0.1), (0, 0, 0.3), (2, 0, 0.1)]
    bodies = [stiction.Body.solid(box, 1000.0, position=place) for box, place in zip(boxes, places)]
    flying = stiction.Shape("sphere", 0.1, body=3)
    bodies.append(stiction.Body.solid(flying, 1000.0, position=(0, 5, 5)))
    world = stiction.World(bodies, [stiction.Shape("plane"), *boxes, flying], 1)
    world.step()
    with view.Recorder(tmp_path / "islands.rrd") as recorder:
        recorder.log(world)
    recording = Recording(tmp_path / "islands.rrd")
    seen = [int(recording.at(f"/world/env_0/bodies/body_{k}/shape_{k + 1}",
                             f"{'Boxes3D' if k < 3 else 'Ellipsoids3D'}:colors", 1)[0]) for k in range(4)]
    assert seen[0] == seen[1] != seen[2] and seen[3] == 0x969696FF


def test_nan_is_left_out_and_said(tmp_path):
    world = worlds.started(envs=3)
    world.step(count=60)
    wrench = np.zeros((3, 12, 6))
    wrench[1, 3, 0] = np.nan
    world.step(wrench)
    with view.Recorder(tmp_path / "nan.rrd") as recorder:
        recorder.log(world)
    recording = Recording(verified(tmp_path / "nan.rrd"))
    assert "/residual/env_1" not in recording.paths and not np.isfinite(world.status["residual"][1])
    said = [str(row[0]) for _, row in recording.paths["/log"]["TextLog:text"]]
    assert said == ["env 1 ended as invalid_input: non_finite_input"]
    for path, columns in recording.paths.items():
        for name in ("Points3D:positions", "Arrows3D:vectors", "Transform3D:translation"):
            assert all(np.isfinite(row).all() for _, row in columns.get(name, [])), path


@pytest.mark.parametrize("bodies, shapes", [([], []), ([], [stiction.Shape("plane")])])
def test_empty_worlds_are_recorded(tmp_path, bodies, shapes):
    try:
        world = stiction.World(bodies, shapes, 2)
    except stiction.Error as error:
        pytest.skip(f"the library refuses such a world: {error}")
    with view.Recorder(tmp_path / "empty.rrd") as recorder:
        recorder.log(world)
        world.step()
        recorder.log(world)
    assert Recording(verified(tmp_path / "empty.rrd")).series("/residual/env_1") == {1: 0.0, 2: 0.0}


def test_a_world_without_contacts_is_recorded_before_its_first_step(tmp_path):
    ball = stiction.Shape("sphere", 0.1, body=0)
    world = stiction.World([stiction.Body.solid(ball, 1000.0)], [ball], 1, gravity=(0, 0, 0))
    with view.Recorder(tmp_path / "free.rrd") as recorder:
        recorder.log(world)
    recording = Recording(verified(tmp_path / "free.rrd"))
    assert recording.at("/world/env_0/forces", "Arrows3D:vectors", 1).size == 0


def test_cones_are_as_high_as_the_force_and_as_wide_as_the_friction():
    push = np.array([[2.0, 0, 0], [0.0, 0, 0], [1.0, 0, 0]])
    contacts = Contacts(np.zeros((3, 3)), tangents(np.array([[0, 0, 1.0]] * 3)), push,
                        np.array([[0.5, 0.25], [1, 1], [0, 0]]), np.zeros((3, 3)), np.zeros(3, int))
    strips = cone_lines(contacts, 0.1)
    assert len(strips) == 5  # of the first alone: one has no force, one no friction
    np.testing.assert_allclose(np.abs(strips[0]).max(axis=0), [0.1, 0.05, 0.2])
    assert all(np.array_equal(strip[0], [0, 0, 0]) for strip in strips[1:])


def test_a_batch_is_recorded_with_its_reactions_and_couplings(tmp_path):
    batch = stiction.Batch.from_file(DATA / "pile.h5")
    solution = stiction.Solver(solver="auto", tolerance=1e-6).solve(batch)
    with view.Recorder(tmp_path / "batch.rrd") as recorder:
        recorder.log(batch, solution)
    recording = Recording(verified(tmp_path / "batch.rrd"), "environment")
    residuals = recording.series("/residual/simulation_0")
    assert [residuals[env] for env in range(len(batch))] == solution.status["residual"].tolist()
    starts, ends = batch.cone_row_offsets[:-1], batch.cone_row_offsets[1:]
    for env in range(len(batch)):
        rows, cones = batch.rows_of(env), slice(*batch.env_cone_offsets[env:env + 2])
        own = np.zeros((cones.stop - cones.start, 3))
        for k, (start, end) in enumerate(zip(starts[cones], ends[cones])):
            own[k, :end - start] = solution.lambda_[start:end][:3]  # not the torsional one
        arrows = recording.at("/batch/simulation_0/forces", "Arrows3D:vectors", env).reshape(-1, 3)
        largest = np.abs(solution.lambda_[rows]).max(initial=0.0) or 1.0
        np.testing.assert_allclose(arrows[:, [2, 0, 1]], own / largest, rtol=1e-5, atol=1e-7)
        bars = recording.at("/batch/simulation_0/reactions", "BarChart:values", env).item()["buffer"]
        assert len(bars) == rows.stop - rows.start
        edges = [row for when, row in recording.paths["/batch/simulation_0/graph"]["GraphEdges:edges"] if when == env]
        coupled = set()
        cone_of = np.repeat(np.arange(len(own)), (ends - starts)[cones])
        for row in range(rows.start, rows.stop):
            for place in range(*batch.row_offsets[row:row + 2]):
                pair = cone_of[row - rows.start], cone_of[batch.column[place]]
                if batch.A[place] != 0 and pair[0] < pair[1]:
                    coupled.add((str(pair[0]), str(pair[1])))
        assert {(edge["first"], edge["second"]) for edge in edges[0]} == coupled
    assert len(own) > 5 and coupled


def test_a_trajectory_is_recorded_by_steps_and_simulations(tmp_path, capsys):
    assert view.main([str(DATA / "trajectory.h5"), "-o", str(tmp_path / "t.rrd"), "--simulations", "2"]) == 0
    batch = stiction.Batch.from_file(DATA / "trajectory.h5")
    assert capsys.readouterr().out.startswith(f"{len(batch)} environments, ")
    recording = Recording(verified(tmp_path / "t.rrd"))
    steps = np.asarray(batch.extras["step"])
    assert len(recording.series("/residual/simulation_3")) == len(set(steps.tolist())) == len(batch) // 4
    drawn = {path.split("/")[2] for path in recording.paths if path.startswith("/batch/")}
    assert drawn == {"simulation_0", "simulation_1"}


@pytest.mark.parametrize("cones", ["friction", ["unilateral", ("friction", 2)]])
def test_padded_and_flat_batches_with_nan_and_without_rows(tmp_path, cones):
    A = np.tile(np.eye(3), (3, 1, 1))
    b = -np.ones((3, 3))
    b[1, 0] = np.nan
    counts = np.array([3, 3, 0], np.int32)
    padded = stiction.Batch.from_delassus(A, b, mu=0.5, cones=cones, counts=counts)
    flat = stiction.Batch.from_delassus([A[0], A[0], A[0][:0, :0]], [b[0], b[1], b[0][:0]], mu=0.5,
                                        cones=[cones, cones, []])
    for name, batch in (("padded", padded), ("flat", flat)):
        with view.Recorder(tmp_path / f"{name}.rrd") as recorder:
            recorder.log(batch)
        recording = Recording(verified(tmp_path / f"{name}.rrd"), "environment")
        arrows = [recording.at("/batch/simulation_0/forces", "Arrows3D:vectors", env) for env in range(3)]
        assert [len(rows) for rows in arrows][::2] == [1 if cones == "friction" else 2, 0]
        assert np.abs(arrows[0]).max() == pytest.approx(1.0) and np.isfinite(arrows[1]).all()


def test_what_cannot_be_recorded_is_refused(tmp_path, scenes):
    with view.Recorder(tmp_path / "x.rrd") as recorder:
        with pytest.raises(TypeError, match="expected a stiction.World, .* got int"):
            recorder.log(3)
        bodies = worlds.started(envs=1)
        bodies.step()
        with pytest.raises(TypeError, match="batch: expected one of form 'delassus' on cpu, got 'bodies'"):
            recorder.log(bodies.contacts().batch(bodies.state().twist))
    with view.Recorder(tmp_path / "y.rrd") as recorder:
        recorder.log(worlds.started(envs=1))
        with pytest.raises(ValueError, match="make another recorder"):
            recorder.log(worlds.started(envs=1))
    with view.Recorder(tmp_path / "z.rrd", envs=[5]) as recorder, pytest.raises(ValueError, match="0..2, got 5"):
        recorder.log(worlds.started(envs=3))


def test_the_command_says_what_is_wrong_in_a_sentence(tmp_path, capsys):
    bad = tmp_path / "bad.h5"
    bad.write_bytes(b"no file of this kind")
    for path in (bad, tmp_path / "none.h5"):
        assert view.main([str(path)]) == 2
        said = capsys.readouterr().err
        assert said.startswith("stiction.view: ") and said.count("\n") == 1, said
    assert not pathlib.Path(tmp_path / "none.rrd").exists()


def test_the_example_records_what_it_says(tmp_path):
    out = tmp_path / "example.rrd"
    program = [sys.executable, str(ROOT / "examples" / "python" / "11_view.py"), "--envs", "3", "--drawn", "1", "--steps",
               "5", "-o", str(out)]
    done = subprocess.run(program, capture_output=True, text=True)
    assert done.returncode == 0 and not done.stderr, done.stderr
    assert done.stdout.startswith("5 steps of 3 environments, 1 drawn; hash ")
    assert sorted(Recording(verified(out)).series("/residual/env_0")) == [1, 2, 3, 4, 5]


def test_cones_of_a_manifold_stand_behind_each_other_and_none_on_another(tmp_path):
    n = 6
    groups = [np.array([0, 0, -1, -1, 2, 2], np.int32), np.full(n, -1, np.int32)]
    batch = stiction.Batch.from_delassus([np.eye(3 * n)] * 2, [-np.ones(3 * n)] * 2, mu=0.5, groups=groups)
    with view.Recorder(tmp_path / "groups.rrd") as recorder:
        recorder.log(batch)
    recording = Recording(verified(tmp_path / "groups.rrd"), "environment")
    for env in range(2):
        points = recording.at("/batch/simulation_0/contacts", "Points3D:positions", env)
        assert len(set(map(tuple, points.tolist()))) == n
        steps = np.diff(points, axis=0)[[0, 4]]
        assert (steps == [0, 2, 0]).all() if env == 0 else not (steps == [0, 2, 0]).all()


@pytest.mark.parametrize("mu", [0.5, np.array([[0.5, 0.25], [0.125, 0.75]]), np.full((2, 6), 0.5)],
                         ids=["one", "by_cone", "by_row"])
def test_friction_is_that_of_each_cone(tmp_path, mu):
    batch = stiction.Batch.from_delassus(np.tile(np.eye(6), (2, 1, 1)), -np.ones((2, 6)), mu=mu)
    with view.Recorder(tmp_path / "mu.rrd") as recorder:
        recorder.log(batch)
    recording = Recording(tmp_path / "mu.rrd", "environment")
    for env in range(2):
        expected = mu[env] if np.ndim(mu) and mu.shape == (2, 2) else [0.5, 0.5]
        np.testing.assert_array_equal(recording.at("/batch/simulation_0/contacts", "mu", env), expected)


@pytest.mark.parametrize("options", [{"dtype": "float32"}, {"device": "emulated"}])
def test_worlds_of_either_precision_and_device(tmp_path, options):
    world = worlds.started(envs=2, **options)
    world.step(count=30)
    with view.Recorder(tmp_path / "w.rrd") as recorder:
        recorder.log(world)
    found = Recording(verified(tmp_path / "w.rrd")).at("/world/env_1/bodies/body_7", "Transform3D:translation", 1)[0]
    np.testing.assert_array_equal(found, world.state().position[1, 7].astype(np.float32))
