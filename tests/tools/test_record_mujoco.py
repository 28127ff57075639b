#!/usr/bin/env python3
"""What tools/record_mujoco.py writes, against mechanics worked out by hand and against MuJoCo's own numbers.

Run as a program it exits with 77 (skipped) when numpy, h5py or mujoco is missing, and says which.
"""
import contextlib
import importlib.util
import io
import os
import sys
import tempfile
import unittest
import unittest.mock
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SHARED = Path(os.environ.get("STICTION_SHARED_DIR", ROOT.parent / "shared"))


def load(path):
    spec = importlib.util.spec_from_file_location(Path(path).stem, path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


try:
    import h5py
    import numpy as np

    recorder = load(ROOT / "tools" / "record_mujoco.py")
    import mujoco
except ImportError as missing:
    REASON = f"SKIPPED: the recorder is not tested, {missing}; pip install -r tools/requirements.txt"
    if __name__ == "__main__":
        print(REASON)
        sys.exit(77)
    raise unittest.SkipTest(REASON) from missing

# A ball at rest on a plane: mass 2 kg, radius 0.1 m, so that A can be written down.
BALL = """<mujoco><option timestep="0.002"/><worldbody><geom type="plane" size="1 1 1" friction="0.7 0.02 0.003"/>
<body pos="0 0 0.0999"><freejoint/><geom type="sphere" size="0.1" mass="2" condim="{condim}" friction="0.7 0.02 0.003"/>
</body></worldbody></mujoco>"""

# Every kind of row at once: an equality, dry friction in a joint and in a tendon, a limit that is exceeded, and
# contacts of 1, 3, 4 and 6 rows, one of them with a friction ellipse.
EVERYTHING = """<mujoco><option timestep="0.002"/><worldbody><geom name="floor" type="plane" size="2 2 1"/>
<body pos="0 0 0.0999"><freejoint/><geom name="slick" type="sphere" size="0.1" condim="1" priority="1"/></body>
<body pos="1 0 0.0999"><freejoint/><geom type="box" size="0.1 0.1 0.1" condim="3" friction="0.9"/></body>
<body pos="0 1 0.0999"><freejoint/><geom name="oval" type="sphere" size="0.1"/></body>
<body pos="1 1 0.0999"><freejoint/><geom type="sphere" size="0.1" condim="6" friction="1.2 0.01 0.002"/></body>
<body pos="0 0 2"><joint name="a" axis="0 1 0" frictionloss="0.3"/>
<geom type="capsule" fromto="0 0 0 0.4 0 0" size="0.03"/>
<body pos="0.45 0 0"><joint name="b" axis="0 1 0" limited="true" range="-10 10"/>
<geom type="capsule" fromto="0 0 0 0.4 0 0" size="0.03"/>
<body pos="0.45 0 0"><joint name="c" axis="0 1 0"/><geom type="sphere" size="0.05"/></body></body></body></worldbody>
<tendon><fixed name="cable" frictionloss="0.4"><joint joint="a" coef="1"/><joint joint="c" coef="-0.5"/></fixed>
</tendon>
<equality><joint joint1="c" joint2="b" polycoef="0 1 0 0 0"/></equality>
<contact><pair geom1="floor" geom2="oval" condim="4" friction="1.1 0.6 0.05 0.001 0.001"/></contact>
<actuator><motor joint="a" gear="5" ctrllimited="true" ctrlrange="-1 1"/></actuator>
<keyframe><key name="bent"
qpos="0 0 0.0999 1 0 0 0 1 0 0.0999 1 0 0 0 0 1 0.0999 1 0 0 0 1 1 0.0999 1 0 0 0 0.1 0.3 0.2"/>
</keyframe></mujoco>"""


class Recording(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)

    def record(self, xml, *arguments, name="out.h5"):
        """Runs the recorder on a model; returns exit status, standard error, and the file's path."""
        model = self.folder / "model.xml"
        model.write_text(xml, encoding="utf-8")
        path, errors = self.folder / name, io.StringIO()
        with contextlib.redirect_stderr(errors), contextlib.redirect_stdout(io.StringIO()):
            status = recorder.main([str(model), "-o", str(path), *arguments])
        return status, errors.getvalue(), path

    def first_environment(self, xml, *arguments):
        status, errors, path = self.record(xml, "--envs", "1", "--steps", "1", "--every", "1", *arguments)
        self.assertEqual((status, errors), (0, ""))
        return environment(arrays(path), 0)


def arrays(path):
    """Every dataset of a file by its name."""
    out = {}
    with h5py.File(path) as file:
        file.visititems(lambda name, item: out.update({name: item[()]}) if isinstance(item, h5py.Dataset) else None)
    return out


def environment(file, index):
    """One environment of arrays(), its matrices dense: a reader written from the format's description."""
    def span(name):
        return slice(*file[name][index:index + 2])

    def dense(name, rows, width):
        ptr, out = file[f"{name}/ptr"][rows.start:rows.stop + 1], np.zeros((rows.stop - rows.start, width))
        for row, begin, end in zip(out, ptr, ptr[1:]):
            row[file[f"{name}/col"][begin:end]] = file[f"{name}/val"][begin:end]
        return out

    rows, cones, dofs = span("env_row_ptr"), span("env_cone_ptr"), span("env_dof_ptr")
    n, nv = rows.stop - rows.start, dofs.stop - dofs.start
    out = {name: file[name][rows] for name in ("b", "R", "row_param", "row_target", "lambda_ref")}
    out |= {name: file[name][dofs] for name in ("v_free", "v_ref")}
    out |= {"A": dense("A", rows, n), "J": dense("J", rows, nv), "M": dense("M", dofs, nv)}
    out["kind"] = file["cone_kind"][cones]
    out["size"] = np.diff(file["cone_row_ptr"][cones.start:cones.stop + 1])
    return out


def system_of(e):
    """The environment as the recorder's own record, to judge lambda_ref."""
    return recorder.System(cone_kind=e["kind"], cone_rows=e["size"], row_param=e["row_param"], A=e["A"], b=e["b"],
                           R=e["R"], J=e["J"], M=e["M"], v_free=e["v_free"], row_target=e["row_target"],
                           lambda_ref=e["lambda_ref"], v_ref=e["v_ref"])


class OneBall(Recording):
    def test_the_delassus_operator_of_a_ball_on_a_plane_is_what_mechanics_says(self):
        e = self.first_environment(BALL.format(condim=3))
        # 1/m along the normal; across it d^2 / I on top, I = 2/5 m r^2, d the contact point's distance from the
        # centre: r less half the penetration, which is 0.1 mm and what one step of free fall adds at most.
        deepest = 1e-4 + 9.81 * 0.002**2
        self.assertAlmostEqual(e["A"][0, 0], 1 / 2, places=12)
        self.assertGreater(e["A"][1, 1], 1 / 2 + (0.1 - deepest / 2)**2 / (0.4 * 2 * 0.1**2))
        self.assertLess(e["A"][1, 1], 1 / 2 + 0.1**2 / (0.4 * 2 * 0.1**2))
        self.assertAlmostEqual(e["A"][2, 2], e["A"][1, 1], places=12)
        self.assertLess(np.abs(e["A"] - np.diag(np.diag(e["A"]))).max(), 1e-12)

    def test_the_free_motion_of_a_ball_is_gravity(self):
        e = self.first_environment(BALL.format(condim=3))
        np.testing.assert_allclose(e["v_free"], [0, 0, -9.81, 0, 0, 0], atol=1e-12)
        self.assertAlmostEqual(e["b"][0] + e["row_target"][0], -9.81, places=12)

    def test_the_number_of_rows_and_the_friction_of_each_axis_follow_condim(self):
        for condim, friction in ((3, [0.7, 0.7]), (4, [0.7, 0.7, 0.02]), (6, [0.7, 0.7, 0.02, 0.003, 0.003])):
            e = self.first_environment(BALL.format(condim=condim))
            self.assertEqual((list(e["kind"]), list(e["size"])), ([recorder.FRICTION], [condim]))
            np.testing.assert_array_equal(e["row_param"], [0.0, *friction])

    def test_a_contact_of_one_row_is_unilateral(self):
        e = self.first_environment(BALL.format(condim=1).replace('<geom type="plane"', '<geom type="plane" condim="1"'))
        self.assertEqual((list(e["kind"]), list(e["size"]), list(e["row_param"])), ([recorder.UNILATERAL], [1], [0.0]))


class EveryKind(Recording):
    def test_each_kind_of_constraint_becomes_its_cone(self):
        e = self.first_environment(EVERYTHING, "--keyframe", "bent", "--control", "zero")
        kinds = dict(zip(*np.unique(e["kind"], return_counts=True)))
        # One joint equality; two dry frictions; the exceeded limit and the slick ball; the box's four corners
        # and the two grippy balls.
        self.assertEqual(kinds, {recorder.FREE: 1, recorder.BOX: 2, recorder.UNILATERAL: 2, recorder.FRICTION: 6})
        first = np.concatenate(([0], np.cumsum(e["size"])))[:-1]
        box = first[e["kind"] == recorder.BOX]
        np.testing.assert_array_equal(e["row_param"][box], [0.3, 0.4])
        params = sorted(tuple(e["row_param"][f:f + s]) for f, s in zip(first[e["kind"] == recorder.FRICTION],
                                                                      e["size"][e["kind"] == recorder.FRICTION]))
        # the floor's own sliding friction, 1, is the larger one at the box
        self.assertEqual(params, sorted([(0, 1, 1)] * 4 + [(0, 1.1, 0.6, 0.05), (0, 1.2, 1.2, 0.01, 0.002, 0.002)]))

    def test_the_file_says_the_same_thing_in_every_form(self):
        status, _, path = self.record(EVERYTHING, "--envs", "8", "--seed", "5", "--steps", "100", "--every", "25",
                                      "--keyframe", "bent", "--perturb", "0.01")
        self.assertEqual(status, 0)
        file = arrays(path)
        for index in range(8):
            e = environment(file, index)
            scale = np.abs(e["A"]).max()
            self.assertGreater(len(e["b"]), 3)
            np.testing.assert_array_equal(e["A"], e["A"].T)
            np.testing.assert_array_equal(e["M"], e["M"].T)
            self.assertLess(np.abs(e["A"] - e["J"] @ np.linalg.solve(e["M"], e["J"].T)).max(), 1e-13 * scale)
            np.testing.assert_allclose(e["b"], e["J"] @ e["v_free"] - e["row_target"],
                                       atol=1e-12 * np.abs(e["b"]).max())
            impulse = e["M"] @ (e["v_ref"] - e["v_free"])
            np.testing.assert_allclose(impulse, e["J"].T @ e["lambda_ref"], atol=1e-10 * max(1, np.abs(impulse).max()))
            self.assertTrue((e["R"] > 0).all())

    def test_the_system_is_the_one_mujoco_builds_for_its_dual_solvers(self):
        model = mujoco.MjModel.from_xml_string(EVERYTHING)
        model.opt.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
        tight = recorder.reference_model(model)
        data = mujoco.MjData(tight)
        mujoco.mj_resetDataKeyframe(tight, data, 0)
        recorder.solve_tightly(tight, data)
        system = recorder.extract(tight, data)
        np.testing.assert_allclose(system.b, data.efc_b, rtol=0, atol=1e-12 * np.abs(system.b).max())
        np.testing.assert_array_equal(system.R, data.efc_R)
        for force in np.random.default_rng(3).standard_normal((3, data.nefc)):
            # J M^-1 J' force, by MuJoCo's factorisation and sparse products
            push, moved, motion = np.zeros(model.nv), np.zeros((1, model.nv)), np.zeros(data.nefc)
            mujoco.mj_mulJacTVec(tight, data, push, force)
            mujoco.mj_solveM(tight, data, moved, push[None])
            mujoco.mj_mulJacVec(tight, data, motion, moved[0])
            np.testing.assert_allclose(system.A @ force, motion, atol=1e-12 * np.abs(motion).max())

    def test_the_reference_solves_the_recorded_system(self):
        status, _, path = self.record(EVERYTHING, "--envs", "8", "--steps", "100", "--every", "25", "--perturb", "0.05")
        self.assertEqual(status, 0)
        file = arrays(path)
        for index in range(8):
            system = system_of(environment(file, index))
            self.assertLess(recorder.natural_residual(system, system.lambda_ref), 1e-10)
            self.assertGreater(recorder.natural_residual(system, system.lambda_ref * 1.01), 1e-6)


class Residual(unittest.TestCase):
    def one_cone(self, kind, param, b):
        n = len(b)
        zero, one = np.zeros(n), np.eye(n)
        return recorder.System(cone_kind=np.array([kind], np.uint8), cone_rows=np.array([n]), row_param=np.array(param),
                               A=2 * one, b=np.array(b), R=zero, J=one, M=one, v_free=zero, row_target=zero,
                               lambda_ref=zero, v_ref=zero)

    def test_hand_made_cones_have_hand_made_residuals(self):
        # a unilateral row pushed shut: w = 2 * 0 - 3, x - P(x + 1.5) = -1.5, times 2, over max|b| = 3
        pushed, pulled = (self.one_cone(recorder.UNILATERAL, [0.0], [b]) for b in (-3.0, 3.0))
        self.assertAlmostEqual(recorder.natural_residual(pushed, np.zeros(1)), 1)
        self.assertAlmostEqual(recorder.natural_residual(pushed, np.ones(1)), 1 / 3)
        self.assertEqual(recorder.natural_residual(pulled, np.zeros(1)), 0)
        # a box of half-width 0.5 cannot reach w = 0 and stops at its bound
        box = self.one_cone(recorder.BOX, [0.5], [-3.0])
        self.assertEqual(recorder.natural_residual(box, np.array([0.5])), 0)
        self.assertAlmostEqual(recorder.natural_residual(box, np.zeros(1)), 1 / 3)
        free = self.one_cone(recorder.FREE, [0.0], [4.0])
        self.assertAlmostEqual(recorder.natural_residual(free, np.array([-1.0])), 0.5)

    def test_force_along_an_axis_without_friction_is_an_error(self):
        cone = self.one_cone(recorder.FRICTION, [0.0, 0.5, 0.0], [-2.0, 0.0, 0.0])
        self.assertEqual(recorder.natural_residual(cone, np.array([1.0, 0.0, 0.0])), 0)
        # 0.25 on the idle axis: the rest of the cone is still at its solution, so the residual is 0.25 * 2 / 2
        self.assertAlmostEqual(recorder.natural_residual(cone, np.array([1.0, 0.0, 0.25])), 0.25)

    def test_projection_onto_the_cone_covers_its_three_regions(self):
        np.testing.assert_array_equal(recorder.project_cone(np.array([5.0, 3.0, 4.0])), [5, 3, 4])
        np.testing.assert_array_equal(recorder.project_cone(np.array([-5.0, 3.0, 4.0])), [0, 0, 0])
        np.testing.assert_allclose(recorder.project_cone(np.array([1.0, 3.0, 4.0])), [3, 1.8, 2.4], rtol=1e-15)

    def test_the_shared_judge_gives_the_same_number(self):
        judge = SHARED / "tools" / "check_solution.py"
        if not judge.exists():
            self.skipTest(f"no judge at {judge}; set STICTION_SHARED_DIR")
        file = arrays(ROOT / "examples" / "data" / "hand_cube.h5")
        blurred, first = file["lambda_ref"] * 0.99, file["env_row_ptr"]
        theirs = load(judge).residuals(file, blurred, "convex")
        for index in range(0, len(theirs), 8):
            force = blurred[first[index]:first[index + 1]]
            ours = recorder.natural_residual(system_of(environment(file, index)), force)
            self.assertAlmostEqual(ours / theirs[index], 1, places=9)


class Format(Recording):
    def test_types_and_attributes_are_those_of_the_format(self):
        _, _, path = self.record(EVERYTHING, "--envs", "2", "--steps", "20", "--every", "10")
        with h5py.File(path) as file:
            self.assertEqual((file.attrs["format"], file.attrs["version"], file.attrs["law"]),
                             ("contact-batch", 1, "convex"))
            self.assertEqual(file.attrs["source"], f"MuJoCo {mujoco.__version__}, model")
        types = {name: values.dtype.str for name, values in arrays(path).items()}
        pointers = {name: "<i8" for name in ("env_row_ptr", "env_cone_ptr", "env_dof_ptr", "cone_row_ptr")}
        matrices = {f"{m}/{part}": t for m in "AJM" for part, t in (("ptr", "<i8"), ("col", "<i4"), ("val", "<f8"))}
        numbers = {name: "<f8" for name in ("row_param", "b", "R", "v_free", "row_target", "lambda_ref", "v_ref")}
        self.assertEqual(types, {"cone_kind": "|u1", **pointers, **matrices, **numbers})


class Trajectory(Recording):
    def trajectory(self, models, *arguments, name="out.h5"):
        """Records one trajectory of each model; returns the file's arrays and path."""
        paths, errors = [], io.StringIO()
        for i, xml in enumerate(models):
            paths.append(self.folder / f"model{i}.xml")
            paths[-1].write_text(xml, encoding="utf-8")
        out = self.folder / name
        with contextlib.redirect_stderr(errors), contextlib.redirect_stdout(io.StringIO()):
            status = recorder.main([*map(str, paths), "-o", str(out), *arguments])
        self.assertEqual((status, errors.getvalue()), (0, ""))
        return arrays(out), out

    def ids(self, file, env):
        return file["cone_id"][slice(*file["env_cone_ptr"][env:env + 2])].tolist()

    def test_steps_follow_one_another_model_by_model(self):
        falling = BALL.format(condim=3).replace("0 0 0.0999", "0 0 0.5").replace("0.002", "0.004")
        file, path = self.trajectory([BALL.format(condim=3), falling], "--trajectory", "4", "--skip", "3")
        self.assertEqual(file["step"].tolist(), [0, 0, 1, 1, 2, 2, 3, 3])
        self.assertEqual(file["dt"].tolist(), [0.002, 0.004] * 4)
        self.assertEqual([name.decode() for name in file["env_name"]], ["model0", "model1"] * 4)
        # the ball in the air has no constraint and keeps its place
        self.assertEqual(np.diff(file["env_cone_ptr"]).tolist(), [1, 0] * 4)
        self.assertEqual(file["cone_id"].dtype, np.uint64)
        self.assertEqual(len(set(file["cone_id"].tolist())), 1)
        with h5py.File(path) as stored:
            self.assertEqual(stored.attrs["source"], f"MuJoCo {mujoco.__version__}, model0, model1")

    def test_a_trajectory_is_the_simulation_itself(self):
        # free fall onto the plane: the state before each step gives row_target and v_free, so b at consecutive steps
        # must be those of MuJoCo's own steps from the same state
        xml = BALL.format(condim=1)
        file, _ = self.trajectory([xml], "--trajectory", "5", "--skip", "2", "--control", "zero")
        model, _ = recorder.load(str(self.folder / "model0.xml"), None)
        data = mujoco.MjData(model)
        for _ in range(2):
            mujoco.mj_step(model, data)
        for env in range(5):
            mujoco.mj_step(model, data)
            mujoco.mj_forward(model, data)
            e = environment(file, env)
            np.testing.assert_allclose(e["v_free"], data.qacc_smooth, rtol=0, atol=1e-12)
            np.testing.assert_allclose(e["row_target"], data.efc_aref, rtol=1e-9)

    def test_ids_are_unique_in_a_step_and_the_same_for_the_same_contact_in_the_next(self):
        file, _ = self.trajectory([EVERYTHING], "--trajectory", "6", "--skip", "1")
        first = self.ids(file, 0)
        self.assertEqual(len(set(first)), len(first))
        model, _ = recorder.load(str(self.folder / "model0.xml"), None)
        data = mujoco.MjData(model)
        recorder.start_state(model, data, None, np.random.default_rng(0), 0)
        mujoco.mj_forward(model, data)
        ids = recorder.cone_ids(data).tolist()
        kinds, rows, _ = recorder.cones_of(model, data)
        self.assertEqual(len(ids), len(kinds))
        # the four corners of the box on the floor differ in their count alone, whatever the number of their rows
        pairs = {}
        for i, row in zip(ids, np.cumsum(rows) - rows):
            if data.efc_type[row] >= recorder.CONTACT:
                pair = tuple(data.contact[data.efc_id[row]].geom)
                pairs.setdefault(pair, []).append(i)
        corners = [numbers for numbers in pairs.values() if len(numbers) == 4]
        self.assertEqual(len(corners), 1)
        self.assertEqual([n - corners[0][0] for n in corners[0]], [0, 1, 2, 3])
        for env in range(1, 6):
            self.assertEqual(self.ids(file, env), first)  # nothing comes or goes in these few steps
        # another pair, limit or equality never has an id that some other one had
        self.assertTrue(set(n[0] >> 16 for n in pairs.values()).isdisjoint(
            i >> 16 for i, row in zip(ids, np.cumsum(rows) - rows) if data.efc_type[row] < recorder.CONTACT))

    def test_the_same_command_writes_the_same_bytes(self):
        first, second = (self.trajectory([EVERYTHING, BALL.format(condim=4)], "--trajectory", "3", "--perturb", "0.01",
                                         name=name)[1] for name in ("a.h5", "b.h5"))
        self.assertEqual(first.read_bytes(), second.read_bytes())

    def test_a_keyframe_is_for_the_models_that_have_any(self):
        file, _ = self.trajectory([EVERYTHING, BALL.format(condim=4)], "--trajectory", "1", "--keyframe", "bent")
        self.assertEqual(len(file["step"]), 2)

    def test_several_models_need_a_trajectory(self):
        with self.assertRaises(SystemExit) as exit_, contextlib.redirect_stderr(io.StringIO()):
            recorder.main(["a.xml", "b.xml", "-o", "c.h5"])
        self.assertEqual(exit_.exception.code, 2)

    def test_a_simulation_that_blows_up_is_refused(self):
        model = self.folder / "model.xml"
        model.write_text(EVERYTHING, encoding="utf-8")
        errors = io.StringIO()
        fails_second = unittest.mock.patch.object(recorder, "advance", side_effect=[True, False])
        with contextlib.redirect_stderr(errors), fails_second:
            status = recorder.main([str(model), "-o", str(self.folder / "x.h5"), "--trajectory", "5"])
        self.assertEqual((status, (self.folder / "x.h5").exists()), (2, False))
        self.assertIn("model: the simulation became unstable in step 2", errors.getvalue())


class Reproducible(Recording):
    def test_the_same_seed_writes_the_same_bytes_and_another_seed_does_not(self):
        arguments = ("--envs", "6", "--steps", "60", "--every", "20", "--perturb", "0.05")
        files = [self.record(EVERYTHING, *arguments, "--seed", seed, name=f"{i}.h5")[2].read_bytes()
                 for i, seed in enumerate(("1", "1", "2"))]
        self.assertEqual(files[0], files[1])
        self.assertNotEqual(files[0], files[2])


class Limits(Recording):
    def test_recording_stops_at_the_size_limit_and_says_so(self):
        status, errors, path = self.record(EVERYTHING, "--envs", "50", "--steps", "100", "--every", "10",
                                           "--max-mb", "0.05")
        self.assertEqual(status, 1)
        self.assertIn("of 50 environments: --max-mb 0.05 is used up", errors)
        stored = sum(values.nbytes for values in arrays(path).values())
        self.assertLess(stored, 0.05e6 + 100)  # the first entry of each pointer array is not counted
        self.assertGreater(stored, 0.03e6)

    def test_a_model_that_never_touches_anything_is_refused(self):
        alone = "<mujoco><worldbody><body><freejoint/><geom size='1'/></body></worldbody></mujoco>"
        status, errors, path = self.record(alone, "--steps", "4", "--every", "2")
        self.assertEqual((status, path.exists()), (2, False))
        self.assertIn("no instant with constraints", errors)

    def test_bad_input_gets_one_sentence_and_status_2(self):
        for xml, arguments, sentence in (
                ("<mujoco><worldbod/></mujoco>", (), "MuJoCo cannot read this model"),
                ("<mujoco/>", (), "nothing in this model can move"),
                (EVERYTHING, ("--keyframe", "standing"), "--keyframe standing is not in the model; there are: bent"),
                (EVERYTHING, ("--keyframe", "1"), "--keyframe 1 is not in the model; there are: bent")):
            status, errors, path = self.record(xml, *arguments)
            self.assertEqual((status, path.exists()), (2, False))
            self.assertIn(sentence, errors)
            self.assertEqual(errors.count("\n"), 1)

    def test_an_option_out_of_range_is_refused(self):
        for arguments in (("--envs", "0"), ("--perturb", "-1"), ("--steps", "5", "--every", "6")):
            with self.assertRaises(SystemExit) as exit_:
                self.record(EVERYTHING, *arguments)
            self.assertEqual(exit_.exception.code, 2)


class Committed(unittest.TestCase):
    def test_the_recordings_in_the_repository_are_what_their_page_promises(self):
        files = sorted((ROOT / "examples" / "data").glob("*.h5"))
        self.assertLess(sum(f.stat().st_size for f in files), 6e6)
        count = 0
        for path in files:
            file = arrays(path)
            environments = len(file["env_row_ptr"]) - 1
            for index in range(environments):
                system = system_of(environment(file, index))
                self.assertLess(recorder.natural_residual(system, system.lambda_ref), 1e-12, f"{path.name} {index}")
            count += environments
        self.assertGreaterEqual(count, 256)


if __name__ == "__main__":
    unittest.main(verbosity=2)  # says why a test is skipped
