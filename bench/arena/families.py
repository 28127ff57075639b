"""Problems to solve: recorded files, generated scenes, and the same scenes of a seed drawn at run time."""

import dataclasses
import pathlib
import subprocess
import sys

import h5py
import numpy as np
from batch_file import take
from judge import BOX_FRICTION, FRICTION, UNILATERAL, law_of

FOLDERS = ("mujoco", "coulomb", "lcp", "sequences", "fclib")
SIZES = {"stack": 4, "wall": 3, "pyramid": 2, "pile": 30, "chain": 12, "column": 20, "grasp": 0, "walker": 0, "mixed": 40,
         "adversarial": 4}
BOXED_SIZES = {"stack": 4, "wall": 2, "pyramid": 2, "pile": 20}  # of the family `boxed`: few enough rows for dense solvers
QUICK_SIZES = {"stack": 2, "column": 8, "walker": 0}
SEED = 7  # of the family `generated`


@dataclasses.dataclass
class Problems:
    """A set of environments of one file, under the law that the file names."""

    family: str
    name: str
    path: pathlib.Path

    def __post_init__(self):
        with h5py.File(self.path) as batch:
            self.law = law_of(batch)
            self.offsets = batch["env_row_ptr"][:]
            self.kinds = batch["cone_kind"][:]
            self.has_jacobian = "env_dof_ptr" in batch and "J" in batch and "M" in batch and "v_free" in batch
            self.has_compliance = bool((batch["R"][:] > 0).all())

    @property
    def key(self):
        return f"{self.family}/{self.name}"

    @property
    def environments(self):
        return len(self.offsets) - 1

    @property
    def rows(self):
        return int(self.offsets[-1])

    @property
    def largest(self):
        return int(np.diff(self.offsets).max(initial=0))

    @property
    def has_friction(self):
        return bool(np.isin(self.kinds, (FRICTION, BOX_FRICTION)).any())

    @property
    def is_boxed(self):
        return bool((self.kinds == BOX_FRICTION).any())

    @property
    def laws(self):
        """The law, or that both are the same, or that friction is boxed."""
        return "boxed" if self.is_boxed else self.law if self.has_friction else "either"

    @property
    def is_pushed(self):
        """Returns true if every cone pushes and does not pull, with boxed friction or with none."""
        return bool(np.isin(self.kinds, (UNILATERAL, BOX_FRICTION)).all())


def say(message):
    print(message, file=sys.stderr, flush=True)


def spread(count, most):
    """At most that many indices, evenly spread."""
    return np.arange(count) if count <= most else np.unique(np.linspace(0, count - 1, most).round().astype(int))


class Sets:
    """All problem sets of a run, written below `folder` as FAMILY/NAME.h5."""

    def __init__(self, program, folder, most):
        self.program, self.folder, self.most = str(program), pathlib.Path(folder), most

    def _place(self, family, name):
        path = self.folder / family / f"{name}.h5"
        path.parent.mkdir(parents=True, exist_ok=True)
        return path

    def _cut(self, family, name, source):
        with h5py.File(source) as batch:
            count = len(batch["env_row_ptr"]) - 1
        return Problems(family, name, take(source, spread(count, self.most), self._place(family, name)))

    def recorded(self, data, quick):
        """Families under `data`; one that is not there is named aloud. Quick: one small file of each."""
        for family in FOLDERS:
            found = sorted([*pathlib.Path(data, family).glob("*.h5"), *pathlib.Path(data, family).glob("*.hdf5")])
            if not found:
                say(f"SKIPPED family {family}: no files in {pathlib.Path(data, family)}")
            if quick:
                found = sorted((path for path in found if "unsolved" not in path.stem), key=lambda path: path.stat().st_size)[:1]
            for path in found:
                source = path
                if path.suffix == ".hdf5":
                    source = self._place("converted", path.stem)
                    done = subprocess.run([self.program, "convert", str(path), str(source)], capture_output=True, text=True)
                    if done.returncode:
                        say(f"SKIPPED {family}/{path.stem}: {done.stderr.strip()}")
                        continue
                yield self._cut(family, path.stem, source)

    def scenes(self, family, seed, sizes, *more):
        for scene, size in sizes.items():
            source = self._place("whole", f"{family}_{scene}")
            subprocess.run([self.program, "generate", scene, "--size", str(size), "--envs", str(self.most), "--seed", str(seed),
                            "-o", str(source), "--quiet", *more], check=True)
            yield self._cut(family, scene, source)

    def all(self, data, seed, quick):
        yield from self.recorded(data, quick)
        yield from self.scenes("generated", SEED, QUICK_SIZES if quick else SIZES)
        yield from self.scenes("boxed", SEED, {"stack": 2} if quick else BOXED_SIZES, "--box-friction")
        yield from self.scenes("hidden", seed, {"stack": 2} if quick else SIZES)
