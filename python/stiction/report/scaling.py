"""The plots of a report of `stiction scaling`."""

import math

from .svg import bars, lines


def _of(points, field, key):
    """A number of every point, None where it is not there or not finite."""
    found = [field(point, key, (int, float, type(None)), False) for point in points]
    return [value if value is not None and math.isfinite(value) else None for value in found]


def series_plots(points, field) -> list:
    """(title, note, plot, ...) of a series over threads. field(report, path, kinds, is_needed) reads one number or
    raises.
    """
    threads = [field(point, ("threads",), int) for point in points]
    if sorted(set(threads)) != threads or threads[0] < 1:
        raise ValueError(f"expected 'threads' that ascend from 1 on, got {threads}")
    ideal = [count / threads[0] for count in threads]
    shares = {name: _of(points, field, path) for name, path in (
        ("efficiency", ("efficiency",)), ("waiting", ("thread_use", "synchronisation_share")),
        ("serial", ("serial_share",)))}
    uneven = dict(zip((f"{count} threads" for count in threads), _of(points, field, ("thread_use", "imbalance"))))
    return [("speed-up", "Environments per second over those of the first point; dashed: as many times the threads.",
             lines("speed-up", threads, {"measured": _of(points, field, ("speedup",)), "perfect": ideal}, "threads")),
            ("shares", "Efficiency, the share of the threads' time in which they waited, and the share of the run in "
             "which one thread worked.", lines("shares", threads, shares, "threads")),
            ("imbalance", "The busiest thread's time at work over the mean.", bars("imbalance", uneven))]
