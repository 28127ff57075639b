"""Environments over the processes of a training job, as torchrun, srun or mpirun start them. docs/howto/clusters.md.

    shard = stiction.distributed.Shard.per_rank(256)       # this process's 256 of all environments
    envs = stiction.envs.MujocoVectorEnv("Ant", shard=shard)
    envs.reset(seed=1)                                     # the same seed on every rank

An environment has a global id. Its results follow from the seed, its id and its actions, bit for bit, whichever rank
has it and however many ranks there are. Nothing is sent between ranks inside a step. Gathered data, statistics and
moved environments, go through the caller's process group.
"""

import contextlib
import dataclasses
import hashlib
import os
import pathlib
import struct
import sys
import zipfile

import numpy as np

from .core.arguments import not_negative, whole

__all__ = ["Ranks", "Shard", "digest", "exchange", "gather", "generator", "load", "merge_stats", "ranks", "rebalance", "save"]

#: Launchers, and where they write a process's rank, their number, and its number on its machine. torchrun and
#: mpirun come first: they start processes inside a step of Slurm, whose own variables then count machines.
_LAUNCHERS = (("torchrun", "RANK", "WORLD_SIZE", "LOCAL_RANK"),
              ("mpirun", "OMPI_COMM_WORLD_RANK", "OMPI_COMM_WORLD_SIZE", "OMPI_COMM_WORLD_LOCAL_RANK"),
              ("mpiexec", "PMI_RANK", "PMI_SIZE", "MPI_LOCALRANKID"),
              ("srun", "SLURM_PROCID", "SLURM_STEP_NUM_TASKS", "SLURM_LOCALID"))


@dataclasses.dataclass(frozen=True)
class Ranks:
    """This process among those of its job. rank: 0 .. size - 1. local_rank: among those of its machine, for choosing a
    GPU. launcher: "torchrun", "mpirun", "mpiexec", "srun", or "" for a process by itself."""

    rank: int = 0
    size: int = 1
    local_rank: int = 0
    launcher: str = ""

    def __post_init__(self):
        if not 0 <= self.rank < self.size:
            raise ValueError(f"rank: expected a number from 0 to below the number of ranks, {self.size}, got {self.rank}")

    @property
    def is_first(self):
        """True if this is rank 0, which logs and writes shared files once."""
        return self.rank == 0


def ranks(environment=os.environ):
    """The Ranks that a launcher's variables name; rank 0 of 1 where there is none.

    A Slurm batch script itself is rank 0 of 1: only processes started by srun have a step's number of tasks. Raises
    ValueError where a variable is missing or not a number.
    """
    for launcher, *names in _LAUNCHERS:
        found = [environment.get(name) for name in names]
        if launcher == "srun" and found[1] is None:
            continue
        if found[0] is None and found[1] is None:
            continue
        numbers = []
        for name, text in zip(names, found):
            if text is None and name is names[2]:
                text = "0"
            if text is None or not text.isdecimal():
                raise ValueError(f"{name}: expected {launcher}'s number, got {text!r}")
            numbers.append(int(text))
        return Ranks(*numbers, launcher)
    return Ranks()


@dataclasses.dataclass(frozen=True)
class Shard:
    """The environments of one rank: those with global ids begin .. end - 1 of `total`. Made by per_rank, split or of."""

    begin: int
    end: int
    total: int

    def __post_init__(self):
        for name in ("begin", "end", "total"):
            whole(f"shard.{name}", getattr(self, name), 2**63 - 1)
        if not 0 <= self.begin < self.end <= self.total:
            raise ValueError(f"shard: expected 0 <= begin < end <= total, got {self.begin}, {self.end}, {self.total}: "
                             "every rank has an environment")

    @classmethod
    def per_rank(cls, num_envs, job=None):
        """num_envs on each rank, rank by rank. job: Ranks; None: ranks()."""
        job = ranks() if job is None else job
        return cls(job.rank * num_envs, (job.rank + 1) * num_envs, job.size * num_envs)

    @classmethod
    def split(cls, total, job=None):
        """`total` environments over all ranks, as evenly as can be; the first ranks have one more."""
        job = ranks() if job is None else job
        total = whole("total", total, 2**63 - 1)
        return cls.of([total * rank // job.size for rank in range(job.size + 1)], job)

    @classmethod
    def of(cls, offsets, job=None):
        """By offsets (size + 1,): rank r has ids offsets[r] .. offsets[r + 1] - 1."""
        job = ranks() if job is None else job
        if len(offsets) != job.size + 1 or offsets[0] != 0:
            raise ValueError(f"offsets: expected {job.size + 1} that begin at 0, got {list(offsets)}")
        return cls(*(whole("offsets", offsets[place], 2**63 - 1) for place in (job.rank, job.rank + 1, -1)))

    @property
    def num_envs(self):
        """Number of environments of this rank."""
        return self.end - self.begin

    @property
    def ids(self):
        """Global ids, int64 (num_envs,)."""
        return np.arange(self.begin, self.end, dtype=np.int64)


def generator(seed, env, episode):
    """Random numbers of an episode of an environment, by global id: a numpy.random.Generator.

    Philox counts instead of keeping a state (Salmon et al. 2011, "Parallel random numbers: as easy as 1, 2, 3"). Its key
    is the seed and the id, the upper half of its counter the episode. No two episodes hence share a number, and which
    they are depends on nothing else.
    """
    return np.random.Generator(np.random.Philox(key=np.array([seed, env], np.uint64),
                                                counter=np.array([0, 0, episode, 0], np.uint64)))


# -- through the caller's process group -------------------------------------------------------------------------------


def gather(value, group=None):
    """A picklable value of every rank, in a list by rank, on every rank.

    group: a communicator of mpi4py, a group of torch.distributed, or None: torch.distributed's default group where it
    is initialised, else this process alone. Raises RuntimeError for a process of several without a group.
    """
    if hasattr(group, "allgather"):
        return group.allgather(value)
    torch = _torch_distributed()
    if torch is None:
        if group is not None:
            raise TypeError(f"group: expected a communicator of mpi4py or a group of torch.distributed, got {group!r}")
        if ranks().size > 1:
            raise RuntimeError(f"group: this is one process of {ranks().size}: call torch.distributed."
                               "init_process_group() first, or pass mpi4py's MPI.COMM_WORLD")
        return [value]
    values = [None] * torch.get_world_size(group)
    torch.all_gather_object(values, value, group)
    return values


def _torch_distributed():
    """torch.distributed where the caller has initialised it."""
    torch = sys.modules.get("torch.distributed")
    return torch if torch is not None and torch.is_available() and torch.is_initialized() else None


def merge_stats(all_stats):
    """Solver.stats() of all ranks as one: counts are added, seconds and quantiles are the largest of any rank's.

        stats = merge_stats(gather(envs.stats()))
    """
    merged = {}
    for stats in all_stats:
        for name, value in stats.items():
            if not isinstance(value, dict):
                merged[name] = max(merged.get(name, 0.0), value) if name == "seconds" else merged.get(name, 0) + value
                continue
            entries = merged.setdefault(name, {})
            for key, one in value.items():
                is_quantile = name in ("iterations", "residual")
                entries[key] = max(entries.get(key, 0.0), one) if is_quantile else entries.get(key, 0) + one
    return merged


def rebalance(offsets, seconds, most=0.05):
    """Offsets by which every rank would take as long, from each one's time for its present environments.

    offsets: of Shard.of. seconds: by rank, as gather() collects them. No offset moves by more than `most` of a rank's
    mean number of environments (or by one), and every rank keeps one at least. The same on every rank, which calls it
    with the same numbers. For the end of an episode: exchange() then moves the environments.
    """
    counts = np.diff(offsets)
    total, size = int(offsets[-1]), len(counts)
    if len(seconds) != size or not (np.asarray(seconds) > 0).all() or not np.isfinite(seconds).all():
        raise ValueError(f"seconds: expected {size} positive finite numbers, got {list(seconds)}")
    most = not_negative("most", most)
    cost = np.concatenate([[0.0], np.cumsum(np.asarray(seconds, float))])
    wanted = np.interp(np.linspace(0.0, cost[-1], size + 1), cost, offsets)
    step = max(1, int(most * total / size))
    moved = [0]
    for k in range(1, size):
        near = min(max(round(float(wanted[k])), int(offsets[k]) - step), int(offsets[k]) + step)
        moved.append(min(max(near, moved[-1] + 1), total - (size - k)))
    return [*moved, total]


def exchange(states, shard, group=None):
    """The states of `shard`'s environments, from those that every rank has: MujocoVectorEnv.states() before and after a
    range moved. Every rank calls it; environments that stay are not sent."""
    ids = states["id"]
    stays = (shard.begin <= ids) & (ids < shard.end)
    parts = [_rows(states, stays), *gather(_rows(states, ~stays), group)]
    return _chosen(parts, shard)


def _rows(states, mask):
    return {name: array[mask] for name, array in states.items()}


def _chosen(parts, shard):
    """State of a shard, in the order of ids."""
    joined = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    ids, first = np.unique(joined["id"], return_index=True)  # of one that is there twice, the first
    own = (shard.begin <= ids) & (ids < shard.end)
    if not np.array_equal(ids[own], shard.ids):
        lacking = sorted(set(shard.ids.tolist()) - set(ids.tolist()))
        raise ValueError(f"states: expected those of environments {shard.begin}..{shard.end - 1}, got none of {lacking[:5]}")
    return _rows(joined, first[own])


def digest(states):
    """Hash of states: an integer below 2^64. The digest of all environments is the sum of the ranks', modulo 2^64,
    however they are distributed: sum(gather(digest(states))) % 2**64."""
    total = 0
    for row, env in enumerate(states["id"]):
        seen = hashlib.blake2b(int(env).to_bytes(8, "little"), digest_size=8)
        for name in sorted(states):
            seen.update(name.encode() + np.ascontiguousarray(states[name][row]).tobytes())
        total += int.from_bytes(seen.digest(), "little")
    return total % 2**64


# -- checkpoints ------------------------------------------------------------------------------------------------------


def save(folder, step, states, shard, keep=2):
    """Writes this rank's part of a checkpoint: FOLDER/step_000000120/000000000_000000256.npz. Every rank calls it.

    The file is complete or not there: it is written beside, forced to disk and renamed. A rank's files of checkpoints
    before the last `keep` complete ones are removed. Raises ValueError for a step below 0, and for states that are not
    those of the shard, which load() would not find again.
    """
    if step < 0:
        raise ValueError(f"step: expected at least 0, got {step}")
    if not np.array_equal(states.get("id", ()), shard.ids):
        raise ValueError(f"states: expected 'id' to be {shard.begin}..{shard.end - 1}, as in the shard, got "
                         f"{states.get('id')}")
    place = pathlib.Path(folder) / f"step_{step:09d}"
    place.mkdir(parents=True, exist_ok=True)
    path = place / f"{shard.begin:09d}_{shard.end:09d}.npz"
    beside = path.with_suffix(f".{os.getpid()}.tmp")
    with open(beside, "wb") as file:
        np.savez(file, total=shard.total, **states)
        file.flush()
        os.fsync(file.fileno())
    os.replace(beside, path)
    complete = [one for one in _steps(folder) if _covers(one)]
    for old in _steps(folder):
        if len(complete) < keep or _number_of(old) >= _number_of(complete[-keep]):
            break
        for own in _parts(old):
            begin, end = _range_of(own)
            if shard.begin <= begin < shard.end or begin <= shard.begin < end:
                own.unlink(missing_ok=True)
        with contextlib.suppress(OSError):  # other ranks' files may still be there
            old.rmdir()


def load(folder, shard):
    """The number of the last complete checkpoint's step, and the states of a shard's environments there, however many
    ranks wrote it. None and None where there is none. Raises ValueError for a file that is damaged, or of another
    number of environments."""
    complete = [place for place in _steps(folder) if _covers(place)]
    if not complete:
        return None, None
    parts = []
    # A step may have been written twice, by other numbers of ranks: the newer one counts.
    for path in sorted(_parts(complete[-1]), key=lambda path: -path.stat().st_mtime_ns):
        begin, end = _range_of(path)
        if end <= shard.begin or begin >= shard.end:
            continue
        part = _read(path)
        if part.pop("total") != shard.total:
            raise ValueError(f"{path}: expected {shard.total} environments in all, as this job has")
        parts.append(part)
    if not parts:
        raise ValueError(f"{complete[-1]}: expected {shard.total} environments in all, as this job has")
    return _number_of(complete[-1]), _chosen(parts, shard)


def _steps(folder):
    """Folders of checkpoints by step; names stop being in that order where a number has ten digits."""
    return sorted((place for place in pathlib.Path(folder).glob("step_*") if place.name[5:].isdecimal()), key=_number_of)


def _number_of(place):
    return int(place.name[5:])


def _parts(place):
    """Files of save() in a checkpoint's folder; others there are not looked at."""
    return [path for path in place.glob("*_*.npz") if path.stem.replace("_", "", 1).isdecimal()]


def _read(path):
    """The arrays of a file. Raises ValueError for a file that is none of save()'s."""
    try:
        with np.load(path) as file:
            arrays = {name: file[name] for name in file.files}
    except (OSError, ValueError, EOFError, KeyError, NotImplementedError, struct.error, zipfile.BadZipFile) as error:
        raise ValueError(f"{path}: expected a checkpoint, got a damaged file: {error}") from None
    if "total" not in arrays or "id" not in arrays:
        raise ValueError(f"{path}: expected a checkpoint, got a damaged file: there is no total or no id")
    return arrays


def _range_of(path):
    begin, _, end = path.stem.partition("_")
    return int(begin), int(end)


def _covers(place):
    """True if the parts of a checkpoint are all there."""
    end = 0
    last = None
    for path in sorted(_parts(place), key=_range_of):
        begin, until = _range_of(path)
        if begin > end:
            return False
        end, last = max(end, until), path
    if last is None:
        return False
    try:
        return end == int(_read(last)["total"])
    except ValueError:
        return True  # load() reports it
