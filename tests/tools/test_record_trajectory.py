#!/usr/bin/env python3
"""Consecutive steps that tools/record_mujoco.py writes with --trajectory, and the ids of their contacts.

Run as a program it exits with 77 (skipped) when numpy, h5py or mujoco is missing, and says which.
"""
import contextlib
import io
import sys
import unittest
import unittest.mock

try:
    from recordings import BALL, EVERYTHING, Recording, arrays, environment, recorder
except unittest.SkipTest as missing:
    if __name__ == "__main__":
        print(missing)
        sys.exit(77)
    raise

import h5py  # noqa: E402
import mujoco  # noqa: E402
import numpy as np  # noqa: E402


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
        # Free fall onto the plane: the state before each step gives row_target and v_free. The values of b at
        # consecutive steps must hence be those of MuJoCo's own steps from the same state.
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


if __name__ == "__main__":
    unittest.main(verbosity=2)  # says why a test is skipped
