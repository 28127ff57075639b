"""An answer to a set of problems, as entrants hand it in: an HDF5 file, the same from here and from outside.

    lambda      (rows)          reactions in the batch's order; NaN where there is none
    seconds     (environments)  may be missing: of the solving call, the set's time shared out where all are solved at once
    claimed     (environments)  may be missing: whether the solver calls it solved
    iterations  (environments)  may be missing

The attribute `memory_mib` may hold the solver's memory above its idle state.
"""

import dataclasses

import h5py
import numpy as np


@dataclasses.dataclass
class Answer:
    reaction: np.ndarray
    seconds: np.ndarray = None
    claimed: np.ndarray = None
    iterations: np.ndarray = None
    memory_mib: float = None
    late: bool = False  # the clock ended some environment, so the bits are the clock's too
    note: str = ""


def write(path, answer):
    with h5py.File(path, "w") as file:
        file["lambda"] = answer.reaction
        for name in ("seconds", "claimed", "iterations"):
            if getattr(answer, name) is not None:
                file[name] = np.asarray(getattr(answer, name))
        if answer.memory_mib is not None:
            file.attrs["memory_mib"] = answer.memory_mib
        file.attrs["late"] = answer.late
        file.attrs["note"] = answer.note


def read(path, rows, environments):
    """ValueError, one sentence, where the file does not fit the set."""
    with h5py.File(path) as file:
        if "lambda" not in file:
            raise ValueError(f"{path}: no dataset 'lambda'")
        answer = Answer(file["lambda"][:].astype(float))
        if answer.reaction.shape != (rows,):
            raise ValueError(f"{path}: lambda has shape {answer.reaction.shape}, the set has {rows} rows")
        for name in ("seconds", "claimed", "iterations"):
            if name in file:
                values = file[name][:]
                if values.shape != (environments,):
                    raise ValueError(f"{path}: {name} has shape {values.shape}, the set has {environments} environments")
                setattr(answer, name, values)
        if "memory_mib" in file.attrs:
            answer.memory_mib = float(file.attrs["memory_mib"])
        answer.late, answer.note = bool(file.attrs.get("late", False)), str(file.attrs.get("note", ""))
    return answer
