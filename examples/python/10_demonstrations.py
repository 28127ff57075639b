#!/usr/bin/env python3
"""Four things that hold here, each shown by a scene that others' users have reported.

    pip install "stiction[mujoco]" matplotlib
    examples/python/10_demonstrations.py [--only slide grip permutation nan] [--pictures FOLDER]

slide: a cube with 6 m/s along the ground; the convex law lifts it, Coulomb's does not.
grip: two pads hold a capsule far below the friction limit; with regularised friction it creeps, here it sticks.
permutation: environment i replayed as environment j gives the same bits.
nan: one NaN among 4096 simulations harms no other one, is named, and that one is held at its last good state.
--pictures writes demo_slide.png and demo_grip.png. docs/explanation/demonstrations.md has its output.
"""

import argparse
import pathlib
import sys

import numpy as np

try:
    import mujoco
except ImportError as error:
    print(f"NOT run, because this example needs mujoco: {error}")
    sys.exit(77)

import stiction
from stiction.mujoco import BatchedSimulation
from stiction.testing import assert_permutation_invariant

SLIDE = """<mujoco><option timestep="0.002" cone="elliptic" solver="Newton" jacobian="dense"/><worldbody>
  <geom type="plane" size="20 20 1" friction="0.5"/>
  <body pos="0 0 0.05"><freejoint/><geom type="box" size=".05 .05 .05" friction="0.5" density="1000"/></body>
</worldbody></mujoco>"""

# The capsule of github.com/google-deepmind/mujoco/issues/3328: 45 g between pads that two position drives press on it.
GRIP = """<mujoco><option timestep="0.002" cone="elliptic" solver="Newton" impratio="10" jacobian="dense"/>
<default><geom friction="0.7" condim="3"/></default><worldbody>
  <body name="left" pos="-0.014 0 0.3"><joint name="l" type="slide" axis="1 0 0" damping="20"/>
    <geom type="box" size=".01 .03 .03" mass=".2"/></body>
  <body name="right" pos="0.014 0 0.3"><joint name="r" type="slide" axis="-1 0 0" damping="20"/>
    <geom type="box" size=".01 .03 .03" mass=".2"/></body>
  <body name="capsule" pos="0 0 0.3"><freejoint/><geom type="capsule" size=".004 .02" euler="90 0 0" mass=".045"/></body>
</worldbody><contact><exclude body1="left" body2="right"/></contact>
<actuator><position joint="l" kp="15000"/><position joint="r" kp="15000"/></actuator></mujoco>"""
SQUEEZE = 0.002  # [m] past first contact


class RigidStep:
    """Steps a MuJoCo model whose contacts are rigid: MuJoCo finds contacts and forces, stiction the velocities after
    the step by the law asked for. The model may have contacts with elliptic cones, and no other constraint."""

    def __init__(self, model, law, tolerance=1e-10):
        self.model, self.law = model, law
        self.solver = stiction.Solver(tolerance=tolerance, max_iterations=100000)
        self.residuals = []

    def __call__(self, data):
        model, dt = self.model, self.model.opt.timestep
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        mujoco.mj_fwdActuation(model, data)
        mujoco.mj_fwdAcceleration(model, data)
        M = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, M)
        force = M @ data.qacc_smooth
        M += dt * np.diag(model.dof_damping)  # implicit, as MuJoCo's Euler has it
        v = data.qvel + dt * np.linalg.solve(M, force)
        contacts = [data.contact[i] for i in range(data.ncon) if data.contact[i].efc_address >= 0]
        if contacts:
            J = data.efc_J.reshape(-1, model.nv)
            rows = np.concatenate([contact.efc_address + np.arange(3) for contact in contacts])
            target = np.zeros(len(rows))
            target[::3] = [-min(contact.dist, 0.1) / dt if contact.dist > 0 else -0.2 * contact.dist / dt
                           for contact in contacts]
            mu = np.concatenate([[0, *contact.friction[:2]] for contact in contacts])
            batch = stiction.Batch.from_jacobian([J[rows]], [M], [v], [target], mu=[mu], law=self.law)
            solution = self.solver.solve(batch)
            if not solution.solved.all():
                raise RuntimeError(f"not solved: {solution.status}")
            self.residuals.append(float(stiction.verify(batch, solution)[0, 0]))
            v = np.asarray(solution.velocities).reshape(-1)
        data.qvel[:] = v
        mujoco.mj_integratePos(model, data.qpos, data.qvel, dt)
        data.time += dt


def rigid_model(xml):
    """Returns that model with contacts found before they touch, so that nothing need penetrate."""
    model = mujoco.MjModel.from_xml_string(xml)
    model.geom_margin[:] = 0.005
    return model


# -- slide ------------------------------------------------------------------------------------------------------------

def slide(seconds=1.0, speed=6.0):
    """{solver: (times, heights of the cube's centre above its rest [m], largest residual)}"""
    found = {}
    for name in ("MuJoCo, elliptic", "stiction, convex", "stiction, coulomb"):
        model = mujoco.MjModel.from_xml_string(SLIDE) if name.startswith("MuJoCo") else rigid_model(SLIDE)
        data = mujoco.MjData(model)
        data.qvel[0] = speed
        step = RigidStep(model, name.split()[-1]) if name.startswith("stiction") else None
        times, heights = [], []
        for _ in range(round(seconds / model.opt.timestep)):
            step(data) if step else mujoco.mj_step(model, data)
            times.append(data.time)
            heights.append(data.qpos[2] - 0.05)
        found[name] = np.array(times), np.array(heights), max(step.residuals) if step else None
        found[name + " x"] = data.qpos[0]
    return found


# -- grip -------------------------------------------------------------------------------------------------------------

def grip(seconds=4.0):
    """{solver: (times, drop of the capsule [m], its rate over the second half [m/s], normal load [N], residual)}"""
    cases = {"MuJoCo, impratio 1": dict(impratio=1), "MuJoCo, impratio 10": dict(impratio=10),
             "MuJoCo, impratio 10, noslip 10": dict(impratio=10, noslip_iterations=10), "stiction, coulomb": {}}
    found = {}
    for name, options in cases.items():
        rigid = name.startswith("stiction")
        model = rigid_model(GRIP) if rigid else mujoco.MjModel.from_xml_string(GRIP)
        for option, value in options.items():
            setattr(model.opt, option, value)
        gravity = model.opt.gravity.copy()
        data = mujoco.MjData(model)
        step = RigidStep(model, "coulomb") if rigid else None
        times, drops = [], []
        for k in range(round((seconds + 0.5) / model.opt.timestep)):
            closing = k * model.opt.timestep < 0.5  # the pads close on the capsule before it has weight
            model.opt.gravity[:] = 0 if closing else gravity
            data.ctrl[:] = SQUEEZE
            step(data) if step else mujoco.mj_step(model, data)
            if not closing:
                times.append(data.time - 0.5)
                drops.append(0.3 - data.qpos[4])
        times, drops = np.array(times), np.array(drops)
        half = len(times) // 2
        load = abs(data.actuator_force[0])
        found[name] = (times, drops, (drops[-1] - drops[half]) / (times[-1] - times[half]), load,
                       max(step.residuals) if step else None)
    return found


# -- permutation and NaN ----------------------------------------------------------------------------------------------

def permutation(count=8, steps=200):
    """Asserts it for rollouts of the cube; returns how many there were, and of how many steps."""
    model = mujoco.MjModel.from_xml_string(SLIDE)

    def rollout(seeds):
        simulation = BatchedSimulation(model, len(seeds), tolerance=1e-8)
        for seed, data in zip(seeds, simulation.data):
            data.qvel[:] = np.random.default_rng(seed).normal(size=6) * 3
        simulation.step(nstep=steps)
        return [(data.qpos, data.qvel) for data in simulation.data]

    assert_permutation_invariant(rollout, range(count))
    return count, steps


def one_nan(count=4096, bad=1234):
    """(index reported, simulations whose bits differ from a run without it, whether the bad one is held)"""
    model = mujoco.MjModel.from_xml_string(SLIDE)
    datas = [mujoco.MjData(model) for _ in range(count)]

    def run(poison):
        for i, data in enumerate(datas):
            mujoco.mj_resetData(model, data)
            data.qvel[:3] = np.random.default_rng(i).normal(size=3)
        simulation = BatchedSimulation(model, datas, hold_failed=True)
        simulation.step(nstep=3)
        before = datas[bad].qpos.copy()
        if poison:
            datas[bad].qvel[2] = np.nan
        simulation.step()
        failed = simulation.failed.tolist()
        held = np.array_equal(datas[bad].qpos, before)
        simulation.step()
        return np.array([[*data.qpos, *data.qvel] for data in datas]), failed, held

    clean, _, _ = run(poison=False)
    dirty, failed, held = run(poison=True)
    differ = [i for i in range(count) if clean[i].tobytes() != dirty[i].tobytes()]
    return failed, [i for i in differ if i != bad], held


# -- telling and drawing ----------------------------------------------------------------------------------------------

def tell_slide(found):
    for name in [name for name in found if not name.endswith(" x")]:
        _, heights, residual = found[name]
        note = "" if residual is None else f"; largest residual {residual:.0e}"
        print(f"slide  {name:18s} rises {1e3 * heights.max():8.3f} mm, slides {found[name + ' x']:.2f} m{note}")


def tell_grip(found):
    for name, (_, drops, rate, load, residual) in found.items():
        note = "" if residual is None else f"; largest residual {residual:.0e}"
        print(f"grip   {name:31s} creeps {1e6 * rate:10.4g} um/s under {load:.1f} N, 2 mu N / m g = "
              f"{2 * 0.7 * load / (0.045 * 9.81):.0f}{note}")


def draw(folder, slides, grips):
    import matplotlib
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    colours = ("tab:orange", "tab:red", "tab:purple", "tab:blue")
    if slides:
        figure, axis = plt.subplots(figsize=(7, 3.6), layout="constrained")
        for (name, line), colour in zip([(n, s) for n, s in slides.items() if not n.endswith(" x")],
                                        (colours[0], colours[1], colours[3])):
            axis.plot(line[0], 1e3 * line[1], label=name, color=colour)
        axis.set(xlabel="time [s]", ylabel="height above rest [mm]",
                 title="A cube of 0.1 m with 6 m/s along the ground, mu 0.5")
        axis.legend()
        axis.grid(alpha=0.3)
        figure.savefig(folder / "demo_slide.png", dpi=110)
    if grips:
        figure, axis = plt.subplots(figsize=(7, 3.6), layout="constrained")
        for (name, line), colour in zip(grips.items(), colours):
            axis.plot(line[0], 1e6 * np.abs(line[1]), label=name, color=colour)
        axis.set_yscale("symlog", linthresh=0.1)
        axis.set(xlabel="time [s]", ylabel="drop [um]", ylim=(-0.02, None),
                 title="A capsule of 45 g in a grip, far below the friction limit")
        axis.legend()
        axis.grid(alpha=0.3)
        figure.savefig(folder / "demo_grip.png", dpi=110)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="*", choices=("slide", "grip", "permutation", "nan"))
    parser.add_argument("--envs", type=int, default=4096, help="of the demonstration nan")
    parser.add_argument("--pictures", type=pathlib.Path)
    options = parser.parse_args()
    chosen = options.only or ("slide", "grip", "permutation", "nan")
    slides = slide() if "slide" in chosen else None
    grips = grip() if "grip" in chosen else None
    if slides:
        tell_slide(slides)
    if grips:
        tell_grip(grips)
    if "permutation" in chosen:
        count, steps = permutation()
        print(f"permutation  {count} rollouts of {steps} steps: reversed, shuffled, halved, alone and twice over, the same "
              "bits")
    if "nan" in chosen:
        failed, differ, held = one_nan(options.envs, bad=options.envs // 3)
        print(f"nan    of {options.envs} simulations failed {failed}, others that differ: {differ}, held: {held}")
    if options.pictures:
        draw(options.pictures, slides, grips)


if __name__ == "__main__":
    main()
