"""Arrays of simulations in the memory of a device: copied where they are read or written, and shared by DLPack."""

import numpy as np


def array_of(core, name, shape):
    """An array of a batch of robots: NumPy's over its memory, or a DeviceArray where a device has it."""
    host = core.array(name)
    return host.reshape(shape) if core.device == "cpu" else DeviceArray(core, name, shape, host.dtype)


class DeviceArray(np.lib.mixins.NDArrayOperatorsMixin):
    """An array of all simulations in the memory of their device. It is that memory, and goes on with every step.

    Reading it, by NumPy or an index, waits for the steps and copies it to the host. `array[i] = ...` writes it, in parts
    of it, too. An index that makes a view of a NumPy array makes a part of this one.

    torch.from_dlpack(array), and likewise JAX, CuPy and Warp, share the memory without a copy, until the simulations are
    gone. The next step reads what they write in the order of its stream.
    """

    def __init__(self, core, name, shape, dtype, keys=()):
        self._core, self._name, self._whole, self._keys = core, name, tuple(shape), keys
        self.dtype = dtype

    def _part(self, array):
        for key in self._keys:
            array = array[key]
        return array

    def _host(self):
        return self._part(self._core.array(self._name).reshape(self._whole))

    def _blank(self):
        """An array of its extents, of which no number is there."""
        return self._part(np.broadcast_to(np.empty((), self.dtype), self._whole))

    device = property(lambda self: self._core.device, doc="Name of the device.")
    shape = property(lambda self: self._blank().shape, doc="Extents.")
    ndim = property(lambda self: self._blank().ndim, doc="How many axes.")
    size = property(lambda self: self._blank().size, doc="How many numbers.")

    def numpy(self):
        """A copy in host memory. It is not writable, since that would not reach the device."""
        copy = self.copy()
        copy.flags.writeable = False
        return copy

    def copy(self):
        """A copy in host memory, which may be written."""
        return np.array(self._host())

    def __len__(self):
        return len(self._blank())

    def __iter__(self):
        return iter(self.numpy())

    def __getitem__(self, key):
        blank = self._blank()
        part = blank[key]
        if isinstance(part, np.ndarray) and np.may_share_memory(part, blank):
            return DeviceArray(self._core, self._name, self._whole, self.dtype, (*self._keys, key))
        return self._host()[key]

    def __setitem__(self, key, values):
        if isinstance(values, DeviceArray):
            values = values.numpy()
        self._host()[key] = values
        self._core.give_back()

    def __array__(self, dtype=None, copy=None):
        if copy is False:
            raise ValueError(f"{self._name}: expected copy=None or True, got False: the array is in memory of {self.device}")
        return self.copy() if dtype is None else self.copy().astype(dtype, copy=False)

    def __array_ufunc__(self, ufunc, method, *inputs, out=(), **options):
        inputs = [one.numpy() if isinstance(one, DeviceArray) else one for one in inputs]
        made = getattr(ufunc, method)(*inputs, **options)
        for to in out:
            to[...] = made
        return out[0] if out else made

    def __getattr__(self, name):
        if name.startswith("_") or not hasattr(np.ndarray, name):
            raise AttributeError(f"DeviceArray has no attribute {name!r}")
        return getattr(self.numpy(), name)

    def __bool__(self):
        return bool(self.numpy())

    def __float__(self):
        return float(self.numpy())

    def __repr__(self):
        return f"<stiction.mujoco DeviceArray {self._name} {self.shape} {self.dtype} on {self.device}>"

    def _memory(self):
        if self._keys:
            raise ValueError(f"{self._name}: expected the whole array for DLPack, got a part of it: take the part of the "
                             "array that is made from it")
        return self._core.memory(self._name, self._whole)

    def __dlpack__(self, **options):
        return self._memory().__dlpack__(**options)

    def __dlpack_device__(self):
        return self._memory().__dlpack_device__()
