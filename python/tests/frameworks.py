"""Packages of tools/requirements-frameworks.txt, gigabytes that scripts/test.sh leaves out unless it is told --frameworks."""

import importlib

import pytest


def framework(name, what="stiction with its arrays"):
    """The module `name`. If it is missing or does not load, the caller is skipped: a test, or all tests of a module.
    The reason names the command that installs it."""
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError:
        lacking = f"there is no {name}"
    except (ImportError, OSError) as error:
        lacking = f"{name} does not load ({error})"
    pytest.skip(f"{what} NOT tested, {lacking}: scripts/test.sh --frameworks", allow_module_level=True)


class OtherArray:
    """An array of a framework that is not known here: it speaks DLPack and nothing else."""

    def __init__(self, array):
        self._array = array

    def __dlpack__(self, **options):
        return self._array.__dlpack__(**options)

    def __dlpack_device__(self):
        return self._array.__dlpack_device__()
