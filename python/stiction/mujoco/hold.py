"""Simulations of MuJoCo that have failed: found, named, and held at their last good state."""

import mujoco
import numpy as np

_STATE = mujoco.mjtState.mjSTATE_INTEGRATION
_WARNINGS = [int(warning) for warning in (mujoco.mjtWarning.mjWARN_BADQPOS, mujoco.mjtWarning.mjWARN_BADQVEL,
                                          mujoco.mjtWarning.mjWARN_BADQACC)]


def _is_good(state):
    return np.isfinite(state).all() and np.abs(state).max(initial=0) < mujoco.mjMAXVAL


class Held:
    """The last good state of each simulation, and which ones failed in the last step."""

    def __init__(self, model, count):
        self._model = model
        self._states = np.full((count, mujoco.mj_stateSize(model, _STATE)), np.nan)
        self._room = np.empty(self._states.shape[1])
        self._resets = np.zeros(count, np.int64)
        self.failed = np.zeros(count, bool)

    def before(self, data, chosen):
        """Keeps the state that each chosen simulation (None: all) begins with. One whose state is not finite, or
        beyond MuJoCo's limits, gets its last good one. Returns the simulations that may be stepped."""
        self.failed[:] = False
        chosen = np.ones(len(self.failed), bool) if chosen is None else chosen
        for i in np.flatnonzero(chosen):
            mujoco.mj_getState(self._model, data[i], self._room, _STATE)
            if _is_good(self._room):
                self._states[i] = self._room
            else:
                self._restore(i, data[i])
            self._resets[i] = self._resets_of(data[i])
        return chosen & ~self.failed

    def after(self, data, chosen):
        """Finds which of them the step has spoiled, or MuJoCo has reset, and takes the step back."""
        for i in np.flatnonzero(chosen):
            mujoco.mj_getState(self._model, data[i], self._room, _STATE)
            if _is_good(self._room) and self._resets_of(data[i]) == self._resets[i]:
                self._states[i] = self._room
            else:
                self._restore(i, data[i])

    def _restore(self, i, one):
        self.failed[i] = True
        if np.isfinite(self._states[i]).all():
            mujoco.mj_setState(self._model, one, self._states[i], _STATE)
        else:  # it never had a good one
            mujoco.mj_resetData(self._model, one)

    @staticmethod
    def _resets_of(one):
        """Counts MuJoCo's resets of it for numbers that are not finite, or too large."""
        return sum(int(one.warning[warning].number) for warning in _WARNINGS)
