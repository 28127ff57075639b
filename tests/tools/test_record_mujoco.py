#!/usr/bin/env python3
"""Files of tools/record_mujoco.py, against mechanics worked out by hand and against MuJoCo's own numbers.

Run as a program it exits with 77 (skipped) when numpy, h5py or mujoco is missing, and says which.
"""
import sys
import unittest

try:
    from recordings import BALL, EVERYTHING, Recording, arrays, check_law, contact_batch, environment, recorder
except unittest.SkipTest as missing:
    if __name__ == "__main__":
        print(missing)
        sys.exit(77)
    raise

import h5py  # noqa: E402
import mujoco  # noqa: E402
import numpy as np  # noqa: E402


class OneBall(Recording):
    def test_the_delassus_operator_of_a_ball_on_a_plane_is_what_mechanics_says(self):
        e = self.first_environment(BALL.format(condim=3))
        # 1/m along the normal. Across it d^2 / I is on top, I = 2/5 m r^2. d is the contact point's distance from the
        # centre: r less half the penetration. It is 0.1 mm and at most the fall of one step.
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
            self.assertEqual((list(e["kind"]), list(e["size"])), ([contact_batch.FRICTION], [condim]))
            np.testing.assert_array_equal(e["row_param"], [0.0, *friction])

    def test_a_contact_of_one_row_is_unilateral(self):
        e = self.first_environment(BALL.format(condim=1).replace('<geom type="plane"', '<geom type="plane" condim="1"'))
        self.assertEqual((list(e["kind"]), list(e["size"]), list(e["row_param"])), ([contact_batch.UNILATERAL], [1], [0.0]))


class EveryKind(Recording):
    def test_each_kind_of_constraint_becomes_its_cone(self):
        e = self.first_environment(EVERYTHING, "--keyframe", "bent", "--control", "zero")
        kinds = dict(zip(*np.unique(e["kind"], return_counts=True)))
        # One joint equality; two dry frictions; the exceeded limit and the slick ball; the box's four corners
        # and the two grippy balls.
        self.assertEqual(kinds, {contact_batch.FREE: 1, contact_batch.BOX: 2, contact_batch.UNILATERAL: 2, contact_batch.FRICTION: 6})
        first = np.concatenate(([0], np.cumsum(e["size"])))[:-1]
        box = first[e["kind"] == contact_batch.BOX]
        np.testing.assert_array_equal(e["row_param"][box], [0.3, 0.4])
        params = sorted(tuple(e["row_param"][f:f + s]) for f, s in zip(first[e["kind"] == contact_batch.FRICTION],
                                                                      e["size"][e["kind"] == contact_batch.FRICTION]))
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
        with h5py.File(path) as file:
            reference = file["lambda_ref"][:]
            self.assertLess(check_law.residuals(file, reference).max(), 1e-10)
            self.assertGreater(check_law.residuals(file, reference * 1.01).min(), 1e-6)


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


if __name__ == "__main__":
    unittest.main(verbosity=2)  # says why a test is skipped
