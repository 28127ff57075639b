"""Steps an MJCF model in lanes from the shell, to see whether it can be and how fast. docs/howto/robots_in_lanes.md.

    stiction step robot.xml --envs 4096 --steps 1000 --dtype float32
    python -m stiction.mujoco step robot.xml
"""

import argparse
import pathlib
import sys
import time

import mujoco
import numpy as np

from . import BatchedSimulation

_CHUNK = 16          # steps with one control
_LINE_SECONDS = 1.0  # between two lines of progress


def _parser(program):
    parser = argparse.ArgumentParser(prog=program, description="Steps MuJoCo models in lanes.")
    step = parser.add_subparsers(dest="command", required=True).add_parser(
        "step", help="steps many simulations of a model", description="Steps many simulations of a model in lanes. Their "
        "velocities begin at random, and controls are drawn from their ranges, or from -1..1, every 16 steps.")
    step.add_argument("model", type=pathlib.Path, help="an MJCF file")
    step.add_argument("--envs", type=int, default=1024, help="simulations")
    step.add_argument("--steps", type=int, default=1000)
    step.add_argument("--dtype", choices=["float64", "float32"], default="float64")
    step.add_argument("--threads", type=int, default=0, help="0: all cores")
    step.add_argument("--device", default="cpu", help="cpu, cuda or cuda:1")
    step.add_argument("--tolerance", type=float, help="default: 1e-6, and 1e-4 in float32")
    step.add_argument("--seed", type=int, default=0, help="of velocities and controls")
    return parser


def _model(path):
    if not path.is_file():
        raise ValueError("expected an MJCF file, found none")
    return mujoco.MjModel.from_xml_path(str(path))


def _control_ranges(model):
    limited = model.actuator_ctrllimited.astype(bool)[:, None]
    return np.where(limited, model.actuator_ctrlrange, (-1.0, 1.0)).T


def _step_all(simulation, steps, rng):
    """Makes all steps. Returns seconds of the steps alone, and the share of solves, the last of each chunk, that met the
    tolerance."""
    low, high = _control_ranges(simulation.model)
    seconds, done, solved, told = 0.0, 0, [], time.monotonic()
    while done < steps:
        count = min(_CHUNK, steps - done)
        simulation.ctrl[:] = rng.uniform(low, high, simulation.ctrl.shape)
        start = time.perf_counter()
        simulation.step(nstep=count)
        seconds += time.perf_counter() - start
        done += count
        solved.append(simulation.solved.mean())
        if time.monotonic() - told > _LINE_SECONDS or done == steps:
            told = time.monotonic()
            print(f"\rstep {done} of {steps}", end="" if done < steps else "\n", file=sys.stderr, flush=True)
    return seconds, float(np.mean(solved))


def main(arguments=None, program="python -m stiction.mujoco") -> int:
    """The command, of a program of that name. Returns the exit status: 1 if a simulation failed, 2 for bad input."""
    options = _parser(program).parse_args(arguments)
    try:
        if options.steps < 1:
            raise ValueError(f"--steps: expected at least 1, got {options.steps}")
        if options.seed < 0:
            raise ValueError(f"--seed: expected at least 0, got {options.seed}")
        model = _model(options.model)
        simulation = BatchedSimulation(model, options.envs, engine="lanes", dtype=options.dtype, threads=options.threads,
                                       tolerance=options.tolerance, device=options.device)
    except (MemoryError, OSError, ValueError, RuntimeError) as error:
        print(f"{program.split()[-1]}: {options.model}: {' '.join(str(error).split())}", file=sys.stderr)
        return 2
    rng = np.random.default_rng(options.seed)
    simulation.qvel[:] = 0.1 * rng.standard_normal(simulation.qvel.shape)
    seconds, solved = _step_all(simulation, options.steps, rng)
    failed = len(simulation.failed)
    print(f"{options.model.name}: {options.envs} simulations, {options.steps} steps, {options.dtype}")
    print(f"steps/s   {options.envs * options.steps / seconds:.0f}")
    print(f"solved    {100 * solved:.2f} %")
    print(f"failed    {failed}")
    print(f"hash      {simulation.hash():016x}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
