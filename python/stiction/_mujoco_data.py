"""The mujoco.MjData of a BatchedSimulation."""

import collections.abc

import mujoco
import numpy as np


def check_data(model, i, one):
    """Raises TypeError or ValueError for what is no mjData of that model."""
    if not isinstance(one, mujoco.MjData):
        raise TypeError(f"data[{i}]: expected a mujoco.MjData, got {type(one).__name__}")
    if one.model._address != model._address:
        raise ValueError(f"data[{i}]: expected data of this simulation's model, got data of another one: make it with "
                         "mujoco.MjData(simulation.model)")


class Simulations(collections.abc.Sequence):
    """The mujoco.MjData of a BatchedSimulation. One may be replaced by another of the same model, `data[i] = other`; what
    its constraints would have started from is dropped then. Raises TypeError or ValueError for anything else."""

    def __init__(self, model, data):
        self._model, self._data, self._core = model, [], None
        self._places = {}  # address -> simulation
        self.replaced = 0  #: how many times one was replaced: views of their arrays are old then
        for i, one in enumerate(data):
            self._data.append(self._checked(i, one))
            self._places[one._address] = i

    def __len__(self):
        return len(self._data)

    def __getitem__(self, i):
        return self._data[i]

    def __repr__(self):
        return repr(self._data)

    def __setitem__(self, i, one):
        if not isinstance(i, (int, np.integer)):
            raise TypeError(f"data: expected one simulation at a time, data[i] = ..., got {i!r}")
        if not -len(self) <= i < len(self):
            raise IndexError(f"data: expected a simulation in 0..{len(self) - 1}, got {i}")
        i = int(i) % len(self)
        if one is self._data[i]:
            return
        one = self._checked(i, one)
        self._core.replace(i, one._address)
        del self._places[self._data[i]._address]
        self._data[i], self._places[one._address] = one, i
        self.replaced += 1

    def _checked(self, i, one):
        check_data(self._model, i, one)
        if one._address in self._places:
            raise ValueError(f"data[{i}]: expected data of its own, got that of simulation {self._places[one._address]}: "
                             "two threads would write to it")
        return one
