"""Arrays of any framework: read where they are, and refused with the expected and the given form."""

import numpy as np

from .. import _core

FLOATS = ("float32", "float64")
#: Record of one environment: how its solve ended. 32 bytes.
STATUS_DTYPE = np.dtype({
    "names": ["residual", "residual_abs", "flags", "iterations", "code", "solver", "islands"],
    "formats": ["<f8", "<f8", "<u4", "<i4", "u1", "u1", "<i4"],
    "offsets": [0, 8, 16, 20, 24, 25, 28],
    "itemsize": 32,
})


def describe(dtype, shape, device, contiguous=True):
    """An array in words, for errors."""
    sizes = ", ".join(str(extent) for extent in shape) + ("," if len(shape) == 1 else "")
    return f"{dtype} ({sizes}) {'C-contiguous' if contiguous else 'not C-contiguous'} on {device}"


def look(name, obj):
    """The array as the module sees it, neither copied nor converted."""
    if isinstance(obj, np.ndarray):
        if isinstance(obj, np.ma.MaskedArray):
            raise TypeError(f"{name}: expected an array without a mask, got one with: give {name}.filled(...)")
        if not obj.dtype.isnative:
            raise TypeError(f"{name}: expected this machine's byte order, got {obj.dtype.str}: give "
                            f"{name}.astype({obj.dtype.newbyteorder('=').name!r})")
        if obj.dtype.names is not None and obj.dtype == STATUS_DTYPE:
            obj = status_bytes(obj)
        if obj.dtype == np.longdouble and np.dtype(np.longdouble).itemsize > 8:
            raise TypeError(f"{name}: expected float32 or float64, got {obj.dtype} (numpy.longdouble), which no solver "
                            f"computes with: give {name}.astype('float64')")
    elif getattr(obj, "requires_grad", False):
        raise TypeError(f"{name}: expected an array without a gradient, got one that requires it: give {name}.detach()")
    try:
        return _core.Array(obj)
    except (TypeError, RuntimeError):
        raise TypeError(f"{name}: expected an array (NumPy, PyTorch, JAX, CuPy, Warp or another that speaks DLPack), "
                        f"got {type(obj).__name__}") from None


def take(name, obj, dtype, shape, device, writable=False):
    """The array as the module sees it, after a check of everything that can be wrong with it.

    `shape` may hold names in place of numbers: such an extent may be anything.
    """
    seen = look(name, obj)
    extents = seen.shape
    fits = extents == shape or len(extents) == len(shape) and all(
        isinstance(want, str) or want == got for want, got in zip(shape, extents))
    if seen.dtype == dtype and fits and seen.device == device and seen.contiguous:
        if writable and not (seen.writable and framework_of(obj).writable):
            raise ValueError(f"{name}: expected a writable array, got a read-only one")
        return seen
    wrong = TypeError if seen.dtype != dtype else ValueError
    text = (f"{name}: expected {describe(dtype, shape, device)}, "
            f"got {describe(seen.dtype, seen.shape, seen.device, seen.contiguous)}")
    if not seen.contiguous:
        text += ": make it contiguous first (numpy.ascontiguousarray, Tensor.contiguous)"
    raise wrong(text)


def apart(names, arrays):
    """Refuses arrays to be written that share memory."""
    spans = sorted((array.pointer, array.pointer + array.size * np.dtype(array.dtype).itemsize, name)
                   for name, array in zip(names, arrays) if array.size)
    for (_, end, first), (begin, _, second) in zip(spans, spans[1:]):
        if begin < end:
            raise ValueError(f"{second}: expected memory of its own, got memory that it shares with {first}")


def status_bytes(status):
    """The memory of a structured status array as (environments, 32) bytes."""
    return status.view(np.uint8).reshape(-1, STATUS_DTYPE.itemsize)


class Framework:
    """Library that an array comes from: its memory, its own stream."""

    #: True if its arrays are written in the order of a stream, so that a solve need not be waited for.
    has_streams = False

    def __init__(self, name, writable=True):
        self.name = name
        self.writable = writable  # whether its arrays may change; JAX's may not, and carry no such flag

    def __reduce__(self):
        return framework_named, (self.name,)

    def zeros(self, shape, dtype, device):
        """New memory on that device."""
        if device != "cpu":
            raise ValueError(f"out: expected arrays on {device} to write to, got None: {self.name} arrays cannot be "
                             f"made and written there")
        return np.zeros(shape, dtype)

    def from_numpy(self, array, device):
        """A host array on that device; the same memory on the host."""
        if device != "cpu":
            raise ValueError(f"integers of the batch cannot be moved to {device} by {self.name}: give the batch's "
                             f"arrays as PyTorch or CuPy arrays")
        return array

    def current_stream(self, device):
        """Handle of the stream that the framework works in."""
        return 0


class _Torch(Framework):
    has_streams = True

    def zeros(self, shape, dtype, device):
        import torch
        return torch.zeros(shape, dtype=getattr(torch, dtype), device=device)

    def from_numpy(self, array, device):
        import torch
        return torch.from_numpy(array).to(device)

    def current_stream(self, device):
        import torch
        return torch.cuda.current_stream(device).cuda_stream if device != "cpu" else 0


class _Cupy(Framework):
    has_streams = True

    def zeros(self, shape, dtype, device):
        import cupy
        with cupy.cuda.Device(int(device.partition(":")[2] or 0)):
            return cupy.zeros(shape, dtype)

    def from_numpy(self, array, device):
        import cupy
        with cupy.cuda.Device(int(device.partition(":")[2] or 0)):
            return cupy.asarray(array)

    def current_stream(self, device):
        import cupy
        return cupy.cuda.get_current_stream().ptr


class _Warp(Framework):
    has_streams = True

    def zeros(self, shape, dtype, device):
        import warp
        return warp.zeros(shape, dtype=getattr(warp, dtype), device=device)

    def from_numpy(self, array, device):
        import warp
        return warp.from_numpy(array, device=device)

    def current_stream(self, device):
        import warp
        return warp.get_stream(device).cuda_stream if device != "cpu" else 0


_JAX = Framework("JAX", writable=False)
_FRAMEWORKS = {"torch": _Torch("PyTorch"), "cupy": _Cupy("CuPy"), "warp": _Warp("Warp"),
               "jax": _JAX, "jaxlib": _JAX}
NUMPY = Framework("NumPy")


def framework_named(name):
    """The framework of that name: there is one of each."""
    return next(framework for framework in (NUMPY, *_FRAMEWORKS.values()) if framework.name == name)


def framework_of(obj):
    """The framework of an array; NumPy's for unknown ones."""
    return _FRAMEWORKS.get(type(obj).__module__.partition(".")[0], NUMPY)


def as_numpy(name, obj):
    """A host array as NumPy's, sharing its memory."""
    if isinstance(obj, np.ndarray):
        return obj
    try:
        return np.asarray(obj)
    except (TypeError, RuntimeError) as error:
        raise TypeError(f"{name}: expected an array on cpu, got {type(obj).__name__} ({error})") from None
