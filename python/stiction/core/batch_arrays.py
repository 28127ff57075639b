"""The arrays behind a batch: the caller's, checked and kept, and the C++ library's views of them."""

from __future__ import annotations

import numpy as np

from .. import _core
from .arrays import NUMPY, as_numpy, look, take
from .layout import Flat, cone_list, default_dims, tiles


class BatchArrays:
    """Arrays by argument name and by the C++ library's names, and the views made of them."""

    def __init__(self, form, framework, dtype, device, law):
        self.form, self.framework, self.dtype, self.device, self.law = form, framework, dtype, device, law
        self.arrays = {}   # argument name -> the caller's array
        self.extras = {}   # a file's contents beside the problem
        self._held = {}    # C++ name -> array
        self._seen = {}    # C++ name -> _core.Array
        self._views = {}   # whether in device memory -> view
        self.layout = None

    def __getstate__(self):
        return {name: value for name, value in self.__dict__.items() if name not in ("_seen", "_views")}

    def __setstate__(self, state):
        self.__dict__.update(state)
        self._seen = {name: look(name, array) for name, array in self._held.items()}
        self._views = {}

    def _put(self, name, argument, array):
        self._seen[name] = look(argument, array)
        self._held[name] = self.arrays[argument] = array

    def _numbers(self, name, value, shape):
        self._given(name, name, value, self.dtype, shape)

    def _given(self, name, argument, value, dtype, shape):
        self._seen[name] = take(argument, value, dtype, shape, self.device)
        self._held[name] = self.arrays[argument] = value

    def _integers(self, arrays):
        for name, array in arrays.items():
            if self.device != "cpu" and isinstance(array, np.ndarray):
                array = self.framework.from_numpy(array, self.device)
            self._seen[name] = look(name, array)
            self._held[name] = array

    def _flat_layout(self, offsets, cones, kinds, dims):
        if self.device != "cpu":
            raise ValueError(f"offsets: expected padded arrays on {self.device} (environments, room, ...), got flat ones")
        take("offsets", offsets, "int64", ("environments + 1",), "cpu")
        self.arrays["offsets"] = offsets
        offsets = as_numpy("offsets", offsets)
        if len(offsets) < 1 or offsets[0] != 0 or (np.diff(offsets) < 0).any():
            raise ValueError("offsets: expected numbers that lead from 0 forward, got " + str(offsets[:4].tolist()))
        if kinds is None:
            made = [cone_list("cones", "friction" if cones is None else cones, int(n)) for n in np.diff(offsets)]
            for env, (_, dims_e) in enumerate(made):
                tiles(f"cones[env {env}]", dims_e, int(offsets[env + 1] - offsets[env]))
            kinds = np.concatenate([m[0] for m in made]) if made else np.zeros(0, np.uint8)
            dims = np.concatenate([m[1] for m in made]) if made else np.zeros(0, np.int64)
        else:
            self.arrays["kinds"] = kinds
            take("kinds", kinds, "uint8", ("cones",), "cpu")
            kinds = as_numpy("kinds", kinds)
            dims = default_dims(kinds) if dims is None else as_numpy("dims", dims).astype(np.int64)
            if dims.shape != kinds.shape:
                raise ValueError(f"dims: expected one number per cone {kinds.shape}, got {dims.shape}")
            tiles("dims", dims, int(offsets[-1]))
        self.layout = Flat(np.ascontiguousarray(offsets), kinds, dims)

    def _rows(self, mu, R, lo, hi, groups, accuracy):
        """Arrays of every row, cone and environment beside the matrix."""
        layout = self.layout
        self._integers({name: array for name, array in layout.integers.items()
                        if self.form == "delassus" or name != "row_counts"})
        zeros = None
        for name, value in (("R", R), ("lo", lo), ("hi", hi)):
            if value is None:
                zeros = self.framework.zeros(layout.row_shape, self.dtype, self.device) if zeros is None else zeros
                value = zeros
            self._numbers(name, value, layout.row_shape)
        self._friction(mu)
        if groups is not None:
            self._given("cone_group", "groups", groups, "int32", layout.cone_shape)
            if layout.padded:
                raise ValueError("groups: expected None with padded arrays, got an array: use lists or flat arrays")
        self._accuracy(*accuracy)

    def _friction(self, mu):
        layout = self.layout
        if mu is None or np.isscalar(mu):
            filled = np.full(layout.row_shape, 0.0 if mu is None else mu, self.dtype)
            if self.framework is not NUMPY:
                filled = self.framework.from_numpy(filled, self.device)
            self._numbers("mu", filled, layout.row_shape)
            return
        per_cone = look("mu", mu).shape == tuple(layout.cone_shape) != tuple(layout.row_shape)
        if per_cone and self.form == "jacobian":
            raise ValueError(f"mu: expected one number or one per row {layout.row_shape} in the Jacobian form, "
                             f"got {layout.cone_shape}")
        self._numbers("mu", mu, layout.cone_shape if per_cone else layout.row_shape)
        if per_cone:
            self._integers({"mu_offsets": layout.mu_offsets()})

    def _accuracy(self, tolerance, max_iterations):
        env_count = len(self)
        if tolerance is not None:
            self._given("env_tolerance", "env_tolerance", tolerance, "float64", (env_count,))
        if max_iterations is not None:
            self._given("env_max_iterations", "env_max_iterations", max_iterations, "int32", (env_count,))

    def _most_dofs(self) -> int:
        """Degrees of freedom of the largest environment, in the Jacobian form."""
        if self.layout.padded:
            return self.dof_shape[1]
        return int(np.diff(as_numpy("dof_offsets", self.dof_offsets)).max(initial=0))

    def _refresh(self):
        """Reads arrays again that may have changed in place since the last solve."""
        if self.layout is not None:
            self.layout.refresh()

    def _room(self):
        """Room that a solver on a device needs for this batch; None where its integers are to be asked."""
        if self.form == "bodies" or not self.layout.padded:
            return None
        envs, rows, cones = self.layout.env_count, self.layout.room, self.layout.cone_room + 1
        if self.form == "jacobian":
            room = _core.JacobianCapacity.of_largest(envs, rows, cones, self.dof_shape[1])
            room.semidefinite = self.layout.has("semidefinite")
            return room
        return _core.Capacity(envs, envs * rows, envs * cones, envs * rows * rows, rows, rows * rows, 0,
                              self.dtype == "float64", self.layout.has("semidefinite"))

    def _view(self, on_device):
        view = self._views.get(on_device)
        if view is None:
            wide = self.dtype == "float64"
            if self.form == "delassus":
                fixed = self.layout.fixed and "indptr" not in self.arrays and "kinds" not in self.arrays
                view = _core.ContactView(self._seen, wide, self.law, on_device, fixed)
            elif self.form == "jacobian":
                view = _core.JacobianView(self._seen, wide, self.law, self.factored, self.mass_block, on_device)
            else:
                view = _core.BodyView(self._seen, wide, on_device)
            self._views[on_device] = view
        return view
