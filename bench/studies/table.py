"""Reads the tables that the benchmarks write: comment lines (command, machine), then CSV."""

import csv
import pathlib


def read(path):
    """(comment lines without '#', rows as dicts)."""
    lines = pathlib.Path(path).read_text().splitlines()
    comments = [line.lstrip("# ") for line in lines if line.startswith("#")]
    return comments, list(csv.DictReader(line for line in lines if not line.startswith("#")))
