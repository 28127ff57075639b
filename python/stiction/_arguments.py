"""Options that are no arrays: whole numbers, numbers and names, checked before the library is called."""

from __future__ import annotations

import operator

_LEAST, _MOST = -2**31, 2**31 - 1


def whole(name, value, most=_MOST):
    """An int that the library's 32 bits hold, or up to `most`. A float that is whole is taken: 1e4 is how people write
    it. Whether the value is sensible is the library's to say.
    """
    if isinstance(value, float) and value.is_integer():
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


def word(name, value):
    """A str. Which ones there are is the library's to say."""
    if not isinstance(value, str):
        raise TypeError(f"{name}: expected a str, got {value!r}")
    return value
