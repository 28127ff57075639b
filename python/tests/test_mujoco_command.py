"""python -m stiction.mujoco step: rates and hashes of a model from the shell, and how bad input is refused."""

import pytest
from lanes_models import xml_of

from stiction.mujoco.__main__ import main


@pytest.fixture
def robot(tmp_path):
    path = tmp_path / "dog.xml"
    path.write_text(xml_of("dog"), encoding="utf-8")
    return path


def said(capsys, *arguments):
    status = main(["step", *map(str, arguments)])
    out, err = capsys.readouterr()
    return status, out, err


@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_a_model_is_stepped_and_its_hash_depends_on_no_thread(capsys, robot, dtype):
    how = ("--envs", 21, "--steps", 40, "--dtype", dtype)
    status, out, err = said(capsys, robot, *how, "--threads", 1)
    lines = out.splitlines()
    assert status == 0 and lines[0] == f"dog.xml: 21 simulations, 40 steps, {dtype}"
    assert [line.split()[0] for line in lines[1:]] == ["steps/s", "solved", "failed", "hash"]
    assert float(lines[1].split()[1]) > 0 and float(lines[2].split()[1]) > 90 and lines[3].split()[1] == "0"
    assert err.endswith("step 40 of 40\n")
    digits = lines[4].split()[1]
    assert len(digits) == 16 and said(capsys, robot, *how, "--threads", 2)[1].endswith(f"{digits}\n")
    assert not said(capsys, robot, *how, "--seed", 1)[1].endswith(f"{digits}\n")


@pytest.mark.parametrize("text, arguments, reason", [
    (None, [], "expected an MJCF file, found none"),
    ("<mujoco><worldbody>", [], "XML"),
    ("<mujoco><option density='1'/></mujoco>", [], 'does not step a model in a fluid (opt.density, opt.viscosity): use engine="mujoco"'),
    ("<mujoco/>", ["--envs", 0], "expected at least one simulation, got 0"),
    ("<mujoco/>", ["--steps", 0], "--steps: expected at least 1, got 0"),
    ("<mujoco/>", ["--seed", -1], "--seed: expected at least 0, got -1"),
    ("<mujoco/>", ["--tolerance", -1], "tolerance = -1: must be > 0"),
])
def test_bad_input_is_refused_in_one_sentence(capsys, tmp_path, text, arguments, reason):
    path = tmp_path / "robot.xml"
    if text is not None:
        path.write_text(text, encoding="utf-8")
    status, out, err = said(capsys, path, *arguments)
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert err.startswith(f"stiction.mujoco: {path}: ") and reason in err
