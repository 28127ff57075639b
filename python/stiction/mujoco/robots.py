"""An mjModel as the description that stiction steps in lanes: which models can be, and how contacts are made of geoms."""

import math

import mujoco
import numpy as np

from .. import _core

_DISABLE, _ENABLE, _GEOM = mujoco.mjtDisableBit, mujoco.mjtEnableBit, mujoco.mjtGeom
_PLANE, _FIELD, _CYLINDER = int(_GEOM.mjGEOM_PLANE), int(_GEOM.mjGEOM_HFIELD), int(_GEOM.mjGEOM_CYLINDER)
_MESH = int(_GEOM.mjGEOM_MESH)
_SHAPES = (_PLANE, _FIELD, int(_GEOM.mjGEOM_SPHERE), int(_GEOM.mjGEOM_CAPSULE), _CYLINDER, int(_GEOM.mjGEOM_BOX), _MESH)
_RK4, _IMPLICITFAST = int(mujoco.mjtIntegrator.mjINT_RK4), int(mujoco.mjtIntegrator.mjINT_IMPLICITFAST)
_SPINS = (int(mujoco.mjtJoint.mjJNT_FREE), int(mujoco.mjtJoint.mjJNT_BALL))
_AFFINE_GAIN, _AFFINE_BIAS = int(mujoco.mjtGain.mjGAIN_AFFINE), int(mujoco.mjtBias.mjBIAS_AFFINE)
_GAINS = (int(mujoco.mjtGain.mjGAIN_FIXED), _AFFINE_GAIN)
_BIASES = (int(mujoco.mjtBias.mjBIAS_NONE), _AFFINE_BIAS)
#: Sizes of a model that must be 0, and the features they count.
_NONE_OF = {
    "na": "activations of actuators", "nplugin": "plugins", "nflex": "flexes",
    "nmocap": "mocap bodies", "nhistory": "delays", "nplastic": "plasticity"}
#: Arrays of a model that must be zero, and their features.
_ZERO = {
    "dof_dampingpoly": "damping that is not linear", "jnt_stiffnesspoly": "springs that are not linear",
    "jnt_springyield": "springs that yield", "actuator_damping": "damping of actuators",
    "actuator_dampingpoly": "damping of actuators", "actuator_armature": "armature of actuators",
    "actuator_delay": "delays", "geom_adhesion": "adhesion", "pair_adhesion": "adhesion",
    "geom_surfacevel": "moving surfaces", "tendon_stiffness": "springs of tendons", "tendon_damping": "damping of tendons",
    "tendon_armature": "armature of tendons", "tendon_limited": "limits of tendons",
    "tendon_frictionloss": "friction loss of tendons", "geom_fluid": "fluid forces", "jnt_actgravcomp": "gravity compensation by actuators"}
_FLAGS = [getattr(_DISABLE, f"mjDSBL_{name}", 0) for name in (
    "MIDPHASE", "EULERDAMP", "WARMSTART", "REFSAFE", "FILTERPARENT", "SENSOR", "ISLAND", "AUTORESET", "NATIVECCD",
    "MULTICCD", "CONTACT", "CONSTRAINT", "LIMIT", "FRICTIONLOSS", "EQUALITY", "CLAMPCTRL", "GRAVITY", "SPRING", "DAMPER",
    "ACTUATION")]
#: MuJoCo's mjMINMU, which no friction is below.
LEAST_FRICTION = 1e-5
_ENABLED = [getattr(_ENABLE, f"mjENBL_{name}", 0) for name in ("ENERGY", "FWDINV", "INVDISCRETE")]


class UnsupportedModel(ValueError):
    """A model that engine="lanes" does not step; the message says why."""


def _refuse(what):
    raise UnsupportedModel(f'engine="lanes" does not step {what}: use engine="mujoco"')


def is_disabled(model, name):
    """True where a flag of opt.disableflags is set."""
    return bool(model.opt.disableflags & int(getattr(_DISABLE, f"mjDSBL_{name}")))


def check_model(model):
    """Raises UnsupportedModel for models that are not stepped in lanes, but for contacts."""
    opt = model.opt
    if opt.integrator not in (int(mujoco.mjtIntegrator.mjINT_EULER), _RK4, _IMPLICITFAST):
        _refuse("a model whose integrator is not Euler, RK4 or implicitfast")
    unknown = opt.disableflags & ~int(sum(int(flag) for flag in set(_FLAGS)))
    if unknown or opt.enableflags & ~int(sum(int(flag) for flag in set(_ENABLED))):
        _refuse(f"models with disableflags {opt.disableflags} and enableflags {opt.enableflags}")
    if opt.density or opt.viscosity:
        _refuse("a model in a fluid (opt.density, opt.viscosity)")
    if opt.noslip_iterations:
        _refuse("a model with opt.noslip_iterations")
    if getattr(opt, "disableactuator", 0):
        _refuse("a model with opt.disableactuator")
    for name, what in _NONE_OF.items():
        if getattr(model, name, 0):
            _refuse(f"{what} (model.{name} = {getattr(model, name)})")
    for name, what in _ZERO.items():
        values = getattr(model, name, None)
        if values is not None and np.any(values):
            _refuse(f"{what} (model.{name})")
    for i in range(model.nu):
        if model.actuator_trntype[i] != int(mujoco.mjtTrn.mjTRN_JOINT):
            _refuse(f"actuator {i}, which acts on no joint")
        if model.actuator_dyntype[i] != int(mujoco.mjtDyn.mjDYN_NONE):
            _refuse(f"actuator {i}, which has dynamics")
        if model.actuator_gaintype[i] not in _GAINS:
            _refuse(f"actuator {i}, whose gain is not affine")
        if model.actuator_biastype[i] not in _BIASES:
            _refuse(f"actuator {i}, whose bias is not affine")
        if model.jnt_type[model.actuator_trnid[i, 0]] in _SPINS:
            _refuse(f"actuator {i} on a free or ball joint")


def _add_equalities(to, model):
    if is_disabled(model, "EQUALITY") or is_disabled(model, "CONSTRAINT"):
        return
    for i in np.flatnonzero(model.eq_active0):
        if model.eq_type[i] != int(mujoco.mjtEq.mjEQ_JOINT):
            _refuse(f"equality {i}, which is none of joints")
        to.add_equality(joint_a=int(model.eq_obj1id[i]), joint_b=int(model.eq_obj2id[i]),
                        polynomial=model.eq_data[i, :5].tolist(), solref=model.eq_solref[i].tolist(),
                        solimp=model.eq_solimp[i].tolist())


def _pairs_of(model):
    """Geoms that may touch: (first, second, number of the explicit pair or None), MuJoCo's mj_collision."""
    if is_disabled(model, "CONTACT") or is_disabled(model, "CONSTRAINT"):
        return []
    explicit = [(int(a), int(b)) for a, b in zip(model.pair_geom1, model.pair_geom2)]
    found = [(a, b, i) for i, (a, b) in enumerate(explicit)]
    taken = {frozenset(pair) for pair in explicit}
    excluded = {int(signature) for signature in model.exclude_signature}
    body, weld = model.geom_bodyid, model.body_weldid
    for a in range(model.ngeom):
        for b in range(a + 1, model.ngeom):
            if not (model.geom_contype[a] & model.geom_conaffinity[b] or model.geom_contype[b] & model.geom_conaffinity[a]):
                continue
            one, other = int(body[a]), int(body[b])
            w1, w2 = weld[one], weld[other]
            if w1 == w2 or frozenset((a, b)) in taken:
                continue
            p1, p2 = weld[model.body_parentid[w1]], weld[model.body_parentid[w2]]
            if not is_disabled(model, "FILTERPARENT") and w1 and w2 and (w1 == p2 or w2 == p1):
                continue
            if ((one << 16) + other) in excluded or ((other << 16) + one) in excluded:
                continue
            found.append((a, b, None))
    return found


def friction_sources(model, a, b):
    """Two geoms the larger of whose friction is that of contacts between a and b: of one priority both, else one twice."""
    one, other = int(model.geom_priority[a]), int(model.geom_priority[b])
    return (a, b) if one == other else (a, a) if one > other else (b, b)


def _mixed(model, a, b):
    """Parameters of the contacts of two geoms, by MuJoCo's mj_contactParam."""
    g, h = friction_sources(model, a, b)
    friction = np.maximum(model.geom_friction[g], model.geom_friction[h])
    if g == h:
        return int(model.geom_condim[g]), friction, model.geom_solref[g], model.geom_solimp[g]
    s, t, tiny = float(model.geom_solmix[a]), float(model.geom_solmix[b]), 1e-15
    if s >= tiny and t >= tiny:
        mix = s / (s + t)
    else:
        mix = 0.5 if s < tiny and t < tiny else (0.0 if s < tiny else 1.0)
    ref, other_ref = model.geom_solref[a], model.geom_solref[b]
    timed = ref[0] > 0 and other_ref[0] > 0
    solref = mix * ref + (1 - mix) * other_ref if timed else np.minimum(ref, other_ref)
    solimp = mix * model.geom_solimp[a] + (1 - mix) * model.geom_solimp[b]
    return max(int(model.geom_condim[a]), int(model.geom_condim[b])), friction, solref, solimp


def _contact_of(model, a, b, explicit):
    """Arguments of add_pair that follow from MuJoCo's rules."""
    if explicit is None:
        dim, friction, solref, solimp = _mixed(model, a, b)
        friction = friction[[0, 0, 1, 2, 2]]
        margin, gap = (float(values[a] + values[b]) for values in (model.geom_margin, model.geom_gap))
        tangential = np.zeros(2)
    else:
        dim, friction = int(model.pair_dim[explicit]), model.pair_friction[explicit]
        solref, solimp = model.pair_solref[explicit], model.pair_solimp[explicit]
        margin, gap = float(model.pair_margin[explicit]), float(model.pair_gap[explicit])
        tangential = model.pair_solreffriction[explicit]
    return dict(dim=dim, friction=np.maximum(friction, LEAST_FRICTION).tolist(), margin=margin, reach=margin + gap,
                solref=solref.tolist(), solimp=solimp.tolist(), friction_solref=tangential.tolist())


def _add_bodies(to, model):
    for i in range(model.nbody):
        to.add_body(parent=int(model.body_parentid[i]), joints=int(model.body_jntnum[i]),
                    position=model.body_pos[i].tolist(), orientation=model.body_quat[i].tolist(),
                    mass=float(model.body_mass[i]), centre=model.body_ipos[i].tolist(),
                    inertia_axes=model.body_iquat[i].tolist(), inertia=model.body_inertia[i].tolist(),
                    inverse_weight=model.body_invweight0[i].tolist(),
                    gravity_compensation=float(model.body_gravcomp[i]))
    has_springs = not is_disabled(model, "SPRING")
    has_limits = not (is_disabled(model, "LIMIT") or is_disabled(model, "CONSTRAINT"))
    for j in range(model.njnt):
        q, is_spin = int(model.jnt_qposadr[j]), model.jnt_type[j] in _SPINS
        to.add_joint(kind=int(model.jnt_type[j]), position=model.jnt_pos[j].tolist(), axis=model.jnt_axis[j].tolist(),
                     reference=0.0 if is_spin else float(model.qpos0[q]),
                     stiffness=float(model.jnt_stiffness[j]) if has_springs else 0.0,
                     rest=0.0 if is_spin else float(model.qpos_spring[q]),
                     is_limited=bool(model.jnt_limited[j]) and has_limits, range=model.jnt_range[j].tolist(),
                     margin=float(model.jnt_margin[j]), solref=model.jnt_solref[j].tolist(),
                     solimp=model.jnt_solimp[j].tolist(), is_force_limited=bool(model.jnt_actfrclimited[j]),
                     force_range=model.jnt_actfrcrange[j].tolist())
    has_damping = not is_disabled(model, "DAMPER")
    has_loss = not (is_disabled(model, "FRICTIONLOSS") or is_disabled(model, "CONSTRAINT"))
    for i in range(model.nv):
        to.add_dof(armature=float(model.dof_armature[i]), damping=float(model.dof_damping[i]) if has_damping else 0.0,
                   friction_loss=float(model.dof_frictionloss[i]) if has_loss else 0.0,
                   solref=model.dof_solref[i].tolist(), solimp=model.dof_solimp[i].tolist(),
                   inverse_weight=float(model.dof_invweight0[i]))


def has_affine_parts(model, name):
    """Which of the first three numbers of "actuator_gainprm" or "actuator_biasprm" count, bool (nu, 3)."""
    if name == "actuator_gainprm":
        is_affine = model.actuator_gaintype == _AFFINE_GAIN
        return np.stack([np.ones(model.nu, bool), is_affine, is_affine], axis=1)
    return np.repeat((model.actuator_biastype == _AFFINE_BIAS)[:, None], 3, axis=1)


def _add_actuators(to, model):
    off, infinite = is_disabled(model, "ACTUATION"), [-math.inf, math.inf]
    clips = not is_disabled(model, "CLAMPCTRL")
    for i in range(model.nu):
        gain, bias = (getattr(model, name)[i, :3] * has_affine_parts(model, name)[i]
                      for name in ("actuator_gainprm", "actuator_biasprm"))
        to.add_actuator(joint=int(model.actuator_trnid[i, 0]), gear=0.0 if off else float(model.actuator_gear[i, 0]),
                        gain=gain.tolist(), bias=bias.tolist(),
                        control=model.actuator_ctrlrange[i].tolist() if clips and model.actuator_ctrllimited[i] else infinite,
                        force=model.actuator_forcerange[i].tolist() if model.actuator_forcelimited[i] else infinite)


def has_fixed_tendons(model):
    """True where lengths of all tendons are weighted sums of joints' coordinates, as they are computed in lanes."""
    return bool((model.wrap_type == int(mujoco.mjtWrap.mjWRAP_JOINT)).all())


def _add_tendons(to, model):
    to.tendons = model.ntendon if has_fixed_tendons(model) else 0
    for tendon in range(to.tendons):
        first = int(model.tendon_adr[tendon])
        for term in range(first, first + int(model.tendon_num[tendon])):
            to.add_tendon_term(tendon=tendon, joint=int(model.wrap_objid[term]), coefficient=float(model.wrap_prm[term]))


def _add_field(to, model, i):
    rows, columns, first = (int(values[i]) for values in (model.hfield_nrow, model.hfield_ncol, model.hfield_adr))
    x, y, height, base = model.hfield_size[i].tolist()
    shares = model.hfield_data[first:first + rows * columns]
    to.add_field(rows=rows, columns=columns, half=[x, y], base=base, heights=(shares.astype(float) * height).tolist())


def _add_hull(to, model, i):
    """The convex hull of mesh i: its vertices, and MuJoCo's flat polygons of them."""
    first, polygons = int(model.mesh_polyadr[i]), int(model.mesh_polynum[i])
    begins, counts = (values[first:first + polygons] for values in (model.mesh_polyvertadr, model.mesh_polyvertnum))
    if not polygons:
        _refuse(f"contacts of mesh {i}, which has no hull")
    corners = np.concatenate([model.mesh_polyvert[b:b + n] for b, n in zip(begins, counts)])
    used, places = np.unique(corners, return_inverse=True)
    vertices = model.mesh_vert[int(model.mesh_vertadr[i]):][used]
    to.add_hull(vertices=vertices.astype(float).tolist(), face_begin=[0, *np.cumsum(counts).tolist()], corners=places.tolist())


def _add_contacts(to, model):
    pairs = _pairs_of(model)
    for a, b, _ in pairs:
        kinds = sorted((int(model.geom_type[a]), int(model.geom_type[b])))
        if any(kind not in _SHAPES for kind in kinds):
            _refuse(f"contacts of geoms {a} and {b}, which are not both planes, height fields, spheres, capsules, cylinders, boxes or meshes")
        if (_CYLINDER in kinds or _MESH in kinds) and kinds[0] == _FIELD:
            _refuse(f"contacts of geoms {a} and {b}, a cylinder or mesh and a height field")
        if (_CYLINDER in kinds or _MESH in kinds) and kinds[0] != _PLANE:
            for flag in ("NATIVECCD", "MULTICCD"):
                if is_disabled(model, flag):
                    _refuse(f"contacts of geoms {a} and {b} with {flag.lower()} disabled")
        if _FIELD in kinds and model.body_weldid[model.geom_bodyid[a if model.geom_type[a] == _FIELD else b]]:
            _refuse(f"contacts of geoms {a} and {b}, a height field on a body that moves")
    used = sorted({g for a, b, _ in pairs for g in (a, b)})
    places = {g: i for i, g in enumerate(used)}
    fields = sorted({int(model.geom_dataid[g]) for g in used if model.geom_type[g] == _FIELD})
    for i in fields:
        _add_field(to, model, i)
    meshes = sorted({int(model.geom_dataid[g]) for g in used if model.geom_type[g] == _MESH})
    for i in meshes:
        _add_hull(to, model, i)
    for g in used:
        to.add_geom(body=int(model.geom_bodyid[g]), kind=int(model.geom_type[g]), size=model.geom_size[g].tolist(),
                    position=model.geom_pos[g].tolist(), orientation=model.geom_quat[g].tolist(),
                    field=fields.index(model.geom_dataid[g]) if model.geom_type[g] == _FIELD else -1,
                    hull=meshes.index(model.geom_dataid[g]) if model.geom_type[g] == _MESH else -1)
    for a, b, explicit in pairs:
        given = _contact_of(model, a, b, explicit)
        if model.geom_type[a] > model.geom_type[b]:
            a, b = b, a
        to.add_pair(geom_a=places[a], geom_b=places[b], **given)
    return [(a, b, i) if model.geom_type[a] <= model.geom_type[b] else (b, a, i) for a, b, i in pairs]


def description(model):
    """The ArticulatedDescription of an mjModel, and of each of its pairs the geoms and the number of an explicit pair, or
    None. Raises UnsupportedModel."""
    check_model(model)
    to = _core.ArticulatedDescription()
    opt = model.opt
    to.timestep, to.impratio = float(opt.timestep), float(opt.impratio)
    to.gravity = [0.0] * 3 if is_disabled(model, "GRAVITY") else opt.gravity.tolist()
    to.is_elliptic = opt.cone == int(mujoco.mjtCone.mjCONE_ELLIPTIC)
    to.is_rk4 = opt.integrator == _RK4
    is_implicit = to.is_implicit_fast = opt.integrator == _IMPLICITFAST
    to.damps_implicitly = (is_implicit or not is_disabled(model, "EULERDAMP")) and not is_disabled(model, "DAMPER")
    to.keeps_references = not is_disabled(model, "REFSAFE")
    _add_bodies(to, model)
    _add_actuators(to, model)
    _add_equalities(to, model)
    _add_tendons(to, model)
    return to, _add_contacts(to, model)
