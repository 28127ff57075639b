#!/usr/bin/env python3
"""1024 of Gymnasium's Ants, driven by noise: environment steps per second, and the solver's share of the time.

    pip install "stiction[envs]"
    examples/python/02_thousand_ants.py [--envs 1024] [--steps 20] [--task Ant] [--tolerance 1e-4] [--threads 0]
"""

import argparse
import sys
import time

try:
    from stiction.envs import MujocoVectorEnv
except ImportError as error:
    print(f"NOT run, because this example needs gymnasium and mujoco: {error}")
    sys.exit(77)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--envs", type=int, default=1024)
    parser.add_argument("--steps", type=int, default=20)
    parser.add_argument("--task", default="Ant")
    parser.add_argument("--tolerance", type=float, default=1e-4)
    parser.add_argument("--threads", type=int, default=0, help="0: all cores")
    parser.add_argument("--solver", default="auto", help="'mujoco': MuJoCo's own")
    options = parser.parse_args()
    envs = MujocoVectorEnv(options.task, options.envs, tolerance=options.tolerance, threads=options.threads,
                           solver=options.solver)
    envs.reset(seed=0)
    envs.action_space.seed(0)
    envs.simulation.clear()
    start, cpu = time.perf_counter(), time.process_time()
    for _ in range(options.steps):
        envs.step(envs.action_space.sample())
    seconds, cpu = time.perf_counter() - start, time.process_time() - cpu
    spent = envs.simulation.seconds
    print(f"{options.envs} x {options.task}: {options.envs * options.steps / seconds:.0f} environment steps per second "
          f"({options.envs * options.steps * envs.task.frame_skip / seconds:.0f} time steps), "
          f"{options.envs * options.steps / cpu:.0f} per second of a core; "
          f"solver {100 * (spent['solve'] + spent['assemble']) / seconds:.0f} % of the time, "
          f"MuJoCo {100 * (spent['smooth'] + spent['advance']) / seconds:.0f} %")
    if options.solver != "mujoco":
        stats = envs.stats()
        print(f"{stats['environments']} systems solved, iterations {stats['iterations']}, residual {stats['residual']}")


if __name__ == "__main__":
    main()
