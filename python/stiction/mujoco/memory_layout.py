"""Positions of the fields of MuJoCo's structures in memory, read from the MuJoCo that is installed.

The package describes its own C structures (mujoco.introspect). From that description the offsets follow by the rules
of C. Every one that is used is checked against an array that MuJoCo's Python module shows at that place.
"""

import ctypes
import pathlib

import mujoco
import numpy as np
from mujoco.introspect import ast_nodes, enums, structs

_NUMBERS = {"int": ctypes.c_int, "mjtNum": ctypes.c_double, "double": ctypes.c_double, "float": ctypes.c_float,
            "mjtByte": ctypes.c_uint8, "mjtBool": ctypes.c_uint8, "bool": ctypes.c_bool, "mjtSize": ctypes.c_int64,
            "size_t": ctypes.c_size_t, "uintptr_t": ctypes.c_size_t, "uint64_t": ctypes.c_uint64,
            "char": ctypes.c_char, "unsigned int": ctypes.c_uint, "unsigned char": ctypes.c_uint8}

#: Fields of mjData that hold a pointer to an array, by the name that they have here and there.
POINTERS = ("qpos", "qvel", "ctrl", "qacc", "qacc_smooth", "qacc_warmstart", "qfrc_constraint", "qLD", "M", "efc_type",
            "efc_id", "efc_R", "efc_aref", "efc_frictionloss", "efc_force", "efc_state", "efc_J", "efc_J_rownnz",
            "efc_J_rowadr", "efc_J_colind", "contact")
_NUMBERS_OF_DATA = {"time": ctypes.c_double, "nefc": ctypes.c_int, "ncon": ctypes.c_int, "flg_rnepost": ctypes.c_uint8}

#: One box on a plane, with a joint that has friction and a limit: rows of three kinds.
_PROBE = """<mujoco><worldbody><geom type="plane" size="1 1 1"/><body pos="0 0 .09"><freejoint/>
<geom type="box" size=".1 .1 .1"/></body><body pos="1 0 1"><joint axis="0 1 0" range="10 20" limited="true"
frictionloss="1"/><geom size=".1"/></body></worldbody></mujoco>"""

#: Kind of row by mjtConstraint: stiction's cone kinds free, unilateral, box, friction are 0 to 3, and an edge of a
#: pyramid is 4.
ROW_KINDS = [0, 2, 2, 1, 1, 1, 4, 3]


class LayoutError(RuntimeError):
    """The installed MuJoCo is not as it describes itself, or is too old to do so."""


def _ctype(kind):
    if isinstance(kind, ast_nodes.PointerType):
        return ctypes.c_void_p
    if isinstance(kind, ast_nodes.ArrayType):
        made = _ctype(kind.inner_type)
        for extent in reversed(kind.extents):
            made = made * extent
        return made
    if isinstance(kind, ast_nodes.ValueType):
        name = kind.name.removeprefix("struct ").removesuffix("_")
        if name in _NUMBERS:
            return _NUMBERS[name]
        if name in structs.STRUCTS:
            return _structure(name)
        if name.startswith("mjt"):
            return ctypes.c_int  # an enumeration
    raise LayoutError(f"MuJoCo {mujoco.__version__} has a field of type {kind}, which is not known here")


def _structure(name):
    fields = [(field.name, _ctype(field.type)) for field in structs.STRUCTS[name].fields]
    return type(name, (ctypes.Structure,), {"_fields_": fields})


def library():
    """MuJoCo's C library, as the Python module has loaded it."""
    folder = pathlib.Path(mujoco.__file__).parent
    for pattern in ("libmujoco.so*", "libmujoco*.dylib", "mujoco.dll"):
        for path in sorted(folder.glob(pattern)):
            return ctypes.CDLL(str(path))
    raise LayoutError(f"no MuJoCo library in {folder}: reinstall the package mujoco")


def address(function):
    """Address of a function of MuJoCo's by its name."""
    return ctypes.cast(getattr(library(), function), ctypes.c_void_p).value


def handlers():
    """Addresses of functions of MuJoCo: one sets the handler of a thread's messages, and one returns that of all
    threads. They are 0 where MuJoCo has them not, or has other messages than the C++ side knows."""
    names = "_mjPRIVATE_setTlsLogHandler", "_mjPRIVATE_getGlobalLogHandler"
    if "mjLogMessage" not in structs.STRUCTS or not all(hasattr(library(), name) for name in names):
        return [0, 0]
    message, levels = _structure("mjLogMessage"), enums.ENUMS["mjtLogLevel"].values
    known = (message.level.offset, message.subject.offset, message.subject.size) == (0, 8, 1024) and levels["mjLOG_ERROR"] == 3
    return [address(name) for name in names] if known else [0, 0]


def _array_address(array):
    return array.__array_interface__["data"][0]


def _pointer(data, structure, name):
    return ctypes.c_void_p.from_address(data._address + getattr(structure, name).offset).value


def _check(model, data, structure, names):
    for name in names:
        array = getattr(data, name)
        array = array.dim if name == "contact" else array
        if not array.size:
            continue
        shown = _array_address(array) - (_contact().dim.offset if name == "contact" else 0)
        if _pointer(data, structure, name) != shown:
            raise LayoutError(f"mjData.{name} of MuJoCo {mujoco.__version__} is not where its description says: use a "
                              "version of which the package's tests are known to pass (4.0.0)")


_known = {}


def _contact():
    if "mjContact" not in _known:
        _known["mjContact"] = _structure("mjContact")
    return _known["mjContact"]


def _data():
    """mjData as a ctypes structure, checked once against a small simulation of each kind of Jacobian."""
    if "mjData" in _known:
        return _known["mjData"]
    structure, contact = _structure("mjData"), _contact()
    for jacobian in (mujoco.mjtJacobian.mjJAC_DENSE, mujoco.mjtJacobian.mjJAC_SPARSE):
        model = mujoco.MjModel.from_xml_string(_PROBE)
        model.opt.jacobian = jacobian
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        sparse = jacobian == mujoco.mjtJacobian.mjJAC_SPARSE
        _check(model, data, structure, [name for name in POINTERS if sparse or not name.startswith("efc_J_")])
        data.time, data.flg_rnepost = 0.375, sparse
        for name, kind in _NUMBERS_OF_DATA.items():
            found = kind.from_address(data._address + getattr(structure, name).offset).value
            if found != getattr(data, name):
                raise LayoutError(f"mjData.{name} of MuJoCo {mujoco.__version__} is not where its description says")
        shown = data.contact
        if shown.dim.strides[0] != ctypes.sizeof(contact) or any(
                _array_address(getattr(shown, name)) - _array_address(shown.dim)
                != getattr(contact, name).offset - contact.dim.offset for name in ("friction", "geom")):
            raise LayoutError(f"mjContact of MuJoCo {mujoco.__version__} is not as its description says")
    _known["mjData"] = structure
    return structure


def _rotations(model):
    """First degree of freedom of each rotation that MuJoCo's RK4 combines on the sphere, since version 4."""
    if int(mujoco.__version__.split(".")[0]) < 4:
        return []
    free, ball = int(mujoco.mjtJoint.mjJNT_FREE), int(mujoco.mjtJoint.mjJNT_BALL)
    return [int(first) + 3 * (kind == free) for kind, first in zip(model.jnt_type, model.jnt_dofadr)
            if kind in (free, ball)]


def place_of(model, data, name):
    """Place of mjData's pointer to an array of numbers [bytes], and its shape. Raises LayoutError, ValueError."""
    array = None if name.startswith("efc_") else getattr(data, name, None)  # the number of rows is each one's own
    structure = _data()
    if (not isinstance(array, np.ndarray) or array.dtype != np.float64
            or dict(structure._fields_).get(name) is not ctypes.c_void_p):
        raise ValueError(f"name: expected an array of numbers of mjData's that is as large in all simulations, got {name!r}")
    _check(model, data, structure, (name,))
    return getattr(structure, name).offset, array.shape


def layout(model, data):
    """Offsets and sizes for stiction._core.MujocoSimulations. Raises LayoutError."""
    structure, contact = _data(), _contact()
    _check(model, data, structure, POINTERS[:9])
    found = {name: getattr(structure, name).offset for name in ("time", "nefc", "flg_rnepost") + POINTERS}
    found |= {"contact_bytes": ctypes.sizeof(contact), "contact_dim": contact.dim.offset,
              "contact_friction": contact.friction.offset, "contact_geom": contact.geom.offset,
              "nq": model.nq, "nv": model.nv, "nu": model.nu, "simulation_bytes": data.nbuffer, "sparse": bool(mujoco.mj_isSparse(model)),
              "M_rownnz": np.asarray(model.M_rownnz).tolist(), "M_colind": np.asarray(model.M_colind).tolist(),
              "row_kind": ROW_KINDS, "rotations": _rotations(model), "timestep": float(model.opt.timestep)}
    return found
