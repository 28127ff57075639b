"""Options: whole numbers, numbers and names, checked before the library is called."""

from __future__ import annotations

import math
import operator

import numpy as np

_LEAST, _MOST = -2**31, 2**31 - 1


def whole(name, value, most=_MOST):
    """An int that the library's 32 bits hold, or up to `most`. A float that is whole is taken: 1e4 is how people write
    it. The library checks if the value is sensible.
    """
    if isinstance(value, (float, np.floating)) and value.is_integer():
        value = int(value)
    try:
        value = operator.index(value)
    except TypeError:
        raise TypeError(f"{name}: expected an integer, got {value!r}") from None
    if not _LEAST <= value <= most:
        raise ValueError(f"{name}: expected an integer from {_LEAST} to {most}, got {value}")
    return value


def number(name, value):
    """A float."""
    try:
        return float(value)
    except (TypeError, ValueError):
        raise TypeError(f"{name}: expected a number, got {value!r}") from None


def not_negative(name, value):
    """A finite float that is 0 or above."""
    value = number(name, value)
    if not 0 <= value < math.inf:
        raise ValueError(f"{name}: expected a finite number >= 0, got {value!r}")
    return value


def each_not_negative(name, values):
    """Finite numbers that are 0 or above, float64; the message says which of them is not."""
    try:
        array = np.asarray(values, np.float64)
    except (TypeError, ValueError):
        raise TypeError(f"{name}: expected numbers, got {values!r}") from None
    _check_each(name, array, (array >= 0) & np.isfinite(array), "a finite number >= 0")
    return array


def each_count(name, values):
    """Whole numbers from 0 on, int32; the message names the first wrong one. Whole floats are taken, as by whole()."""
    array = np.asarray(values)
    if array.dtype.kind not in "iuf":
        raise TypeError(f"{name}: expected integers, got {values!r}")
    _check_each(name, array, (array >= 0) & (array <= _MOST) & (array == np.floor(array)),
                f"an integer from 0 to {_MOST}")
    return array.astype(np.int32)


def spread_over(name, array, count):
    """One number for each of `count` environments, of one number or of as many."""
    if array.shape not in ((), (1,), (count,)):
        raise ValueError(f"{name}: expected one number or one for each of {count} environments, got {array.shape}")
    return np.broadcast_to(array, (count,))


def _check_each(name, array, right, expected):
    if not right.all():
        place = np.argwhere(~right)[0]
        where = f"[{', '.join(map(str, place))}]" if array.ndim else ""
        raise ValueError(f"{name}{where}: expected {expected}, got {array[tuple(place)]}")


def word(name, value):
    """A str. The library knows the valid ones."""
    if not isinstance(value, str):
        raise TypeError(f"{name}: expected a str, got {value!r}")
    return value
