"""The integers of a batch: where environments, cones, rows and entries begin, and how much of their room is in use."""

import numpy as np

from .arguments import whole
from .arrays import as_numpy, take

#: Kinds of cones, by name; the numbers are those of batch files.
KINDS = {"free": 0, "unilateral": 1, "box": 2, "friction": 3, "box_friction": 4, "semidefinite": 5}
#: Kinds with a normal row and then rows with mu.
FRICTION_KINDS = ("friction", "box_friction")
#: Status flag of an environment with more contacts than there was room for.
FLAG_CONTACTS_DROPPED = 1 << 7
#: Rows of cones of several rows whose size is not given: a contact, or a symmetric matrix of order 2.
_LONG_KINDS = (*FRICTION_KINDS, "semidefinite")
_LONG_ROWS = 3


def cone_list(name, cones, rows):
    """(kinds, dims) of one environment's cones.

    cones: one kind's name, which tiles all rows (kinds of several rows by 3), or a list of names and (name, rows) pairs.
    """
    if isinstance(cones, str):
        dim = _LONG_ROWS if cones in _LONG_KINDS else 1
        if rows % dim:
            raise ValueError(f"{name}: expected a list of cones, got {cones!r} for {rows} rows, which cones of {dim} "
                             "rows do not tile")
        cones = [cones] * (rows // dim)
    kinds, dims = [], []
    for cone in cones:
        kind, dim = cone if isinstance(cone, tuple) else (cone, _LONG_ROWS if cone in _LONG_KINDS else 1)
        if kind not in KINDS:
            raise ValueError(f"{name}: expected kinds of {', '.join(KINDS)}, got {kind!r}")
        kinds.append(KINDS[kind])
        dims.append(whole(f"{name}: rows of {kind}", dim))
    return np.array(kinds, np.uint8), np.array(dims, np.int64)


def cone_text(cones):
    """A list of cones as one text: "friction:3,box:1"."""
    pairs = (cone if isinstance(cone, tuple) else (cone, _LONG_ROWS if cone in _LONG_KINDS else 1) for cone in cones)
    return ",".join(f"{kind}:{rows}" for kind, rows in pairs)


def tiles(name, dims, rows):
    """Refuses cones that are not all of an environment's rows."""
    if int(dims.sum()) != rows:
        raise ValueError(f"{name}: expected cones of {rows} rows together, got {int(dims.sum())}")


def default_dims(kinds):
    """Rows of cones whose sizes were not given: kinds of several rows 3, else 1."""
    return np.where(np.isin(kinds, [KINDS[kind] for kind in _LONG_KINDS]), _LONG_ROWS, 1).astype(np.int64)


def offsets_of(sizes):
    """Returns where parts of those sizes begin, and where the last one ends."""
    out = np.zeros(len(sizes) + 1, np.int64)
    np.cumsum(sizes, out=out[1:])
    return out


class Flat:
    """Environments one after another, without room between them."""

    padded = False

    def __init__(self, env_row_offsets, kinds, dims, env_cone_offsets=None):
        rows = offsets_of(dims)
        if env_cone_offsets is None:
            env_cone_offsets = np.searchsorted(rows, env_row_offsets).astype(np.int64)
            if len(env_row_offsets) and not np.array_equal(rows[env_cone_offsets], env_row_offsets):
                env = int(np.argmax(rows[env_cone_offsets] != env_row_offsets))
                raise ValueError(f"dims: expected cones that end where environments do, got one that crosses "
                                 f"offsets[{env}] = {int(env_row_offsets[env])}")
        self.integers = {"env_row_offsets": env_row_offsets, "env_cone_offsets": env_cone_offsets,
                         "cone_kind": kinds, "cone_row_offsets": rows}
        self.env_count = len(env_row_offsets) - 1
        self.row_count = int(env_row_offsets[-1])
        self.cone_count = len(kinds)
        self.row_shape = (self.row_count,)
        self.cone_shape = (self.cone_count,)
        self.fixed = True

    def refresh(self):
        """Nothing of it changes between solves."""

    def mu_offsets(self):
        """Place of each row's friction where there is one number per cone."""
        return np.repeat(np.arange(self.cone_count, dtype=np.int64), np.diff(self.integers["cone_row_offsets"]))

    def rows_of(self, env):
        """The rows of one environment in a flat vector."""
        offsets = self.integers["env_row_offsets"]
        return slice(int(offsets[env]), int(offsets[env + 1]))

    def dense_blocks(self):
        """Rows of dense matrices that follow one another."""
        return dense_rows(np.diff(self.integers["env_row_offsets"]))


def dense_rows(sizes):
    """row_offsets, column and column_offsets of dense matrices of those sizes, one after another."""
    row_sizes = np.repeat(sizes, sizes)
    return {"row_offsets": offsets_of(row_sizes), "column": np.arange(max(sizes, default=0), dtype=np.int32),
            "column_offsets": np.zeros(len(row_sizes), np.int64)}


class Padded:
    """Arrays of fixed shape (environments, room, ...); counts give how much of the room is in use.

    Arrays in use are read anew before every solve, so that the caller may change them in place.
    """

    padded = True

    def __init__(self, env_count, room, device, framework, *, cones=None, kinds=None, dims=None, counts=None,
                 cone_counts=None):
        self.env_count, self.room = env_count, room
        self.row_count = env_count * room
        self.row_shape = (env_count, room)
        self._uniform = kinds is None
        self._device_counts = None  # counts in device memory, read there
        if counts is not None and cone_counts is not None:
            raise ValueError("counts: expected counts or cone_counts, got both")
        self._counts = self._use("counts", counts, device)
        self._cone_counts = self._use("cone_counts", cone_counts, device)
        self._kinds, self._dims = self._cones(cones, kinds, dims, device)
        self.fixed = self._uniform and counts is None and cone_counts is None
        self.cone_room = self._dims.shape[-1]
        self.cone_shape = (env_count, self.cone_room)
        self.cone_count = env_count * (self.cone_room + 1)
        first = np.arange(env_count, dtype=np.int64)
        self.integers = {
            "env_row_offsets": np.arange(env_count + 1, dtype=np.int64) * room,
            "env_cone_offsets": np.arange(env_count + 1, dtype=np.int64) * (self.cone_room + 1),
            "env_row_counts": np.zeros(env_count, np.int32),
            "env_cone_counts": np.zeros(env_count, np.int32),
            "env_flags": np.zeros(env_count, np.uint32),
            "cone_kind": np.zeros(env_count * (self.cone_room + 1), np.uint8),
            "cone_row_offsets": np.zeros(env_count * (self.cone_room + 1) + 1, np.int64),
            "row_counts": np.zeros(self.row_count, np.int32),
        }
        self._first = (first * room)[:, None]
        # Rows of the first 0, 1, 2, ... cones, where all environments have the same.
        self._rows_of_cones = offsets_of(self._dims) if self._uniform and (self._dims > 0).all() else None
        if device == "cpu":
            self._refresh_cones()
            self._refresh_counts()
        else:
            self._place(device, framework)

    def has(self, kind):
        """True if a cone is of that kind, by name."""
        return bool((self._kinds == KINDS[kind]).any())

    def counted(self):
        """The caller's counts, by argument name."""
        given = {"counts": self._counts, "cone_counts": self._cone_counts}
        return {name: counts for name, counts in given.items() if counts is not None}

    def _use(self, name, counts, device):
        if counts is None:
            return None
        if device == "cpu":
            array = as_numpy(name, counts)
            if array.shape != (self.env_count,) or array.dtype.kind not in "iu":
                raise ValueError(f"{name}: expected integers ({self.env_count},), got {array.dtype} {array.shape}")
            return array
        take(name, counts, "int32", (self.env_count,), device)
        return counts

    def _cones(self, cones, kinds, dims, device):
        if kinds is None:
            kinds, dims = cone_list("cones", "friction" if cones is None else cones, self.room)
            if dims.sum() > self.room:
                raise ValueError(f"cones: expected cones of at most {self.room} rows together, got {int(dims.sum())}")
            return kinds, dims
        if cones is not None:
            raise ValueError("cones: expected cones or kinds, got both")
        if device != "cpu":
            raise ValueError(f"kinds: expected cones, the same for all environments, with arrays on {device}; got kinds")
        kinds = as_numpy("kinds", kinds)
        if kinds.dtype != np.uint8 or kinds.ndim != 2 or len(kinds) != self.env_count:
            raise ValueError(f"kinds: expected uint8 ({self.env_count}, cones), got {kinds.dtype} {kinds.shape}")
        if dims is None:
            return kinds, default_dims(kinds)
        dims = as_numpy("dims", dims)
        if dims.shape != kinds.shape or dims.dtype.kind not in "iu":
            raise ValueError(f"dims: expected integers {kinds.shape}, got {dims.dtype} {dims.shape}")
        return kinds, dims

    def _refresh_cones(self):
        if not self._uniform and (self._dims < 0).any():
            raise ValueError("dims: expected numbers of rows >= 0, got a negative one")
        ends = np.minimum(np.cumsum(self._dims, axis=-1, dtype=np.int64), self.room)
        self._ends = np.broadcast_to(ends, self.cone_shape)
        kinds = self.integers["cone_kind"].reshape(self.env_count, self.cone_room + 1)
        kinds[:, :-1] = self._kinds
        rows = self.integers["cone_row_offsets"]
        places = rows[:-1].reshape(self.env_count, self.cone_room + 1)
        places[:, 0] = self._first[:, 0]
        places[:, 1:] = self._first + self._ends
        rows[-1] = self.row_count

    def _wanted_cones(self):
        wanted = self._cone_counts.astype(np.int64)
        if (wanted < 0).any():
            raise ValueError("cone_counts: expected numbers of cones >= 0, got a negative one")
        return wanted

    def _count_same_cones(self, limit):
        """Counts (cones, rows, over) in use of each environment, all of which have the same cones of one row or more.
        `limit`: the rows of each that the caller counted, or None.
        """
        rows_of = self._rows_of_cones
        if self._cone_counts is not None:
            wanted = self._wanted_cones()
            cones = np.minimum(wanted, self.cone_room)
            return cones, rows_of[cones], wanted > self.cone_room
        if limit is None:
            return self.cone_room, rows_of[-1], False
        cones = np.searchsorted(rows_of, np.minimum(np.maximum(limit, 0), self.room), side="right") - 1
        return cones, rows_of[cones], limit > self.room

    def _count_own_cones(self, limit):
        """A layout, each environment having different cones."""
        whole = np.cumsum(np.broadcast_to(self._dims, self.cone_shape), axis=1, dtype=np.int64)
        if self._cone_counts is not None:
            wanted = self._wanted_cones()
            limit = np.where(wanted > 0, np.take_along_axis(
                whole, np.clip(wanted - 1, 0, max(self.cone_room - 1, 0))[:, None], axis=1)[:, 0], 0) \
                if self.cone_room else np.zeros(self.env_count, np.int64)
            over = wanted > self.cone_room
        else:
            if limit is None:
                limit = whole[:, -1] if self.cone_room else np.zeros(self.env_count, np.int64)
            over = np.zeros(self.env_count, bool)
        fits = (whole <= np.minimum(limit, self.room)[:, None]) & (np.broadcast_to(self._dims, self.cone_shape) > 0)
        cones = fits.sum(axis=1)
        rows = np.where(cones > 0, np.take_along_axis(
            whole, np.maximum(cones - 1, 0)[:, None], axis=1)[:, 0], 0) if self.cone_room else limit * 0
        return cones, rows, over | (limit > self.room)

    def _refresh_counts(self):
        given = None if self._counts is None else self._counts.astype(np.int64)
        count = self._count_own_cones if self._rows_of_cones is None else self._count_same_cones
        cones, rows, over = count(given)
        if given is not None:
            wrong = (given < 0) | ((rows != given) & (given <= self.room))
            if wrong.any():
                env = int(np.argmax(wrong))
                raise ValueError(f"counts[env {env}]: expected rows of whole cones, got {int(given[env])}")
        self.integers["env_cone_counts"][:] = cones
        self.integers["env_row_counts"][:] = rows
        self.integers["env_flags"][:] = over * np.uint32(FLAG_CONTACTS_DROPPED)
        self.integers["row_counts"].reshape(self.row_shape)[:] = np.reshape(rows, (-1, 1))

    def refresh(self):
        """Reads counts, kinds and dims again."""
        if self.fixed:
            return
        if self._device_counts is not None:
            self._refresh_on_device()
            return
        if not self._uniform:
            self._refresh_cones()
        self._refresh_counts()

    def _place(self, device, framework):
        """These integers in device memory; counts stay the caller's and are read there."""
        given = self._counts if self._counts is not None else self._cone_counts
        by_rows = self._counts is not None
        self._counts = self._cone_counts = None
        self._refresh_cones()
        self._refresh_counts()
        if given is not None and len(set(self._dims.tolist())) > 1:
            raise ValueError(f"cones: expected cones of one size with counts on {device}, got {self._dims.tolist()}")
        self.integers["env_flags"] = self.integers["env_flags"].view(np.int32)
        self.integers = {name: framework.from_numpy(array, device) for name, array in self.integers.items()}
        if given is not None:
            self._device_counts, self._per_cone = given, int(self._dims[0])
            self._rows_counted = self._per_cone if by_rows else 1
            self._refresh_on_device()

    def _refresh_on_device(self):
        counts, dim = self._device_counts // self._rows_counted, self._per_cone
        over = counts > self.cone_room
        cones = counts - (counts - self.cone_room) * over
        self.integers["env_cone_counts"][...] = cones
        self.integers["env_row_counts"][...] = cones * dim
        self.integers["env_flags"][...] = over * FLAG_CONTACTS_DROPPED
        self.integers["row_counts"].reshape(self.row_shape)[...] = (cones * dim)[:, None]

    def mu_offsets(self):
        """Place of each row's friction where there is one number per cone, in arrays of shape (environments, cones)."""
        cone = np.zeros((self.env_count, self.room + 1), np.int64)
        for c in range(self.cone_room):
            np.add.at(cone, (np.arange(self.env_count), self._ends[:, c]), 1)
        cone = np.minimum(np.cumsum(cone, axis=1)[:, :-1], max(self.cone_room - 1, 0))
        return (cone + np.arange(self.env_count, dtype=np.int64)[:, None] * self.cone_room).reshape(-1)

    def rows_of(self, env):
        """The rows of one environment that are in use, as (environment, rows)."""
        return env, slice(0, int(self.integers["env_row_counts"][env]))

    def dense_blocks(self):
        """Rows of a dense matrix that fills its room."""
        return {"row_offsets": np.arange(self.row_count + 1, dtype=np.int64) * self.room,
                "column": np.arange(self.room, dtype=np.int32),
                "column_offsets": np.zeros(self.row_count, np.int64)}
