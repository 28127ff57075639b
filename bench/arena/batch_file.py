"""Some environments of a contact-batch file as another file: fewer of them, or in another order."""

import h5py
import numpy as np

BY_ROW = ("row_param", "b", "R", "row_target", "row_lo", "row_hi")
BY_CONE = ("cone_kind", "cone_id", "cone_group")
BY_DOF = ("v_free",)


def entries(offsets, chosen):
    """Indices of everything that belongs to the chosen pieces, in their order."""
    return np.concatenate([np.arange(offsets[i], offsets[i + 1]) for i in chosen] or [np.zeros(0)]).astype(np.int64)


def starts(counts):
    return np.concatenate(([0], np.cumsum(counts))).astype(np.int64)


def take(path, chosen, target):
    """Writes the chosen environments, in that order, with all that a solver reads."""
    chosen = np.asarray(chosen, int)
    with h5py.File(path) as old, h5py.File(target, "w") as new:
        for name in ("format", "version", "law", "source"):
            if name in old.attrs:
                new.attrs[name] = old.attrs[name]
        rows, cones, sizes = old["env_row_ptr"][:], old["env_cone_ptr"][:], np.diff(old["cone_row_ptr"][:])
        row, cone = entries(rows, chosen), entries(cones, chosen)
        new["env_row_ptr"] = starts(np.diff(rows)[chosen])
        new["env_cone_ptr"] = starts(np.diff(cones)[chosen])
        new["cone_row_ptr"] = starts(sizes[cone])
        taken = [(BY_ROW, row), (BY_CONE, cone)]
        if "env_dof_ptr" in old:
            dofs = old["env_dof_ptr"][:]
            new["env_dof_ptr"] = starts(np.diff(dofs)[chosen])
            taken.append((BY_DOF, entries(dofs, chosen)))
            sparse(old, new, "M", entries(dofs, chosen))
            sparse(old, new, "J", row)
        sparse(old, new, "A", row)
        for names, where in taken:
            for name in names:
                if name in old:
                    new[name] = old[name][:][where]
    return target


def sparse(old, new, name, lines):
    """Lines of a group of compressed rows; columns count from the environment's first."""
    if name not in old:
        return
    pointer = old[f"{name}/ptr"][:]
    where = entries(pointer, lines)
    new[f"{name}/ptr"] = starts(np.diff(pointer)[lines])
    for part in ("col", "val"):
        new[f"{name}/{part}"] = old[f"{name}/{part}"][:][where]
