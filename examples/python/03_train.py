#!/usr/bin/env python3
"""A policy learns to move: PPO of Stable-Baselines3, 32 environments with stiction's contacts, minutes on two cores.

    examples/python/03_train.py [--task HalfCheetah] [--engine lanes] [--steps 300000] [--csv FILE] [--picture FILE.png]
"""

import argparse

import training


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--task", default="HalfCheetah")
    parser.add_argument("--engine", choices=["mujoco", "lanes"], default="mujoco")
    parser.add_argument("--steps", type=int, default=300_000)
    parser.add_argument("--envs", type=int, default=32)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--csv", help="where the curve is written")
    parser.add_argument("--picture", help="where it is drawn (matplotlib)")
    options = parser.parse_args()
    rows, model, normalised = training.train(options.task, options.steps, options.envs, options.seed, engine=options.engine)
    print(f"return of the policy without exploration: {training.evaluate(options.task, model, normalised):.0f}")
    reward, steps = training.evaluate_in_gymnasium(options.task, model, normalised)
    print(f"in Gymnasium's own environment: {reward:.0f}, {steps:.0f} steps until an end")
    if options.csv:
        training.write(options.csv, rows)
    if options.picture:
        import matplotlib

        matplotlib.use("Agg")
        from matplotlib import pyplot

        figure, axes = pyplot.subplots(figsize=(6, 3.5))
        axes.plot([row["steps"] for row in rows], [row["return_per_1000_steps"] for row in rows])
        axes.set(xlabel="environment steps", ylabel="reward per 1000 steps",
                 title=f"PPO, {options.task}, {options.envs} environments, engine {options.engine}")
        axes.grid(alpha=0.3)
        figure.tight_layout()
        figure.savefig(options.picture, dpi=110)


if __name__ == "__main__":
    main()
