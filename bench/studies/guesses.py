#!/usr/bin/env python3
"""First guesses measured: sweeps at a tolerance and residuals at a budget, by candidate, on recorded and fresh steps.

    PYTHONPATH=build/python bench/studies/guesses.py [--csv FILE] [--only "NAME; NAME"] [--seeds 24] [--data ../shared/data]

Fresh trajectories are of worlds under random forces that last (an Ornstein-Uhlenbeck process), and of gymnasium's
MuJoCo models under a random policy that lasts. Tables learn from half of the seeds, the other half is measured. "off" are measured seeds with twice the force. Every way to start runs its own loop: what it starts from is
what it found in the step before. `nearest` is the solution of the learned step with the nearest b. `oracle` takes in
every step what turned out to need fewest sweeps. `last, auto` is another solver, of which seconds alone compare. Counts are deterministic; seconds are of one run, and only a hint.
Answers are judged by stiction.verify. Intervals: bootstrap over seeds of the mean saving against `last`.
"""

import argparse
import csv
import importlib.util
import os
import pathlib
import sys
import time
import types

import numpy as np

import stiction
from stiction.guess import Guess, Ridge

ROOT = pathlib.Path(__file__).resolve().parents[2]
SOLVER, TOLERANCES, BUDGET = "npgs", (1e-3, 1e-4, 1e-6), 10
WAYS = ("cold", "last 0.95", "last", "active_set", "ridge", "nearest", "guess", "guess + ridge")
COLUMNS = ["trajectory", "law", "seeds", "steps", "contacts", "tolerance", "way", "sweeps_mean", "sweeps_p50", "sweeps_p95",
           "unsolved", "residual_at_budget", "saved_mean", "saved_low", "saved_high", "seconds_solve", "seconds_guess",
           "taken"]


class Nearest:
    """The solution of the learned step of the same topology with the nearest b."""

    def __init__(self):
        self.known = {}

    def learn(self, step, lambda_, chosen):
        for key, envs, rows in step.groups():
            kept = self.known.setdefault(key, [])
            kept.extend((step.b[r], lambda_[r]) for env, r in zip(envs, rows) if chosen[env] and len(kept) < 3000)

    def freeze(self):
        self.known = {key: tuple(np.array(part) for part in zip(*kept)) for key, kept in self.known.items() if kept}

    def __call__(self, step):
        out = np.full_like(step.b, np.nan)
        for key, _, rows in step.groups():
            if key in self.known:
                b, lambda_ = self.known[key]
                for own in rows:
                    out[own] = lambda_[np.argmin(((b - step.b[own]) ** 2).sum(1))]
        return out


# -- where steps come from ------------------------------------------------------------------------------------------------


def problem(A, b, R, mu, lo, hi, kinds, dims, ids):
    return types.SimpleNamespace(A=A, b=b, R=R, mu=mu, lo=lo, hi=hi, kinds=kinds, dims=dims, ids=ids)


def batch_of(problems, law):
    """One step of all seeds, flat, and its ids."""
    join = lambda name: np.concatenate([getattr(p, name) for p in problems])
    offsets = np.concatenate([[0], np.cumsum([len(p.b) for p in problems])]).astype(np.int64)
    batch = stiction.Batch.from_delassus(np.concatenate([p.A.reshape(-1) for p in problems]), join("b"), offsets=offsets,
                                         kinds=join("kinds"), dims=join("dims"), mu=join("mu"), R=join("R"), lo=join("lo"),
                                         hi=join("hi"), law=law)
    return batch, join("ids")


def recorded(path, simulations):
    """Steps of a recording: lists of problems, one for each simulation."""
    batch = stiction.Batch.from_file(path)
    layout, arrays = batch.layout.integers, batch.arrays
    problems = []
    for env in range(len(batch)):
        rows = batch.rows_of(env)
        cones = slice(int(layout["env_cone_offsets"][env]), int(layout["env_cone_offsets"][env + 1]))
        n = rows.stop - rows.start
        A = np.zeros((n, n))
        for i in range(n):
            at = slice(int(arrays["row_offsets"][rows.start + i]), int(arrays["row_offsets"][rows.start + i + 1]))
            A[i, arrays["column"][at]] = arrays["A"][at]
        dims = np.diff(layout["cone_row_offsets"])[cones].astype(np.int64)
        ids = batch.extras["cone_id"][cones] if "cone_id" in batch.extras else np.arange(len(dims), dtype=np.uint64)
        problems.append(problem(A, *(np.array(arrays[name][rows]) for name in ("b", "R", "mu", "lo", "hi")),
                                np.array(layout["cone_kind"][cones]), dims, np.array(ids, np.uint64)))
    return batch.law, [problems[k:k + simulations] for k in range(0, len(problems), simulations)]


def of_contacts(world, contacts, env, twist, change):
    """The Delassus form of one environment's contacts (docs/bodies.md)."""
    at = slice(int(contacts.offsets[env]), int(contacts.offsets[env + 1]))
    count, bodies, dt = at.stop - at.start, len(world.bodies), world.dt
    _, erp, slop, cfm, threshold, *_ = world.stepping
    normal = contacts.normal[at]
    sign = np.where(normal[:, 2] < 0, -1.0, 1.0)
    a = -1 / (sign + normal[:, 2])
    b = normal[:, 0] * normal[:, 1] * a
    frame = np.stack([normal, np.stack([1 + sign * normal[:, 0] ** 2 * a, sign * b, -sign * normal[:, 0]], 1),
                      np.stack([b, sign + normal[:, 1] ** 2 * a, -normal[:, 1]], 1)], 1)
    J = np.zeros((3 * count, 6 * bodies))
    for c in range(count):
        for body, arm, side in ((contacts.body_a[at][c], contacts.arm_a[at][c], -1.0),
                                (contacts.body_b[at][c], contacts.arm_b[at][c], 1.0)):
            if body >= 0:
                J[3 * c:3 * c + 3, 6 * body:6 * body + 3] = side * frame[c]
                J[3 * c:3 * c + 3, 6 * body + 3:6 * body + 6] = side * np.cross(arm, frame[c])
    inverse = np.zeros((6 * bodies, 6 * bodies))
    for body in range(bodies):
        xx, xy, xz, yy, yz, zz = contacts.inv_inertia[env, body]
        k = 6 * body
        inverse[k:k + 3, k:k + 3] = contacts.inv_mass[env, body] * np.eye(3)
        inverse[k + 3:k + 6, k + 3:k + 6] = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]
    A, depth = J @ inverse @ J.T, contacts.depth[at]
    motion, before = J @ (twist[env] + change[env]).reshape(-1), (J @ twist[env].reshape(-1))[::3]
    wanted = np.where(depth >= 0, erp * np.maximum(depth - slop, 0) / dt, depth / dt)
    bounce = np.where((-before > threshold) & (depth + (-before) * dt >= 0), -contacts.restitution[at] * before, -np.inf)
    motion[::3] -= np.maximum(wanted, bounce)
    mu = np.zeros((count, 3))
    mu[:, 1:] = contacts.mu[at][:, None]
    zeros = np.zeros(3 * count)
    return problem((A + A.T) / 2, motion, np.full(3 * count, cfm / dt), mu.reshape(-1), zeros, zeros,
                   np.full(count, 3, np.uint8), np.full(count, 3, np.int64), contacts.id[at])


def world_steps(bodies, lasting, force, law, seeds, steps=150, skip=30):
    """A tower of boxes, pushed about by forces (and torques) that last for `lasting` seconds."""
    boxes = [stiction.Shape("box", (0.1, 0.1, 0.1), body=k, mu=0.5) for k in range(bodies)]
    solids = [stiction.Body.solid(box, 125.0, position=(0, 0, 0.1 + 0.2 * k)) for k, box in enumerate(boxes)]
    world = stiction.World(solids, [stiction.Shape("plane", mu=0.5), *boxes], len(seeds), law=law, cfm=2e-4,
                           tolerance=1e-9, max_iterations=20000)
    rngs, keep = [np.random.default_rng([17, seed]) for seed in seeds], np.exp(-world.dt / lasting)
    wrench, found = np.zeros((len(seeds), bodies, 6)), []
    mass, moment = solids[0].mass, solids[0].inertia[0]
    scale = force * 9.81 * mass * np.array([1, 1, 1, 0.05, 0.05, 0.05])
    for step in range(steps + skip):
        noise = np.stack([rng.normal(size=(bodies, 6)) for rng in rngs])
        wrench = keep * wrench + np.sqrt(1 - keep ** 2) * scale * noise
        twist = world.state().twist
        change = world.dt * wrench / np.array([mass] * 3 + [moment] * 3)
        change[:, :, 2] -= 9.81 * world.dt
        world.step(wrench)
        if step >= skip:
            contacts = world.contacts()
            found.append([of_contacts(world, contacts, env, twist, change) for env in range(len(seeds))])
    return found


def mujoco_steps(name, lasting, force, seeds, steps=150, skip=50):
    """A model of gymnasium under a policy that is noise which lasts, elliptic cones."""
    import gymnasium
    import mujoco
    spec = importlib.util.spec_from_file_location("record_mujoco", ROOT / "tools" / "record_mujoco.py")
    record = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(record)
    path = pathlib.Path(gymnasium.__file__).parent / "envs" / "mujoco" / "assets" / f"{name}.xml"
    model = mujoco.MjModel.from_xml_path(str(path))
    model.opt.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    keep, found = np.exp(-model.opt.timestep / lasting), [[] for _ in range(steps)]
    for seed in seeds:
        rng, data, observer = np.random.default_rng([23, seed]), mujoco.MjData(model), record.Observer(model)
        data.qvel[:] += 0.1 * rng.standard_normal(model.nv)
        action = np.zeros(model.nu)
        for step in range(steps + skip):
            action = keep * action + np.sqrt(1 - keep ** 2) * 0.4 * force * rng.normal(size=model.nu)
            data.ctrl[:] = np.clip(action, *model.actuator_ctrlrange.T)
            mujoco.mj_step(model, data)
            if step >= skip:
                snapshot = observer.look(model, data)
                kinds, dims, param = record.cones_of(model, snapshot)
                system, zeros = observer.system(), np.zeros(snapshot.nefc)
                box = np.repeat(kinds, dims) == 2
                found[step - skip].append(problem(
                    np.ascontiguousarray(system.A), system.b, system.R, np.where(box, 0, param), np.where(box, -param, zeros),
                    np.where(box, param, zeros), kinds, dims, record.cone_ids(snapshot)))
    return found


def trajectories(only, seeds, data):
    """(name, law, steps to learn from or None, steps to measure)."""
    train, test = np.arange(seeds // 2), np.arange(seeds // 2, seeds)
    wanted = lambda name: not only or name in only
    law, steps = recorded(ROOT / "examples" / "data" / "trajectory.h5", 4)
    for place, name in enumerate(("humanoid", "quadruped_rough", "hand_cube", "tower")):
        if wanted(name):
            yield name, law, None, [[step[place]] for step in steps]
    for name in ("stack5_mu05", "heap12_mu07"):
        path = pathlib.Path(data) / "sequences" / f"{name}.h5"
        if wanted(name) and path.exists():
            yield name, *recorded(path, 1)[:1], None, recorded(path, 1)[1]
    for law in ("convex", "coulomb"):
        for bodies, lasting in ((1, 0.01), (1, 0.25), (3, 0.01), (3, 0.25)):
            name = f"{bodies} box{'es' if bodies > 1 else ''}, {1000 * lasting:.0f} ms"
            if wanted(name):
                yield (name, law, world_steps(bodies, lasting, 0.15, law, train),
                       world_steps(bodies, lasting, 0.15, law, test))
            if wanted(name + ", off") and lasting == 0.25:
                yield (name + ", off", law, world_steps(bodies, lasting, 0.15, law, train),
                       world_steps(bodies, lasting, 0.3, law, test))
    for model in ("half_cheetah", "ant", "humanoid"):
        for suffix, force in (("", 1.0), (", off", 2.0)):
            if wanted(f"mujoco {model}{suffix}"):
                try:
                    yield (f"mujoco {model}{suffix}", "convex", mujoco_steps(model, 0.1, 1.0, train),
                           mujoco_steps(model, 0.1, force, test))
                except ImportError as error:
                    print(f"{model} is NOT measured: {error}", file=sys.stderr)


def processor():
    for line in pathlib.Path("/proc/cpuinfo").read_text().splitlines():
        if line.startswith("model name"):
            return line.split(":", 1)[1].strip()
    return "unknown"


# -- measuring --------------------------------------------------------------------------------------------------------------


def learn(steps, law):
    ridge, nearest = Ridge(samples=3.0, max_rows=150), Nearest()
    guess, solver = Guess(["zero", "active_set", ridge]), stiction.Solver(solver=SOLVER, tolerance=1e-8, max_iterations=20000,
                                                                         threads=1)
    for problems in steps or []:
        batch, ids = batch_of(problems, law)
        start = guess.start(batch, ids)
        step, solution = guess._step, solver.solve(batch, warm_start=start)
        nearest.learn(step, np.array(solution.lambda_), solution.solved)
        guess.remember(solution)
    ridge.freeze()
    nearest.freeze()
    return ridge, nearest


def make(way, ridge, nearest):
    return {"cold": lambda: Guess(["zero"]), "last 0.95": lambda: Guess(["last"], beta=0.95),
            "last": lambda: Guess(["last"]), "active_set": lambda: Guess(["active_set"]),
            "ridge": lambda: Guess([ridge]), "nearest": lambda: Guess([nearest]),
            "guess": lambda: Guess(["zero", "last", "active_set"]),
            "guess + ridge": lambda: Guess(["zero", "last", "active_set", ridge])}[way]()


def run(steps, law, guess, tolerance, iterations, method=SOLVER):
    """(sweeps (T, seeds), residuals judged (T, seeds), seconds of solves, seconds of guesses) of one loop."""
    solver = stiction.Solver(solver=method, tolerance=tolerance, max_iterations=iterations, threads=1)
    sweeps, residuals, solving, guessing = [], [], 0.0, 0.0
    for problems in steps:
        batch, ids = batch_of(problems, law)
        begin = time.perf_counter()
        start = guess.start(batch, ids)
        started = time.perf_counter()
        solution = solver.solve(batch, warm_start=start)
        solved = time.perf_counter()
        guess.remember(solution)
        guessing += started - begin + time.perf_counter() - solved
        solving += solved - started
        sweeps.append(solution.iterations.copy())
        residuals.append(stiction.verify(batch, solution)[:, 0])
    return np.array(sweeps)[1:], np.array(residuals)[1:], solving, guessing


def interval(saved):
    """Bootstrap over seeds of the mean saving: (mean, low, high) of 95 %."""
    per_seed = saved.mean(0)
    rng = np.random.default_rng(0)
    means = per_seed[rng.integers(len(per_seed), size=(2000, len(per_seed)))].mean(1)
    return per_seed.mean(), *np.quantile(means, (0.025, 0.975))


def measure(name, law, train, test):
    ridge, nearest = learn(train, law)
    ways = [way for way in WAYS if train or "ridge" not in way and way != "nearest"]
    budget = {way: np.mean(run(test, law, make(way, ridge, nearest), 0.0, BUDGET)[1]) for way in ways}
    contacts = np.mean([len(p.ids) for problems in test for p in problems])
    for tolerance in TOLERANCES:
        found = {}
        for way in ways:
            guess = make(way, ridge, nearest)
            found[way] = *run(test, law, guess, tolerance, 5000), guess.stats()["taken"]
        other = run(test, law, Guess(["last"]), tolerance, 5000, "auto")
        oracle = np.minimum.reduce([found[way][0] for way in ways])
        found["oracle"] = oracle, np.zeros_like(oracle, float), np.nan, np.nan, {}
        # Iterations of several methods, which are no sweeps: only its seconds can be compared.
        found["last, auto"] = np.zeros_like(oracle), *other[1:], {}
        for way, (sweeps, residuals, solving, guessing, taken) in found.items():
            mean, low, high = interval(found["last"][0] - sweeps)
            single = sweeps.shape[1] == 1
            yield {"trajectory": name, "law": law, "seeds": sweeps.shape[1], "steps": len(sweeps),
                   "contacts": f"{contacts:.1f}", "tolerance": f"{tolerance:.0e}", "way": way,
                   "sweeps_mean": f"{sweeps.mean():.1f}" if way != "last, auto" else "",
                   "sweeps_p50": f"{np.median(sweeps):.0f}" if way != "last, auto" else "",
                   "sweeps_p95": f"{np.quantile(sweeps, 0.95):.0f}" if way != "last, auto" else "",
                   "unsolved": int((residuals > 1.01 * tolerance).sum()) if way != "oracle" else "",
                   "residual_at_budget": f"{budget[way]:.2e}" if way in budget else "",
                   "saved_mean": f"{mean:.1f}" if way != "last, auto" else "",
                   "saved_low": "" if single or way == "last, auto" else f"{low:.1f}",
                   "saved_high": "" if single or way == "last, auto" else f"{high:.1f}",
                   "seconds_solve": "" if np.isnan(solving) else f"{solving:.3f}",
                   "seconds_guess": "" if np.isnan(guessing) else f"{guessing:.3f}",
                   "taken": " ".join(f"{key}:{count}" for key, count in taken.items())}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--csv", type=pathlib.Path)
    parser.add_argument("--only", default="")
    parser.add_argument("--seeds", type=int, default=24)
    parser.add_argument("--data", default=ROOT.parent / "shared" / "data")
    options = parser.parse_args()
    rows = []
    for trajectory in trajectories([name for name in options.only.split("; ") if name], options.seeds, options.data):
        for row in measure(*trajectory):
            rows.append(row)
            print("  ".join(str(row[name]) for name in COLUMNS[:15]), flush=True)
        if options.csv:
            with open(options.csv, "w", encoding="utf-8", newline="") as file:
                words = [pathlib.Path(word).name if word.startswith("/") else word for word in sys.argv[1:]]
                file.write(f"# bench/studies/guesses.py {' '.join(words)}\n# processor: {processor()}\n")
                file.write(f"# load average of a minute: {os.getloadavg()[0]:.2f}; seconds are of a busy machine\n")
                writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
                writer.writeheader()
                writer.writerows(rows)


if __name__ == "__main__":
    main()
