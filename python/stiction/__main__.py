"""The command `stiction` of the Python package: `view`, `report` and `step` of a model. Every other command is the C++
program's, which this one starts where it is on the path. docs/howto/view.md, docs/howto/robots_in_lanes.md.

    stiction view BATCH.h5 -o batch.html
    stiction report RUN.json
    stiction step ROBOT.xml --envs 4096
"""

from __future__ import annotations

import importlib
import os
import sys

_COMMANDS = {"view": "records a contact-batch or FCLIB file for a viewer",
             "report": "makes a page of a report of stiction solve, step or scaling"}
_STEP = "steps a MuJoCo model, MODEL.xml, in lanes"
_ELF = b"\x7fELF"


def _compiled() -> str | None:
    """Path of the C++ program of that name, the first on the path."""
    for folder in os.environ.get("PATH", "").split(os.pathsep):
        path = os.path.join(folder, "stiction")
        try:
            with open(path, "rb") as file:
                if file.read(len(_ELF)) == _ELF and os.access(path, os.X_OK):
                    return path
        except OSError:
            continue
    return None


def _step_model(arguments: list[str]) -> int:
    """The command of stiction.mujoco; MuJoCo reads the model."""
    try:
        module = importlib.import_module("stiction.mujoco.__main__")
    except ModuleNotFoundError as missing:
        print(f"stiction step: a model needs {missing.name}, which is not installed: see docs/howto/install.md", file=sys.stderr)
        return 2
    return module.main(arguments, program="stiction")


def main(arguments: list[str] | None = None) -> int:
    """Runs a command. Returns the exit status: that of the command, or 2 where there is none of that name."""
    arguments = sys.argv[1:] if arguments is None else arguments
    name = arguments[0] if arguments else "--help"
    if name in _COMMANDS:
        module = importlib.import_module(f"stiction.{name}")
        return module.main(arguments[1:], program=f"stiction {name}")
    if name == "step" and any(argument.endswith(".xml") for argument in arguments):
        return _step_model(arguments)
    program = _compiled()
    if program is not None:
        sys.stdout.flush()
        os.execv(program, [program, *arguments])
    if name in ("-h", "--help"):
        print("\n".join(["usage: stiction COMMAND ...", "", *(f"  {key:<8}{text}" for key, text in (*_COMMANDS.items(), ("step", _STEP))), "",
                         "Every other command is the C++ program's, which is not on the path: docs/howto/install.md."]))
        return 0
    print(f"stiction: {name}: expected {' or '.join(_COMMANDS)}; other commands are the C++ program's, which is not on the "
          "path", file=sys.stderr)
    return 2


if __name__ == "__main__":
    sys.exit(main())
