"""Batches for a learned choice of solver, of every family of recorded problems and scenes, and what may decide it."""

import pathlib
import subprocess

import numpy as np

import stiction

FOLDERS = ("mujoco", "coulomb", "lcp", "sequences")  # fclib/ has originals of what is in coulomb/
#: Scenes and sizes; `mixed` draws among the others, so it cannot be held out.
SCENES = {"stack": (3, 8, 20), "wall": (3, 6), "pyramid": (3,), "pile": (12, 40), "chain": (6, 24),
          "column": (20, 60), "grasp": (2, 4), "walker": (4, 8), "adversarial": (3, 8)}
ONE_FAMILY = {"22_humanoids": "humanoid", "drake_unsolved": "drake", "siconos_unsolved": "siconos"}
MOST_ENVS, MOST_ROWS, GROUPS = 16, 2000, 3
FEW_ENVS, FEW_ROWS = 32, 600  # fewer than both are repeated
FRICTION = 3

#: What is known of a case, in order. From `friction` on, numbers are read; from `condition` on, they are factored.
FEATURES = ("digits", "log2_rows", "log2_row_entries", "coulomb", "friction", "spread", "compliance", "depth", "mu",
            "asymmetry", "condition", "rank_share")


class Case:
    """Environments of like size of one source. `batch` has them so often that a call's own cost does not count."""

    def __init__(self, family, name, whole, envs):
        self.family, self.name, self.law = family, name, whole.law
        _, self.arrays = gather(whole, envs)
        self.count, rows = len(envs), len(self.arrays["b"])
        self.copies = max(1, min(FEW_ENVS // len(envs), FEW_ROWS // rows))
        self.batch, _ = gather(whole, np.tile(envs, self.copies))

    def judged(self):
        """What bench/arena/judge.py reads."""
        own = self.arrays
        return {"env_row_ptr": own["offsets"], "env_cone_ptr": own["env_cones"], "cone_kind": own["kinds"],
                "cone_row_ptr": np.append(0, np.cumsum(own["dims"])), "row_param": own["mu"], "row_lo": own["lo"],
                "row_hi": own["hi"], "A/ptr": own["indptr"], "A/col": own["indices"], "A/val": own["A"], "b": own["b"],
                "R": own["R"]}


def spans(offsets, picked):
    """Places of everything that belongs to the picked parts, one part behind the other."""
    return np.concatenate([np.arange(offsets[e], offsets[e + 1]) for e in picked]).astype(np.int64)


def gather(whole, envs):
    """(batch, its arrays) of some environments."""
    own = {name: np.asarray(array) for name, array in whole.arrays.items()}
    rows, cones = spans(own["env_row_offsets"], envs), spans(own["env_cone_offsets"], envs)
    entries = spans(own["row_offsets"], rows)
    sizes = np.diff(own["env_row_offsets"])[envs]
    parts = {"A": own["A"][entries], "b": own["b"][rows], "offsets": np.append(0, np.cumsum(sizes)).astype(np.int64),
             "indptr": np.append(0, np.cumsum(np.diff(own["row_offsets"])[rows])).astype(np.int64),
             "indices": own["column"][entries].astype(np.int32), "kinds": own["cone_kind"][cones],
             "dims": np.diff(own["cone_row_offsets"])[cones], "mu": own["mu"][rows], "R": own["R"][rows],
             "lo": own["lo"][rows], "hi": own["hi"][rows]}
    batch = stiction.Batch.from_delassus(law=whole.law, **parts)
    parts["env_cones"] = np.append(0, np.cumsum(np.diff(own["env_cone_offsets"])[envs]))
    return batch, parts


def grouped(family, name, whole):
    """Cases of a batch: its environments by size, in at most GROUPS groups of at most MOST_ENVS."""
    sizes = np.diff(np.asarray(whole.arrays["env_row_offsets"]))
    order = [env for env in np.argsort(sizes, kind="stable") if 0 < sizes[env] <= MOST_ROWS]
    for number, group in enumerate(np.array_split(order, min(GROUPS, -(-len(order) // 4)))):
        some = group[np.unique(np.linspace(0, len(group) - 1, MOST_ENVS).astype(int))]
        room = np.cumsum(sizes[some]) <= max(MOST_ROWS, sizes[some[0]])
        yield Case(family, f"{name}_{number}", whole, some[room])


def cases(data, stiction_program, folder):
    """Every case: of recorded files under `data`, then of scenes that the command line generates into `folder`."""
    for path in sorted(path for part in FOLDERS for path in (data / part).glob("*.h5")):
        yield from grouped(ONE_FAMILY.get(path.stem, path.stem), path.stem, stiction.Batch.from_file(path))
    for scene, sizes in SCENES.items():
        for size in sizes:
            path = pathlib.Path(folder) / f"{scene}_{size}.h5"
            subprocess.run([stiction_program, "generate", scene, "--envs", "16", "--seed", "2027", "--size", str(size),
                            "--quiet", "-o", str(path)], check=True)
            yield from list(grouped(scene, f"{scene}_{size}", stiction.Batch.from_file(path)))[:2]


def features(case, tolerance):
    """Numbers of FEATURES, over environments in the median."""
    each = np.array([of_environment(case, env) for env in range(case.count)])
    rows = np.diff(case.arrays["offsets"])
    extents = [-np.log10(tolerance), np.log2(rows.mean()), np.log2(len(case.arrays["A"]) / rows.sum()),
               case.law == "coulomb", FRICTION in case.arrays["kinds"]]
    return np.array([*extents, *np.median(each, axis=0)], float)


def of_environment(case, env):
    own = case.arrays
    rows = slice(own["offsets"][env], own["offsets"][env + 1])
    cones = slice(own["env_cones"][env], own["env_cones"][env + 1])
    n, dims = rows.stop - rows.start, own["dims"][cones]
    A = np.zeros((n, n))
    row_of = np.repeat(np.arange(n), np.diff(own["indptr"][rows.start:rows.stop + 1]))
    entries = slice(own["indptr"][rows.start], own["indptr"][rows.stop])
    np.add.at(A, (row_of, own["indices"][entries]), own["A"][entries])
    R, mu = own["R"][rows], own["mu"][rows]
    diagonal = np.diagonal(A) + R
    first = np.cumsum(dims) - dims
    normal = diagonal[first]
    spread = np.log10(normal.max() / normal.min()) if normal.min() > 0 else 16.0
    is_tangential = np.ones(n, bool)
    is_tangential[first] = False
    carries = ~is_tangential | (mu > 0)
    size = max(np.abs(diagonal).mean(), 1e-300)
    compliance = np.log10(max(R[carries].min() / size, 1e-16))
    asymmetry = np.log10(max(np.abs(A - A.T).max() / max(np.abs(A).max(), 1e-300), 1e-16))
    levels = depth(A, np.repeat(np.arange(len(dims)), dims), len(dims))
    return [spread, compliance, levels, mu.max(initial=0), asymmetry, *spectrum(A, R)]


def depth(A, cone_of_row, count):
    """log2 of the levels of a breadth-first search among cones that A couples, from an end of the first cone's part."""
    coupled = np.zeros((count, count), bool)
    np.logical_or.at(coupled, (cone_of_row[:, None], cone_of_row[None, :]), A != 0)
    begin, levels = 0, 0
    for _ in range(2):
        seen = np.zeros(count, bool)
        front, levels = np.arange(count) == begin, 0
        while front.any():
            seen |= front
            begin, levels = int(np.flatnonzero(front)[-1]), levels + 1
            front = coupled[front].any(axis=0) & ~seen
    return np.log2(levels)


def spectrum(A, R):
    """log10 condition of A + R scaled to a unit diagonal, on its range, and rank over rows. NaN beyond 1100 rows."""
    n = len(R)
    if n > 1100:
        return [np.nan, np.nan]
    B = 0.5 * (A + A.T) + np.diag(R)
    scale = 1 / np.sqrt(np.maximum(np.diagonal(B), 1e-300))
    values = np.linalg.eigvalsh(B * scale[:, None] * scale)
    kept = values[values > 1e-9 * values[-1]]
    return [np.log10(kept[-1] / kept[0]), len(kept) / n] if len(kept) else [np.nan, 0.0]
