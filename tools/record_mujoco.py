#!/usr/bin/env python3
"""Record contact systems from running MuJoCo simulations as a contact-batch file.

    record_mujoco.py MODEL.xml -o OUT.h5 --envs 64 --seed 1 --steps 400 --every 40 --perturb 0.1
    record_mujoco.py MODEL.xml MODEL.xml -o OUT.h5 --trajectory 40 --skip 200

Simulations start from the model's first state (or a keyframe) disturbed by --perturb, and run under random control
with elliptic friction cones. Every --every steps the constraint system of that instant becomes one environment of the
file. With it goes MuJoCo's own solution at a tight tolerance. With --trajectory, consecutive steps of one simulation
of each model are recorded, step by step, with ids by which a contact is found again. Everything that is random comes
from --seed: the same command writes the same bytes. docs/howto/recording.md explains the numbers.

Exit status: 0 written; 1 written, but with fewer environments than asked for (the reason is printed); 2 bad
input or usage, with one sentence. Needs numpy, h5py and mujoco >= 3 (tools/requirements.txt).
"""
import argparse
import copy
import sys
from collections import Counter
from dataclasses import fields
from pathlib import Path

import h5py
import mujoco
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))
import check_law  # noqa: E402
from contact_batch import BOX, FREE, FRICTION, UNILATERAL, System, write  # noqa: E402

# Types of rows from this one on are contacts.
CONTACT = int(mujoco.mjtConstraint.mjCNSTR_CONTACT_FRICTIONLESS)

# A simulation is given up after this many without a single recordable instant.
FRUITLESS_SIMULATIONS = 20

# Newton restarts from its own answer at most this often: each restart factors the Hessian anew, which removes the
# rounding its rank-one updates have gathered.
REFERENCE_RESTARTS = 5

BAD_STATE = (mujoco.mjtWarning.mjWARN_BADQPOS, mujoco.mjtWarning.mjWARN_BADQVEL, mujoco.mjtWarning.mjWARN_BADQACC,
             mujoco.mjtWarning.mjWARN_CONTACTFULL, mujoco.mjtWarning.mjWARN_CNSTRFULL)


class RecordError(Exception):
    """Bad input or usage; the message is one sentence for the user."""


def reference_model(model):
    """The model with MuJoCo's Newton solver as tight as it goes, and a dense Jacobian to read."""
    tight = copy.copy(model)
    tight.opt.solver = mujoco.mjtSolver.mjSOL_NEWTON
    tight.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    tight.opt.tolerance = 1e-15
    tight.opt.ls_tolerance = 1e-10
    tight.opt.iterations = 500
    tight.opt.ls_iterations = 500
    tight.opt.noslip_iterations = 0  # a post-processing step that leaves the optimum
    return tight


def cones_of(model, data):
    """Cone kinds, their numbers of rows, and row_param, in the order of MuJoCo's constraint rows."""
    kinds, rows, param = [], [], np.zeros(data.nefc)
    one_row = {
        mujoco.mjtConstraint.mjCNSTR_EQUALITY: FREE,
        mujoco.mjtConstraint.mjCNSTR_FRICTION_DOF: BOX,
        mujoco.mjtConstraint.mjCNSTR_FRICTION_TENDON: BOX,
        mujoco.mjtConstraint.mjCNSTR_LIMIT_JOINT: UNILATERAL,
        mujoco.mjtConstraint.mjCNSTR_LIMIT_TENDON: UNILATERAL,
        mujoco.mjtConstraint.mjCNSTR_CONTACT_FRICTIONLESS: UNILATERAL,
    }
    row = 0
    while row < data.nefc:
        kind, size = one_row.get(mujoco.mjtConstraint(data.efc_type[row]), FRICTION), 1
        if kind == FRICTION:
            contact = data.contact[data.efc_id[row]]
            size = contact.dim
            param[row + 1:row + size] = contact.friction[:size - 1]  # two tangents, spin, two rolls
        elif kind == BOX:
            param[row] = data.efc_frictionloss[row]
        kinds.append(kind)
        rows.append(size)
        row += size
    return np.array(kinds, np.uint8), np.array(rows, np.int64), param


def cone_ids(data):
    """A number for each cone, the same as long as the constraint lasts. It is made of its kind, its object or pair of
    geoms, and which of those that they share it is, in MuJoCo's order."""
    ids, shared, row = [], Counter(), 0
    while row < data.nefc:
        kind, objects, size = int(data.efc_type[row]), (int(data.efc_id[row]), 0), 1
        if kind >= CONTACT:
            contact = data.contact[data.efc_id[row]]
            kind, size = CONTACT, contact.dim
            objects = tuple(int(geom) + 1 for geom in contact.geom)  # 0: something without geoms
        number = shared[kind, objects]
        shared[kind, objects] += 1
        if max(objects) >= 1 << 20 or number >= 1 << 16:
            raise RecordError(f"ids have room for 2^20 geoms and 2^16 contacts of a pair, not for {objects}, {number}")
        ids.append(kind << 56 | objects[0] << 36 | objects[1] << 16 | number)
        row += size
    return np.array(ids, np.uint64)


def solve_tightly(tight, data):
    """MuJoCo's own solution at data's state, restarted from its answer until that no longer changes."""
    mujoco.mj_forward(tight, data)
    for _ in range(REFERENCE_RESTARTS):
        before = data.qacc.copy()
        data.qacc_warmstart[:] = before
        mujoco.mj_forward(tight, data)
        if np.array_equal(before, data.qacc):
            break


def extract(tight, data):
    """The constraint system that data holds after solve_tightly()."""
    n, nv = data.nefc, tight.nv
    J = np.array(data.efc_J).reshape(n, nv)
    minv_jt = np.zeros((n, nv))
    if n:
        mujoco.mj_solveM(tight, data, minv_jt, np.ascontiguousarray(J))
    # einsum without a path never calls a BLAS, so neither its threads nor its kernels reach the file.
    A = np.einsum("ik,jk->ij", J, minv_jt)
    M = np.zeros((nv, nv))
    for i, unit in enumerate(np.eye(nv)):
        mujoco.mj_mulM(tight, data, M[i], unit)
    kinds, rows, param = cones_of(tight, data)
    v_free, target = data.qacc_smooth.copy(), data.efc_aref.copy()
    return System(cone_kind=kinds, cone_rows=rows, row_param=param, A=0.5 * (A + A.T),
                  b=np.einsum("ik,k->i", J, v_free) - target, R=data.efc_R.copy(), J=J, M=0.5 * (M + M.T),
                  v_free=v_free, row_target=target, lambda_ref=data.efc_force.copy(), v_ref=data.qacc.copy())


def random_control(model, rng, scale):
    """Uniform over the middle `scale` of each actuator's range; [-1, 1] where none is given."""
    limited = model.actuator_ctrllimited.astype(bool)
    low = np.where(limited, model.actuator_ctrlrange[:, 0], -1.0)
    high = np.where(limited, model.actuator_ctrlrange[:, 1], 1.0)
    return 0.5 * (low + high) + 0.5 * scale * (high - low) * rng.uniform(-1, 1, model.nu)


def start_state(model, data, keyframe, rng, sigma):
    if keyframe is None:
        mujoco.mj_resetData(model, data)
    else:
        mujoco.mj_resetDataKeyframe(model, data, keyframe)
    mujoco.mj_integratePos(model, data.qpos, sigma * rng.standard_normal(model.nv), 1.0)
    data.qvel[:] += sigma * rng.standard_normal(model.nv)


def advance(model, data, options, rng, step):
    """Step number `step` under the chosen control. False: the simulation blew up or lost contacts, and later states
    are not physics."""
    if options.control == "random" and (step - 1) % options.hold == 0:
        data.ctrl[:] = random_control(model, rng, options.control_scale)
    mujoco.mj_step(model, data)
    return not any(data.warning[int(w)].number for w in BAD_STATE)


class Observer:
    """Solves the constraint system of a simulation's present state without disturbing it."""

    def __init__(self, model):
        self.tight = reference_model(model)
        self.snapshot = mujoco.MjData(self.tight)
        self.state = np.zeros(mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_INTEGRATION))

    def look(self, model, data):
        mujoco.mj_getState(model, data, self.state, mujoco.mjtState.mjSTATE_INTEGRATION)
        mujoco.mj_setState(self.tight, self.snapshot, self.state, mujoco.mjtState.mjSTATE_INTEGRATION)
        solve_tightly(self.tight, self.snapshot)
        return self.snapshot

    def system(self):
        """Returns the result of look(), or None if it is not finite."""
        system = extract(self.tight, self.snapshot)
        return system if all(np.isfinite(getattr(system, f.name)).all() for f in fields(system)) else None


def instants(model, options, keyframe):
    """Systems at the chosen instants of one simulation after another, without end unless nothing touches."""
    data, observer = mujoco.MjData(model), Observer(model)
    fruitless, simulation = 0, 0
    while fruitless < FRUITLESS_SIMULATIONS:
        rng = np.random.default_rng([options.seed, simulation])
        start_state(model, data, keyframe, rng, options.perturb)
        phase, found = int(rng.integers(options.every)), False
        for step in range(1, options.steps + 1):
            if not advance(model, data, options, rng, step):
                break
            if step % options.every == phase and observer.look(model, data).nefc > 0:
                system = observer.system()
                if system is not None:
                    found = True
                    yield system
        fruitless = 0 if found else fruitless + 1
        simulation += 1


def record(model, options, keyframe=None):
    """Up to options.envs systems, and the reason (or None) why there are fewer."""
    systems, budget = [], options.max_mb * 1e6
    for system in instants(model, options, keyframe):
        budget -= system.stored_bytes()
        if budget < 0:
            return systems, f"--max-mb {options.max_mb:g} is used up"
        systems.append(system)
        if len(systems) == options.envs:
            return systems, None
    return systems, f"{FRUITLESS_SIMULATIONS} simulations in a row had no instant with constraints"


def trajectory(name, model, options, keyframe, simulation):
    """Consecutive steps of one simulation as (system, cone ids), those without constraints included."""
    data, observer, steps = mujoco.MjData(model), Observer(model), []
    rng = np.random.default_rng([options.seed, simulation])
    start_state(model, data, keyframe, rng, options.perturb)
    for step in range(1, options.skip + options.trajectory + 1):
        if not advance(model, data, options, rng, step):
            raise RecordError(f"{name}: the simulation became unstable in step {step}; record fewer or disturb it less")
        if step > options.skip:
            ids = cone_ids(observer.look(model, data))
            system = observer.system()
            if system is None:
                raise RecordError(f"{name}: numbers that are not finite in step {step}")
            steps.append((system, ids))
    return steps


def record_trajectories(options):
    """The systems of all models' trajectories, step by step, and datasets about them."""
    models = [load(path, options.keyframe, alone=len(options.model) == 1) for path in options.model]
    names = [Path(path).stem for path in options.model]
    runs = [trajectory(names[i], model, options, keyframe, i) for i, (model, keyframe) in enumerate(models)]
    taken = [moment for moments in zip(*runs) for moment in moments]
    count = options.trajectory
    extra = {"step": np.repeat(np.arange(count, dtype=np.int64), len(models)),
             "dt": np.tile([model.opt.timestep for model, _ in models], count),
             "cone_id": np.concatenate([ids for _, ids in taken]),
             "env_name": names * count}
    return [system for system, _ in taken], extra


def parse(arguments):
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("model", metavar="MODEL.xml", nargs="+", help="MJCF or URDF model; several with --trajectory")
    parser.add_argument("-o", "--output", required=True, metavar="OUT.h5")
    parser.add_argument("--envs", type=int, default=64, help="instants to record (default 64)")
    parser.add_argument("--seed", type=int, default=0, help="source of everything random (default 0)")
    parser.add_argument("--steps", type=int, default=400, help="steps of each simulation (default 400)")
    parser.add_argument("--every", type=int, default=40, help="steps between instants (default 40)")
    parser.add_argument("--trajectory", type=int, metavar="N", default=0,
                        help="record N consecutive steps of each model instead of single instants")
    parser.add_argument("--skip", type=int, default=0, help="steps before a trajectory begins (default 0)")
    parser.add_argument("--keyframe", help="start from this keyframe (name or number) instead of the model's pose")
    parser.add_argument("--perturb", type=float, default=0.0, metavar="SIGMA",
                        help="deviation of the start state's positions [m, rad] and velocities [m/s, rad/s]")
    parser.add_argument("--control", choices=("random", "zero"), default="random")
    parser.add_argument("--control-scale", type=float, default=1.0, help="part of the control range used (default 1)")
    parser.add_argument("--hold", type=int, default=20, help="steps a random control is held (default 20)")
    parser.add_argument("--max-mb", type=float, default=64.0, help="stop before the arrays exceed this (default 64 MB)")
    options = parser.parse_args(arguments)
    for name, least in (("envs", 1), ("seed", 0), ("steps", 1), ("every", 1), ("hold", 1), ("perturb", 0),
                        ("trajectory", 0), ("skip", 0)):
        if not getattr(options, name) >= least:
            parser.error(f"--{name} is {getattr(options, name)}, it must be at least {least}")
    if options.every > options.steps:
        parser.error(f"--every {options.every} is more than --steps {options.steps}: no instant would be recorded")
    if len(options.model) > 1 and not options.trajectory:
        parser.error("several models are recorded together only with --trajectory")
    return options


def load(path, keyframe, alone=True):
    """The model with elliptic cones, and the keyframe's number; of several models, those that have no keyframes start
    from their first state. \\throws RecordError."""
    try:
        model = mujoco.MjModel.from_xml_path(path)
    except ValueError as error:
        raise RecordError(f"{path}: MuJoCo cannot read this model: {' '.join(str(error).split())}") from error
    if model.nv == 0:
        raise RecordError(f"{path}: nothing in this model can move; give some body a joint")
    model.opt.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    model.opt.impratio = 1.0
    if keyframe is None or (model.nkey == 0 and not alone):
        return model, None
    number = int(keyframe) if keyframe.isdigit() else mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_KEY, keyframe)
    if not 0 <= number < model.nkey:
        known = ", ".join(model.key(i).name or str(i) for i in range(model.nkey)) or "none"
        raise RecordError(f"--keyframe {keyframe} is not in the model; there are: {known}")
    return model, number


def summary(path, systems):
    rows = [len(s.b) for s in systems]
    with h5py.File(path) as file:
        worst = check_law.residuals(file, file["lambda_ref"][:])
    cones = np.bincount(np.concatenate([s.cone_kind for s in systems]), minlength=4)
    counts = ", ".join(f"{n} {k}" for k, n in zip(("free", "unilateral", "box", "friction"), cones) if n)
    return (f"{path}: {len(systems)} environments, rows min {min(rows)} median {np.median(rows):g} max {max(rows)}; "
            f"{counts}; reference residual median {np.median(worst):.1e} max {worst.max():.1e}; "
            f"{Path(path).stat().st_size} bytes")


def main(arguments=None):
    options = parse(arguments)
    try:
        shortfall, extra = None, None
        if options.trajectory:
            systems, extra = record_trajectories(options)
        else:
            model, keyframe = load(options.model[0], options.keyframe)
            systems, shortfall = record(model, options, keyframe)
        if not systems:
            raise RecordError(f"nothing was recorded: {shortfall}")
        names = ", ".join(Path(path).stem for path in options.model)
        write(options.output, systems, f"MuJoCo {mujoco.__version__}, {names}", extra)
    except (RecordError, OSError) as error:
        print(f"record_mujoco: {error}", file=sys.stderr)
        return 2
    print(summary(options.output, systems))
    if shortfall:
        print(f"record_mujoco: {len(systems)} of {options.envs} environments: {shortfall}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
