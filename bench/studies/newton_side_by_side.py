#!/usr/bin/env python3
"""stiction and Newton's own solvers on models like those of Newton's examples, one world each, on the CPU.

    PYTHONPATH=build/python bench/studies/newton_side_by_side.py [--only SCENE ...] [--solvers NAME ...] [-o FOLDER]

Needs newton and, for SolverMuJoCo, what `pip install "newton[sim]"` brings. Each scene is stepped for its time by each
solver, with the same step. "mujoco" is MuJoCo's C implementation, which finds contacts of its own. After each step
Newton's collision pipeline finds the contacts anew, and the table has the deepest penetration. It has the fastest body
in the last tenth of a second, and how far bodies moved in the second half. Each scene has a sign of success of its
own. Of stiction also the residuals: its own, and that of the judge shared/tools/check_solution.py where it is at hand.
Writes FOLDER/newton_side_by_side.csv.
"""

import argparse
import csv
import importlib.util
import math
import pathlib

import newton
import newton.examples
import numpy as np
import warp as wp

from stiction.monitor import Progress
from stiction.newton import SolverStiction

JUDGE = pathlib.Path(__file__).resolve().parents[3] / "shared" / "tools" / "check_solution.py"


def turn(axis, angle):
    return wp.quat_from_axis_angle(wp.vec3(*axis), float(angle))


# -- scenes: builder -> (step [s], time [s], sign of success) ----------------------------------------------------------

def humanoid(builder):
    """nv_humanoid falls limp on the ground; its motors get no signal."""
    builder.default_shape_cfg.mu = 0.75
    builder.default_joint_cfg.armature = 0.01
    builder.add_mjcf(newton.examples.get_asset("nv_humanoid.xml"), ignore_names=["floor", "ground"],
                     xform=wp.transform((0, 0, 1.3), wp.quat_identity()), enable_self_collisions=False)
    builder.add_ground_plane()
    return 0.002, 3.0, ("height of the torso [m]", lambda state: state.body_q.numpy()[0, 2])


def quadruped(builder):
    """Newton's quadruped stands by its drives."""
    builder.default_joint_cfg.armature = 0.01
    builder.default_joint_cfg.target_ke, builder.default_joint_cfg.target_kd = 2000.0, 1.0
    builder.default_shape_cfg.mu = 1.0
    builder.add_urdf(newton.examples.get_asset("quadruped.urdf"), floating=True, enable_self_collisions=False,
                     xform=wp.transform((0, 0, 0.7), wp.quat_identity()), ignore_inertial_definitions=True,
                     joint_damping_mode="drive")
    for body in range(builder.body_count):
        builder.body_inertia[body] = wp.mat33(np.array(builder.body_inertia[body]).reshape(3, 3) + 0.01 * np.eye(3))
    builder.joint_q[-12:] = [0.2, 0.4, -0.6, -0.2, -0.4, 0.6, -0.2, 0.4, -0.6, 0.2, -0.4, 0.6]
    builder.joint_target_q[-12:] = builder.joint_q[-12:]
    builder.add_ground_plane()
    return 1 / 600, 3.0, ("height of the trunk [m]", lambda state: state.body_q.numpy()[0, 2])


def cartpole(builder):
    """Newton's cart with two poles, without drives or contacts: energy is kept."""
    builder.default_shape_cfg.density = 100.0
    builder.default_joint_cfg.armature = 0.1
    builder.default_joint_cfg.target_ke = builder.default_joint_cfg.target_kd = 0.0
    builder.add_urdf(newton.examples.get_asset("cartpole.urdf"), floating=False, enable_self_collisions=False,
                     joint_damping_mode="drive")
    for shape in range(builder.shape_count):
        builder.shape_flags[shape] &= ~newton.ShapeFlags.COLLIDE_SHAPES
    for d in range(len(builder.joint_target_ke)):
        builder.joint_target_ke[d] = builder.joint_target_kd[d] = builder.joint_friction[d] = 0.0
        builder.joint_damping[d] = 0.0
    builder.joint_q[-3:] = [0.0, 0.3, 0.0]
    return 1 / 600, 3.0, ("energy at the end [J]", None)


def stack(builder):
    """Five cubes of 0.2 m on each other."""
    builder.default_shape_cfg.mu = 0.5
    builder.add_ground_plane()
    for level in range(5):
        body = builder.add_body(xform=wp.transform((0, 0, 0.1 + 0.2 * level), wp.quat_identity()))
        builder.add_shape_box(body, hx=0.1, hy=0.1, hz=0.1)
    return 1 / 240, 3.0, ("lean of the top cube [m]", lambda state: float(np.hypot(*state.body_q.numpy()[4, :2])))


def gripper(builder):
    """Two fingers on slides press a cube of 0.5 kg with 10 N each and hold it: 0.5 g is below 2 mu 10 N."""
    builder.default_shape_cfg.mu = 0.5
    builder.default_shape_cfg.density = 1000.0
    fingers = []
    for side in (-1, 1):
        finger = builder.add_link(mass=0.0)
        builder.add_shape_box(finger, hx=0.01, hy=0.04, hz=0.04)
        joint = builder.add_joint_prismatic(-1, finger, axis=(1, 0, 0), friction=0.0, armature=0.0,
                                            parent_xform=wp.transform((0.051 * side, 0, 1), wp.quat_identity()),
                                            actuator_mode=newton.JointTargetMode.EFFORT)
        builder.add_articulation([joint])
        builder.joint_f[-1] = -10.0 * side
        fingers.append(finger)
    cube = builder.add_body(xform=wp.transform((0, 0, 1), wp.quat_identity()))
    cfg = builder.default_shape_cfg.copy()
    cfg.density = 0.5 / 0.08 ** 3
    builder.add_shape_box(cube, hx=0.04, hy=0.04, hz=0.04, cfg=cfg)
    return 1 / 240, 3.0, ("drop of the cube [mm]", lambda state: 1e3 * (1 - state.body_q.numpy()[cube, 2]))


def pile(builder):
    """Fifteen cubes, balls and capsules fall into a heap."""
    rng = np.random.default_rng(2)
    builder.default_shape_cfg.mu = 0.6
    builder.add_ground_plane()
    for i in range(15):
        place = (*rng.uniform(-0.08, 0.08, 2), 0.2 + 0.22 * i)
        body = builder.add_body(xform=wp.transform(place, turn(rng.normal(size=3), rng.uniform(0, 3))))
        if i % 3 == 0:
            builder.add_shape_box(body, hx=0.08, hy=0.08, hz=0.08)
        elif i % 3 == 1:
            builder.add_shape_sphere(body, radius=0.08)
        else:
            builder.add_shape_capsule(body, radius=0.06, half_height=0.08)
    return 1 / 240, 3.0, ("lowest centre [m]", lambda state: float(state.body_q.numpy()[:, 2].min()))


SCENES = (humanoid, quadruped, cartpole, stack, gripper, pile)


# -- solvers ----------------------------------------------------------------------------------------------------------

def mujoco(model):
    return newton.solvers.SolverMuJoCo(model, use_mujoco_cpu=True, cone="elliptic", iterations=100, ls_iterations=50)


SOLVERS = {
    "stiction coulomb": lambda model: SolverStiction(model, law="coulomb", ignore=("mujoco:actuator",)),
    "stiction convex": lambda model: SolverStiction(model, law="convex", ignore=("mujoco:actuator",)),
    "mujoco": mujoco,
    "xpbd": lambda model: newton.solvers.SolverXPBD(model, iterations=20),
    "featherstone": lambda model: newton.solvers.SolverFeatherstone(model, angular_damping=0.0),
}


def judged(batch, solution):
    """The residual that the judge finds; it takes A as a matrix, so it is made of J and M's factor here."""
    if not JUDGE.exists() or not batch.rows:
        return math.nan
    spec = importlib.util.spec_from_file_location("check_solution", JUDGE)
    judge = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(judge)
    arrays = batch.arrays
    rows, dofs = batch.rows, len(arrays["v_free"])
    J = np.zeros((rows, dofs))
    row = np.repeat(np.arange(rows), np.diff(arrays["indptr"]))
    J[row, arrays["indices"]] = arrays["J"]
    block = batch.mass_block or dofs
    factor = np.zeros((dofs, dofs))
    for k, piece in enumerate(arrays["M"].reshape(-1, block, block)):
        factor[k * block:(k + 1) * block, k * block:(k + 1) * block] = np.tril(piece)
    half = np.linalg.solve(factor, J.T)
    A = half.T @ half
    cones = batch.layout.integers["cone_row_offsets"]
    problem = {"env_row_ptr": np.array([0, rows]), "env_cone_ptr": np.array([0, len(arrays["kinds"])]),
               "cone_kind": arrays["kinds"], "cone_row_ptr": cones, "row_param": arrays["mu"] + arrays["hi"],
               "b": J @ arrays["v_free"] - arrays["target"], "R": np.zeros(rows),
               "A/ptr": np.arange(rows + 1) * rows, "A/col": np.tile(np.arange(rows), rows), "A/val": A.reshape(-1)}
    return float(judge.residuals(problem, solution.lambda_, batch.law)[0])


def deepest(state, contacts, model):
    """Deepest penetration among the contacts [m]."""
    count = int(contacts.rigid_contact_count.numpy()[0])
    if not count:
        return 0.0
    poses = np.vstack([state.body_q.numpy(), [0, 0, 0, 0, 0, 0, 1]])
    bodies = model.shape_body.numpy()
    points = []
    for shape, point in ((contacts.rigid_contact_shape0, contacts.rigid_contact_point0),
                         (contacts.rigid_contact_shape1, contacts.rigid_contact_point1)):
        pose = poses[bodies[shape.numpy()[:count]]].astype(float)
        x, v, w = point.numpy()[:count].astype(float), pose[:, 3:6], pose[:, 6:]
        points.append(pose[:, :3] + x + 2 * np.cross(v, np.cross(v, x) + w * x))
    margins = contacts.rigid_contact_margin0.numpy()[:count] + contacts.rigid_contact_margin1.numpy()[:count]
    gap = ((points[1] - points[0]) * contacts.rigid_contact_normal.numpy()[:count]).sum(axis=1) - margins
    return max(0.0, -float(gap.min()))


def energy(model, state):
    """Kinetic and potential energy [J], with armature."""
    H = newton.eval_mass_matrix(model, state).numpy().astype(float)
    v = state.joint_qd.numpy().astype(float)
    total = 0.5 * v @ H[0, :len(v), :len(v)] @ v
    for mass, com, pose in zip(model.body_mass.numpy(), model.body_com.numpy(), state.body_q.numpy()):
        total += 9.81 * mass * wp.transform_point(wp.transform(*pose), wp.vec3(*com))[2]
    return float(total)


def run(scene, name):
    """One row of the table."""
    builder = newton.ModelBuilder()
    dt, time, (sign, seen) = scene(builder)
    model = builder.finalize(device="cpu")
    solver = SOLVERS[name](model)
    state, other, control = model.state(), model.state(), model.control()
    pipeline = newton.CollisionPipeline(model, contact_matching="latest")
    contacts = pipeline.contacts()
    newton.eval_fk(model, state.joint_q, state.joint_qd, state)
    if seen is None:
        start = energy(model, state)
        seen = lambda state: energy(model, state) - start  # noqa: E731
        sign = "energy gained [J]"
    steps, depth, speed, half = round(time / dt), 0.0, 0.0, None
    own, other_judge, missed = [], [], 0
    for k in range(steps):
        state.clear_forces()
        pipeline.collide(state, contacts)
        solver.step(state, other, control, contacts, dt)
        state, other = other, state
        if name in ("xpbd",):  # maximal coordinates: joints are read back
            newton.eval_ik(model, state, state.joint_q, state.joint_qd)
        if not np.isfinite(state.body_q.numpy()).all():
            return {"scene": scene.__name__, "solver": name, "sign": sign, "failed at [s]": k * dt}
        pipeline.collide(state, contacts)
        depth = max(depth, deepest(state, contacts, model))
        if k >= steps - round(0.1 / dt):
            speed = max(speed, float(np.linalg.norm(state.body_qd.numpy()[:, :3], axis=1).max()))
        if k == steps // 2:
            half = state.body_q.numpy()[:, :3].copy()
        if isinstance(solver, SolverStiction):
            own.append(float(solver.status["residual"][0]))
            missed += int(solver.status["code"][0] != 0)
            if k % 20 == 0:
                other_judge.append(judged(solver.batch, solver.solution))
    found = {"scene": scene.__name__, "solver": name, "deepest [mm]": 1e3 * depth, "speed at the end [m/s]": speed,
             "moved in the second half [mm]": 1e3 * float(np.abs(state.body_q.numpy()[:, :3] - half).max()),
             "sign": sign, "value": float(seen(state))}
    if own:
        found |= {"residual, largest": max(own), "judged, largest": np.nanmax(other_judge) if rows_seen(other_judge)
                  else math.nan, "unsolved steps": missed, "steps": steps}
    return found


def rows_seen(values):
    return np.isfinite(values).any()


COLUMNS = ("scene", "solver", "deepest [mm]", "speed at the end [m/s]", "moved in the second half [mm]", "sign", "value",
           "failed at [s]", "residual, largest", "judged, largest", "unsolved steps", "steps")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", nargs="*", help="scenes")
    parser.add_argument("--solvers", nargs="*", help="solvers")
    parser.add_argument("-o", "--folder", type=pathlib.Path)
    options = parser.parse_args()
    wp.config.quiet = True
    chosen = [(scene, name) for scene in SCENES for name in SOLVERS
              if (not options.only or scene.__name__ in options.only) and (not options.solvers or name in options.solvers)]
    rows, bar = [], Progress(chosen, title="side by side", unit="run")
    for scene, name in bar:
        try:
            row = run(scene, name)
        except (ValueError, RuntimeError, ImportError, NotImplementedError) as error:
            row = {"scene": scene.__name__, "solver": name, "sign": f"{type(error).__name__}: {error}"[:200]}
        rows.append(row)
        bar.print(str({key: (f"{value:.3g}" if isinstance(value, float) else value) for key, value in row.items()}))
    if options.folder:
        options.folder.mkdir(parents=True, exist_ok=True)
        with open(options.folder / "newton_side_by_side.csv", "w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, COLUMNS)
            writer.writeheader()
            writer.writerows(rows)


if __name__ == "__main__":
    main()
