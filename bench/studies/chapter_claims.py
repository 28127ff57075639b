#!/usr/bin/env python3
"""The numbers in the textbook chapter this project grew from, measured again: what holds and what does not.

    bench/studies/chapter_claims.py build/bin/stiction [--judge check_solution.py] [--data ../shared/data] [--quick]
                            [--results bench/results/MACHINE] [--images docs/images] [--only chain,rate,...]

Writes chapter_claims.csv (every number), chapter_claims.md (a table of claims, then tables of numbers) and rate_condition.png. Verdicts
are computed from the numbers by the rules in bench/claims/.
"""

import argparse
import pathlib
import sys
import tempfile

import measure

sys.path.append(str(pathlib.Path(__file__).resolve().parent.parent))

from claims import direct, findings, pyramids, rates, sweeps, table  # noqa: E402


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    measure.add_arguments(parser)
    parser.add_argument("--only", help="some of the groups, by name")
    arguments = parser.parse_args()
    quick = arguments.quick
    image = (arguments.results if quick else arguments.images) / "rate_condition.png"
    arguments.results.mkdir(parents=True, exist_ok=True)
    found = findings.Findings()
    with tempfile.TemporaryDirectory() as folder:
        bench = measure.Bench(arguments.stiction, arguments.judge, folder, repeats=2 if quick else 4, timeout=10)
        groups = {
            "chain": lambda: sweeps.chain(bench, found, quick),
            "counts": lambda: sweeps.typical_counts(bench, found, arguments, quick),
            "rate": lambda: rates.rates(bench, found, arguments, image, quick),
            "relaxation": lambda: sweeps.relaxation(bench, found, quick),
            "table": lambda: table.solvers(bench, found, arguments, quick),
            "tasks": lambda: table.tasks(bench, found, arguments, quick),
            "pyramids": lambda: pyramids.pyramids(bench, found, arguments, quick),
            "lemke": lambda: direct.lemke(bench, found, quick),
            "ipm": lambda: direct.interior_point(bench, found, arguments, quick),
            "islands": lambda: direct.islands(bench, found, quick),
            "ratio": lambda: sweeps.mass_ratio(bench, found, quick),
            "friction": lambda: sweeps.large_friction(bench, found, quick),
            "scaling": lambda: rates.scaling(bench, found, arguments),
            "step": lambda: direct.printed_step(found),
        }
        comments = measure.header(arguments.stiction, "studies/chapter_claims.py")
        for name in arguments.only.split(",") if arguments.only else groups:
            groups[name]()
            measure.write_table(arguments.results / "chapter_claims.csv", comments, findings.COLUMNS, found.numbers)
            (arguments.results / "chapter_claims.md").write_text(found.markdown(comments))


if __name__ == "__main__":
    main()
