"""What is read off scaling.py's table: exponents of time, and what a second thread is worth."""

import numpy as np

SERIES = {"environments": 1024, "contacts": 16}  # what grows, and from where on the slope is taken


def exponent(size, seconds):
    """(slope, its standard error) of the least-squares line through logarithms; NaN for fewer than three points."""
    if len(size) < 3:
        return np.nan, np.nan
    x, y = np.log(size), np.log(seconds)
    x = x - x.mean()
    slope = (x * y).sum() / (x * x).sum()
    off = y - y.mean() - slope * x
    return slope, float(np.sqrt((off * off).sum() / (len(x) - 2) / (x * x).sum()))


def of_series(rows, series):
    """(form, precision, threads, sizes, microseconds of an environment) of every curve."""
    own = [row for row in rows if row["series"] == series]
    for key in dict.fromkeys((row["form"], row["precision"], int(row["threads"])) for row in own):
        curve = [row for row in own if (row["form"], row["precision"], int(row["threads"])) == key]
        yield *key, np.array([float(row[series]) for row in curve]), np.array([float(row["us_per_env"]) for row in curve])


def exponents(rows):
    """(series, form, precision, threads, slope, standard error) of a call's time against environments, and of an
    environment's against contacts."""
    for series, least in SERIES.items():
        for form, precision, threads, sizes, microseconds in of_series(rows, series):
            tail = sizes >= least
            time = microseconds * (sizes if series == "environments" else 1)
            yield series, form, precision, threads, *exponent(sizes[tail], time[tail])


def second_thread(rows):
    """(form, precision, environments, "median (quartiles)" of one thread's time over that of two) of the largest batches."""
    largest = {}
    for row in rows:
        if row["series"] == "environments" and int(row["threads"]) == 2:
            own = row["form"], row["precision"]
            largest[own] = max(largest.get(own, row), row, key=lambda r: int(r["environments"]))
    for (form, precision), row in largest.items():
        ratio, q1, q3 = (float(row[key]) for key in ("ratio", "ratio_q1", "ratio_q3"))
        yield form, precision, int(row["environments"]), f"{ratio:.2f} ({q1:.2f} to {q3:.2f})"
