"""Statistics of solves, loggers for a training run, files of failures; a progress bar.

    solver = stiction.Solver(callback=stiction.monitor.CsvLogger("solves.csv"))
    solver.stats()  # totals since the solver was made
"""

import csv
import json

import numpy as np

from .core.progress import Progress  # noqa: F401
from .core.statistics import WINDOW, Statistics, quantiles, spans_by_kind, summary  # noqa: F401


class CsvLogger:
    """A callback that writes one line per solve. Columns are those of the first."""

    def __init__(self, path):
        self._file = open(path, "w", newline="", encoding="utf-8")
        self._writer = None

    def __call__(self, stats):
        if self._writer is None:
            self._writer = csv.DictWriter(self._file, list(stats), extrasaction="ignore")
            self._writer.writeheader()
        self._writer.writerow(stats)
        self._file.flush()

    def close(self):
        """Closes the file."""
        self._file.close()


class JsonLogger:
    """A callback that writes one JSON object per line and solve; numbers that are not finite are null."""

    def __init__(self, path):
        self._file = open(path, "w", encoding="utf-8")

    def __call__(self, stats):
        finite = {name: value if np.isfinite(value) else None for name, value in stats.items()}
        self._file.write(json.dumps(finite, allow_nan=False) + "\n")
        self._file.flush()

    def close(self):
        """Closes the file."""
        self._file.close()
