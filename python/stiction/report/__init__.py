"""One page of a run: `stiction solve --json RUN.json`, of `step` or of `scaling`, with plots. docs/howto/view.md.

    stiction report RUN.json -o report.html [--solution SOLUTION.h5]
"""

from __future__ import annotations

import argparse
import html
import json
import math
import pathlib
import sys

import numpy as np

from ..core.solution import CODES
from .scaling import series_plots
from .svg import bars, histogram, number, quantiles

__all__ = ["page"]

_SCHEMAS = (1, 2)
_QUANTILES = ("min", "median", "p90", "max")
_BINS = 24
_WANTED = "expected the JSON that `stiction solve`, `step` or `scaling` writes by --json"
_HDF5 = b"\x89HDF\r\n\x1a\n"  # how such a file begins
_STYLE = """
:root { color-scheme: light dark; --back: #fff; --front: #1c2128; --soft: #5b6673; --line: #d5dae0; --bar: #2f6fde; }
@media (prefers-color-scheme: dark) {
  :root { --back: #12161b; --front: #e4e8ee; --soft: #9aa5b1; --line: #2c343d; --bar: #6aa2ff; } }
body { margin: 2rem auto; max-width: 46rem; padding: 0 1rem; background: var(--back); color: var(--front);
  font: 16px/1.5 system-ui, sans-serif; }
h1 { font-size: 1.5rem; margin-bottom: 0; } h2 { font-size: 1.1rem; margin: 2rem 0 .5rem; } p { color: var(--soft); }
table { border-collapse: collapse; width: 100%; } td { border-top: 1px solid var(--line); padding: .25rem .5rem; }
td:first-child { color: var(--soft); width: 14rem; } code { font-size: .95em; }
svg { width: 100%; height: auto; } text { fill: var(--front); font: 13px system-ui, sans-serif; }
.tick { fill: var(--soft); font-size: 11px; } .bar { fill: var(--bar); fill-opacity: .75; }
.grid { stroke: var(--line); } .whisker { stroke: var(--bar); stroke-width: 2; } .dot { fill: var(--bar); }
"""


class ReportError(ValueError):
    """A file that is no report, in one sentence."""


def _field(report, path, kinds, is_needed=True):
    """The value at a path of keys, of one of those kinds; None where it may be missing and is."""
    value, name = report, "'" + ".".join(path) + "'"
    for key in path:
        if not isinstance(value, dict) or key not in value:
            if is_needed:
                raise ReportError(f"expected the key {name}, which is missing")
            return None
        value = value[key]
    if not isinstance(value, kinds) or isinstance(value, bool):
        names = " or ".join("null" if kind is type(None) else kind.__name__
                            for kind in (kinds if isinstance(kinds, tuple) else (kinds,)))
        raise ReportError(f"expected {names} at {name}, got {type(value).__name__}")
    return value


def _numbers(report, path, is_needed=True):
    """{name: number} at a path. Numbers that JSON cannot hold are null there, and None here."""
    found = _field(report, path, dict, is_needed)
    if found is None:
        return None
    rows = {key: _field(report, (*path, key), (int, float, type(None))) for key in found}
    return {key: value if value is None or math.isfinite(value) else None for key, value in rows.items()}


def _quantiles(report, key, is_needed=True):
    """Quantiles at a key; None where there are no environments."""
    if report.get(key, 0) is None:
        return None
    found = _numbers(report, (key,), is_needed)
    for name in _QUANTILES if found else ():
        if name not in found:
            raise ReportError(f"expected the key '{key}.{name}', which is missing")
    return {name: found[name] for name in _QUANTILES} if found else None


def _facts(report):
    """Lines of the table: the run."""
    keys = ("file", "scene", "device", "solver", "precision", "law", "form", "preconditioner", "islands", "pyramid", "environments",
            "rows", "cones", "steps", "bodies", "dt", "tolerance", "cores", "repeat", "threads", "gpu_utilisation", "sps", "quality", "effective_sps", "contacts",
            "gpu_utilisation_reason", "unconverged", "overflows", "deepest", "momentum_drift", "hash", "epoch")
    for key in keys:
        value = _field(report, (key,), (str, int, float, type(None)), is_needed=False)
        if value is not None and value != "":
            yield key.replace("_", " "), value if isinstance(value, str) else number(value)


def _section(title, note, *plots):
    shown = "".join(plot for plot in plots if plot)
    return f"<h2>{html.escape(title)}</h2><p>{html.escape(note)}</p>{shown}" if shown else ""


def _histogram(label, values, is_log, what):
    """Counts of values in bins of equal width, of logarithms if is_log."""
    values = np.asarray(values, float)
    values = values[np.isfinite(values) & ((values > 0) | (not is_log))]
    if not len(values):
        return ""
    counts, edges = np.histogram(np.log10(values) if is_log else values, bins=_BINS)
    edges = 10**edges if is_log else edges
    return histogram(label, counts.tolist(), [number(float(edge)) for edge in edges],
                     (number(float(edges[0])), number(float(edges[-1])), what))


def page(report: dict, name: str = "report", solution: dict | None = None) -> str:
    """The HTML of a report, as `--json` writes it. solution: arrays `iterations`, `residual` and `status` of the
    solution file, for histograms. Raises ReportError, a ValueError, for files that are no report.
    """
    if not isinstance(report, dict):
        raise ReportError(f"expected an object, got {type(report).__name__}")
    version = _field(report, ("schema_version",), int)
    if version not in _SCHEMAS:
        raise ReportError(f"expected schema_version {' or '.join(map(str, _SCHEMAS))}, got {version}: take the package of "
                          "that version")
    if "strong" in report:
        return _html(f"stiction scaling: {name}", report, _of_scaling(report))
    is_step = "scene" in report
    seconds = _numbers(report, ("seconds",))
    residual = _quantiles(report, "residual")
    iterations = None if is_step else _quantiles(report, "iterations")
    ended = _numbers(report, ("ended",), is_needed=is_step) if is_step else None
    answered, flags = (_numbers(report, (key,), False) for key in ("answered", "flags"))
    raised = {key: value for key, value in (flags or {}).items() if value}
    environments = _field(report, ("environments",), int)
    unit = "environment-steps" if is_step else "environments"
    parts = []
    if residual:
        parts.append(_section("Relative residual", f"Over {unit}: the line is from the least to the largest, the box from "
                              "the median to p90.",
                              quantiles("quantiles of the residual", {"residual": residual}, True)))
    if iterations:
        parts.append(_section("Iterations", "Of the solver that answered.",
                              quantiles("quantiles of iterations", {"iterations": iterations}, False)))
    if solution:
        parts += _of_solution(solution, environments)
    if ended:
        parts.append(_section("How they ended", f"Count of {unit} by code.", bars("codes", ended)))
    elif not is_step:
        unconverged = _field(report, ("unconverged",), int)
        parts.append(_section("How they ended", "Counts of environments.", bars("codes", {
            "solved": environments - unconverged, "not solved": unconverged})))
    parts.append(_section("Who answered", "Environments by solver.", bars("solvers", answered) if answered else ""))
    parts.append(_section("Flags", "Environments by flag; those that none has are left out.",
                          bars("flags", raised) if raised else ""))
    whole = {key: value for key, value in seconds.items() if key in ("wall", "cpu")}
    stages = {key: value for key, value in seconds.items() if key not in whole}
    parts.append(_section("Time by stage", "Seconds.", bars("seconds by stage", stages, "s"),
                          bars("seconds of all steps", whole, "s") if whole else ""))
    busy = _busy(report)
    parts.append(_section("Threads", "Seconds at work in sections that were shared out; the rest they waited.",
                          bars("seconds at work by thread", busy, "s") if busy else ""))
    return _html(f"stiction {'step' if is_step else 'solve'}: {name}", report, parts)


def _html(title, report, parts):
    """A page of sections under a table of the run."""
    rows = "".join(f"<tr><td>{html.escape(key)}</td><td><code>{html.escape(value)}</code></td></tr>"
                   for key, value in _facts(report))
    title = html.escape(title)
    return (f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><title>{title}</title>'
            f'<meta name="viewport" content="width=device-width"><style>{_STYLE}</style></head>\n'
            f"<body><h1>{title}</h1><table>{rows}</table>\n" + "\n".join(part for part in parts if part) +
            "\n</body></html>\n")


def _busy(report):
    """{thread: seconds at work}; empty where nothing was shared out."""
    if report.get("thread_use") is None:
        return {}
    values = _field(report, ("thread_use", "busy"), list)
    return _numbers({"busy": {f"thread {k}": value for k, value in enumerate(values)}}, ("busy",))


def _of_scaling(report):
    parts = []
    for key, title in (("strong", "Strong scaling"), ("weak", "Weak scaling")):
        points = _field(report, (key,), list, is_needed=key == "strong")
        if points:
            parts += [_section(f"{title}: {what}", note, *plots) for what, note, *plots in series_plots(points, _field)]
    return parts


def _of_solution(solution, environments):
    if any(len(solution[key]) != environments for key in ("iterations", "residual", "status")):
        raise ReportError(f"expected a solution of the report's {environments} environments, got one of "
                          f"{len(solution['status'])}")
    codes = np.bincount(np.asarray(solution["status"], int), minlength=len(CODES))
    return [_section("Environments by iterations", "Of the solution file.",
                     _histogram("histogram of iterations", solution["iterations"], False, "iterations")),
            _section("Environments by residual", "Of the solution file; residuals of zero are left out.",
                     _histogram("histogram of residuals", solution["residual"], True, "relative residual, by logarithm")),
            _section("Environments by code", "Of the solution file.",
                     bars("codes of environments", {name: int(codes[i]) for i, name in enumerate(CODES)}))]


def _read_solution(path):
    try:
        import h5py
    except ImportError:
        raise ReportError("--solution needs h5py, which is not installed: pip install h5py") from None
    with h5py.File(path, "r") as file:
        missing = [key for key in ("iterations", "residual", "status") if key not in file]
        if missing:
            raise ReportError(f"expected the dataset '{missing[0]}', which {path} has not")
        return {key: file[key][:] for key in ("iterations", "residual", "status")}


def _no_constant(name):
    raise ReportError(f"expected JSON, got {name}, which JSON has not")


def _read(path):
    """Returns the content of a JSON file. A recorded batch, which is easily taken for a report, is detected."""
    given = path.read_bytes()
    if given.startswith(_HDF5):
        raise ReportError(f"{_WANTED}, got an HDF5 file: `stiction inspect` and `stiction view` read a batch, and --solution "
                          "takes a solution")
    try:
        return json.loads(given.decode(), parse_constant=_no_constant, parse_int=_whole)
    except UnicodeDecodeError as error:
        raise ReportError(f"{_WANTED}, got a file that is no text from byte {error.start} on") from None
    except json.JSONDecodeError as error:
        raise ReportError(f"{_WANTED}, got text that is none: {error}") from None


def _whole(digits):
    """A whole number of JSON that fits into a float, as plots need it."""
    if len(digits) > 300:
        raise ReportError(f"expected numbers of at most 300 digits, got one of {len(digits)}")
    return int(digits)


def _check_out(out, inputs):
    """Refuses a page in the place of its source."""
    for path in inputs:
        if out.exists() and path.exists() and out.samefile(path):
            raise ReportError(f"the page would overwrite {path}; choose another --out")


def main(arguments=None, program="stiction report") -> int:
    """The command `stiction report`. Returns the exit status."""
    parser = argparse.ArgumentParser(prog=program,
                                     description="Makes one HTML page of a report of stiction solve, step or scaling --json.")
    parser.add_argument("run", type=pathlib.Path, help="the report, JSON")
    parser.add_argument("-o", "--out", type=pathlib.Path, help="the page, default: RUN with .html")
    parser.add_argument("--solution", type=pathlib.Path, help="what stiction solve -o wrote: histograms (needs h5py)")
    options = parser.parse_args(arguments)
    out = options.out or options.run.with_suffix(".html")
    try:
        _check_out(out, [options.run, *([options.solution] if options.solution else [])])
        report = _read(options.run)
        solution = _read_solution(options.solution) if options.solution else None
        out.write_text(page(report, options.run.name, solution), encoding="utf-8")
    except (OSError, ValueError, RecursionError) as error:
        print(f"stiction.report: {options.run}: {' '.join(str(error).split())}", file=sys.stderr)
        return 2
    print(f"report: {out}")
    return 0
