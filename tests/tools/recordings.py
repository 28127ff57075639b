"""Runs tools/record_mujoco.py on small models and reads its output; shared by its tests.

Importing it raises unittest.SkipTest, and says why, where numpy, h5py or mujoco is missing.
"""
import contextlib
import importlib.util
import io
import sys
import tempfile
import unittest
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


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
    import check_law
    import contact_batch
except ImportError as missing:
    raise unittest.SkipTest(
        f"SKIPPED: the recorder is not tested, {missing}; pip install -r tools/requirements.txt") from missing

# A ball at rest on a plane: mass 2 kg, radius 0.1 m, so that A can be written down.
BALL = """<mujoco><option timestep="0.002"/><worldbody><geom type="plane" size="1 1 1" friction="0.7 0.02 0.003"/>
<body pos="0 0 0.0999"><freejoint/><geom type="sphere" size="0.1" mass="2" condim="{condim}" friction="0.7 0.02 0.003"/>
</body></worldbody></mujoco>"""

# Every kind of row at once: an equality, dry friction in a joint and in a tendon, a limit that is exceeded. There are
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
