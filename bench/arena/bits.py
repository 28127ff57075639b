"""Hashes of answers: of the bits of all reactions as f64, environment by environment in the file's order."""

import hashlib

import numpy as np


def digest(reaction):
    """16 hexadecimal digits; every NaN is alike, +0 and -0 are not."""
    bits = np.array(reaction, "<f8")
    bits[np.isnan(bits)] = np.nan
    return hashlib.sha256(bits.tobytes()).hexdigest()[:16]


def reordered(values, offsets, order):
    """The pieces of an array of rows in another order: piece `order[i]` comes i-th."""
    pieces = np.split(np.asarray(values), offsets[1:-1])
    return np.concatenate([pieces[i] for i in order]) if len(order) else np.asarray(values)


def restored(values, offsets, order):
    """Undoes `reordered`; `offsets` are those of the original order."""
    counts = np.diff(offsets)[order]
    return reordered(values, np.concatenate(([0], np.cumsum(counts))), np.argsort(order))
