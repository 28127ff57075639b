"""Constants of which each simulation in lanes has its own: masses, friction, gains, damping."""

import mujoco
import numpy as np

from .resident import array_of
from .robots import LEAST_FRICTION, UnsupportedModel, friction_sources, has_affine_parts, is_disabled

#: Names that may vary, and what the batch of robots calls them.
NAMES = {"body_mass": "body_mass", "body_inertia": "body_inertia", "geom_friction": "pair_friction",
         "pair_friction": "pair_friction", "actuator_gainprm": "actuator_gain", "actuator_biasprm": "actuator_bias",
         "dof_damping": "dof_damping", "dof_armature": "dof_armature", "dof_frictionloss": "dof_frictionloss"}
_FREE, _SLIDE, _HINGE = (int(getattr(mujoco.mjtJoint, f"mjJNT_{kind}")) for kind in ("FREE", "SLIDE", "HINGE"))
_TRANSLATED = ("geom_friction", "pair_friction", "actuator_gainprm", "actuator_biasprm")
#: Flags of a model that leave a constant without effect.
_SWITCHES = {"dof_damping": ("DAMPER",), "dof_frictionloss": ("FRICTIONLOSS", "CONSTRAINT")}


def checked_names(model, varies):
    """The names as a tuple. Raises ValueError for those that are not known, or have no effect in a model."""
    names = (varies,) if isinstance(varies, str) else tuple(varies)
    for name in names:
        if name not in NAMES:
            raise ValueError(f"varies: expected some of {', '.join(NAMES)}, got {name!r}")
        if any(is_disabled(model, flag) for flag in _SWITCHES.get(name, ())):
            raise UnsupportedModel(f"varies: {name} has no effect in a model whose opt.disableflags switch it off")
    return names


class _Translated:
    """An array whose rows the batch has in another layout, made anew where they have changed."""

    def __init__(self, array, translate):
        self.array, self._seen, self._translate = array, array.copy(), translate

    def renew(self):
        changed = np.flatnonzero((self.array != self._seen).reshape(len(self.array), -1).any(axis=1))
        if len(changed):
            self._translate(changed, self.array[changed])
            self._seen[changed] = self.array[changed]


class VariedConstants:
    """`arrays`: constants (n, ...) by name, which begin with the model's. Arrays that the batch has in MuJoCo's layout
    are its own memory."""

    def __init__(self, model, names, pairs, core, count):
        self.arrays, self._translated = {}, []
        for name in names:
            rows = array_of(core, NAMES[name], (count, *_shape_of(model, name, pairs)))
            if name not in _TRANSLATED:
                self.arrays[name] = rows
                continue
            first = getattr(model, name)[:, :3] if name.startswith("actuator") else getattr(model, name)
            self.arrays[name] = np.repeat(first[None].astype(rows.dtype), count, axis=0)
            translate = _to_actuators(model, name, rows) if name.startswith("actuator") else \
                _to_pairs(model, name, pairs, rows)
            self._translated.append(_Translated(self.arrays[name], translate))

    def renew(self):
        """Lets the batch have what was written."""
        for one in self._translated:
            one.renew()

    def put(self, i, model):
        """Writes a simulation's constants into an mjModel, and what mj_setConst makes of them but inverse weights."""
        for name, array in self.arrays.items():
            to = getattr(model, name)
            (to[:, :3] if name.startswith("actuator") else to)[:] = array[i]
        model.body_subtreemass[:] = model.body_mass
        for body in range(model.nbody - 1, 0, -1):
            model.body_subtreemass[model.body_parentid[body]] += model.body_subtreemass[body]
        for dof in np.flatnonzero(model.dof_simplenum):
            model.dof_M0[dof] = model.dof_armature[dof] + _simple_inertia(model, dof)


def _simple_inertia(model, dof):
    """M's entry of a degree of freedom that no other is coupled with, but for armature: MuJoCo keeps it in the model."""
    body, joint = model.dof_bodyid[dof], model.dof_jntid[dof]
    kind, part = model.jnt_type[joint], dof - model.jnt_dofadr[joint]
    if kind == _SLIDE or kind == _FREE and part < 3:
        return model.body_mass[body]
    return model.body_inertia[body] @ (model.jnt_axis[joint] ** 2 if kind == _HINGE else np.arange(3) == part % 3)


def _shape_of(model, name, pairs):
    """Extents of a simulation's constants in the batch."""
    if name.startswith("actuator"):
        return model.nu, 3
    return (len(pairs), 5) if name.endswith("friction") else getattr(model, name).shape


def _to_actuators(model, name, rows):
    """The first three parameters of actuators: those that the kind of an actuator leaves out are zero."""
    counts = has_affine_parts(model, name)

    def translate(chosen, values):
        rows[chosen] = np.where(counts, values, 0)
    return translate


def _to_pairs(model, name, pairs, rows):
    """Friction of pairs that may touch: the larger of two geoms', or of the one of higher priority. Explicit pairs have
    their own."""
    explicit = name == "pair_friction"
    places = [p for p, (_, _, number) in enumerate(pairs) if (number is not None) == explicit]
    if explicit:
        numbers = [pairs[p][2] for p in places]

        def friction(values):
            return values[:, numbers]
    else:
        first, second = np.array([friction_sources(model, *pairs[p][:2]) for p in places], int).reshape(-1, 2).T

        def friction(values):
            return np.maximum(values[:, first], values[:, second])[:, :, [0, 0, 1, 2, 2]]

    def translate(chosen, values):
        rows[np.ix_(chosen, places)] = np.maximum(friction(values), LEAST_FRICTION)
    return translate
