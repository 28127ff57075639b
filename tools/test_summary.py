#!/usr/bin/env python3
"""Sums up a CTest run: what was skipped and why, what failed, and as the last line `N passed, M failed, K skipped`.

Usage: test_summary.py JUNIT.xml        (ctest --output-junit JUNIT.xml)

A GoogleTest program that CTest runs as one test counts as its single cases where its output names them, so that a
case skipped inside a program that passed is not lost. Exit status 1 when something failed or nothing ran.
"""

import argparse
import collections
import re
import sys
import tempfile
import xml.etree.ElementTree as ElementTree

GTEST_RAN = re.compile(r"^\[==========\] (\d+) tests? from .* ran", re.M)
GTEST_PASSED = re.compile(r"^\[  PASSED  \] (\d+) tests?", re.M)
GTEST_FAILED = re.compile(r"^\[  FAILED  \] (\d+) tests?", re.M)
GTEST_SKIPPED = re.compile(r"^\[  SKIPPED \] (\d+) tests?", re.M)
GTEST_SKIP_REASON = re.compile(r"^(?:\S+:\d+: )?Skipped\n(.*?)\n*^\[  SKIPPED \] (\S+)", re.M | re.S)
UNITTEST_RAN = re.compile(r"^Ran (\d+) tests? in ", re.M)
UNITTEST_SKIPPED = re.compile(r"^OK \(skipped=(\d+)\)", re.M)
UNITTEST_REASON = re.compile(r"\.\.\. skipped ['\"](.*)['\"]$", re.M)


def one_line(text):
    return " ".join(text.split())[:160]


def skip_reasons(output):
    """The sentences with which a test's output explains that it skipped."""
    reasons = [one_line(match.group(1)) for match in GTEST_SKIP_REASON.finditer(output)]
    reasons += UNITTEST_REASON.findall(output)
    if not reasons:
        reasons = [one_line(line) for line in output.splitlines() if re.match(r"\s*SKIPPED:", line)]
    return reasons or ["no reason given"]


def count(case):
    """(passed, failed, skipped, reasons) of one <testcase>."""
    output = case.findtext("system-out") or ""
    if case.find("failure") is not None or case.get("status") == "fail":
        passed, failed, skipped = (GTEST_PASSED.search(output), GTEST_FAILED.search(output), GTEST_SKIPPED.search(output))
        if failed:  # a program that ended: its cases are known, and at least one failed
            return (int(passed.group(1)) if passed else 0, int(failed.group(1)),
                    int(skipped.group(1)) if skipped else 0, skip_reasons(output) if skipped else [])
        return 0, 1, 0, []
    if case.find("skipped") is not None or case.get("status") in {"notrun", "disabled"}:
        return 0, 0, 1, skip_reasons(output)
    ran, inner = GTEST_RAN.search(output), GTEST_SKIPPED.search(output)
    if ran:
        skipped = int(inner.group(1)) if inner else 0
        passed = GTEST_PASSED.search(output)
        return int(passed.group(1)) if passed else int(ran.group(1)) - skipped, 0, skipped, \
            skip_reasons(output) if skipped else []
    ran, inner = UNITTEST_RAN.search(output), UNITTEST_SKIPPED.search(output)
    if ran:
        skipped = int(inner.group(1)) if inner else 0
        return int(ran.group(1)) - skipped, 0, skipped, skip_reasons(output) if skipped else []
    return 1, 0, 0, []


def summarize(path, out=sys.stdout):
    """Prints the summary of one JUnit file and returns (passed, failed, skipped)."""
    passed = failed = skipped = 0
    reasons = collections.OrderedDict()
    failures = []
    for case in ElementTree.parse(path).getroot().iter("testcase"):
        p, f, s, why = count(case)
        passed, failed, skipped = passed + p, failed + f, skipped + s
        for reason in why:
            reasons.setdefault(reason, []).append(case.get("name"))
        if f:
            failures.append(case.get("name"))
    if reasons:
        print("skipped:", file=out)
        for reason, names in reasons.items():
            shown = ", ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else "")
            print(f"  {reason}  ({shown})", file=out)
    if failures:
        print("failed:", file=out)
        for name in failures:
            print(f"  {name}", file=out)
    print(f"{passed} passed, {failed} failed, {skipped} skipped", file=out)
    return passed, failed, skipped


SAMPLE = """<testsuite>
<testcase name="a" status="run"><system-out>fine</system-out></testcase>
<testcase name="b" status="fail"><failure message=""/><system-out>bad</system-out></testcase>
<testcase name="c" status="notrun"><skipped message=""/><system-out>x.cpp:3: Skipped
no CUDA device

[  SKIPPED ] C.c (0 ms)</system-out></testcase>
<testcase name="d" status="run"><system-out>[==========] 5 tests from 1 test suite ran. (3 ms total)
[  PASSED  ] 3 tests.
[  SKIPPED ] 2 tests, listed below:</system-out></testcase>
<testcase name="e" status="run"><system-out>test_x ... skipped 'no numpy'
Ran 4 tests in 0.1s

OK (skipped=1)</system-out></testcase>
<testcase name="f" status="fail"><failure message=""/><system-out>[==========] 4 tests from 1 test suite ran. (3 ms total)
[  PASSED  ] 2 tests.
[  FAILED  ] 2 tests, listed below:</system-out></testcase>
</testsuite>"""


def self_test():
    with tempfile.NamedTemporaryFile("w", suffix=".xml") as sample, open("/dev/null", "w", encoding="utf-8") as quiet:
        sample.write(SAMPLE)
        sample.flush()
        result = summarize(sample.name, quiet)
    expected = (1 + 3 + 3 + 2, 1 + 2, 1 + 2 + 1)
    cases = list(ElementTree.fromstring(SAMPLE).iter("testcase"))
    reason = count(cases[2])[3], count(cases[4])[3]
    good = result == expected and reason == (["no CUDA device"], ["no numpy"])
    print(f"self-test: {result}, expected {expected}; reasons {reason}")
    return 0 if good else 1


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--self-test", action="store_true")
    parser.add_argument("junit", nargs="?")
    arguments = parser.parse_args()
    if arguments.self_test:
        return self_test()
    if not arguments.junit:
        parser.error("name the file that ctest --output-junit wrote")
    passed, failed, _ = summarize(arguments.junit)
    return 1 if failed or passed == 0 else 0


if __name__ == "__main__":
    sys.exit(main())
