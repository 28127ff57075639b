#!/usr/bin/env python3
"""Sums up a CTest run: skips with their reasons, failures, and as the last line `N passed, M failed, K skipped`.

Usage: test_summary.py JUNIT.xml        (ctest --output-junit JUNIT.xml)

A program of GoogleTest, unittest or pytest that CTest runs as one test counts as its single cases. A case skipped
inside a program that passed is hence not lost. A program without a framework prints its skips in lines `SKIPPED: why`.
Parts that a build leaves out are separate tests (stiction_not_built in cmake/dependencies.cmake). Exit status 1 when
something failed or nothing ran.
"""

import argparse
import dataclasses
import io
import re
import sys
import tempfile
import xml.etree.ElementTree as ElementTree

GTEST_RAN = re.compile(r"^\[==========\] (\d+) tests? from .* ran", re.M)
GTEST_COUNT = {what: re.compile(rf"^\[ *{what} *\] (\d+) tests?", re.M) for what in ("PASSED", "FAILED", "SKIPPED")}
GTEST_REASON = re.compile(r"^(?:\S+:\d+: )?Skipped\n(.*?)\n*^\[  SKIPPED \] ", re.M | re.S)
UNITTEST_RAN = re.compile(r"^Ran (\d+) tests? in ", re.M)
UNITTEST_END = re.compile(r"^(?:OK|FAILED)(?: \((.*)\))?$", re.M)
UNITTEST_REASON = re.compile(r"\.\.\. skipped (?:'(.*)'|\"(.*)\")$", re.M)
PYTEST_KIND = r"\d+ (?:passed|failed|skipped|errors?|xfailed|xpassed|deselected|rerun|warnings?|subtests passed)"
PYTEST_END = re.compile(rf"^(?:=+ )?({PYTEST_KIND}(?:, {PYTEST_KIND})*) in [\d.]+s(?: \([\d:]+\))?(?: =+)?$", re.M)
PYTEST_REASON = re.compile(r"^SKIPPED \[(\d+)\] (?:\S*/)?(\S+?\.py)(?::\d+)?: (.*)$", re.M)
PLAIN_REASON = re.compile(r"^\s*SKIPPED: *(.*)$", re.M)
NO_REASON = "no reason given"
LAST_LINES = 25


@dataclasses.dataclass
class Count:
    """Tests of one <testcase>; `reasons` has one sentence for each that skipped."""

    passed: int = 0
    failed: int = 0
    skipped: int = 0
    reasons: list = dataclasses.field(default_factory=list)
    why_failed: str = ""

    def explained(self, output):
        """This count, its skips without a sentence explained by lines `SKIPPED: why`, if there are any."""
        plain = iter(PLAIN_REASON.findall(output))
        while len(self.reasons) < self.skipped:
            self.reasons.append(next(plain, NO_REASON))
        self.reasons = [one_line(reason) or NO_REASON for reason in self.reasons]
        return self


def one_line(text):
    return " ".join(text.split())[:200]


def count_gtest(output):
    ran = GTEST_RAN.search(output)
    if not ran:
        return None
    number = {what: int(found.group(1)) if (found := pattern.search(output)) else None
              for what, pattern in GTEST_COUNT.items()}
    failed, skipped = number["FAILED"] or 0, number["SKIPPED"] or 0
    passed = number["PASSED"] if number["PASSED"] is not None else int(ran.group(1)) - failed - skipped
    return Count(passed, failed, skipped, GTEST_REASON.findall(output))


def count_unittest(output):
    ran, end = UNITTEST_RAN.search(output), UNITTEST_END.search(output)
    if not ran or not end:
        return None
    number = dict(part.split("=") for part in (end.group(1) or "").split(", ") if "=" in part)
    failed = sum(int(number.get(what, 0)) for what in ("failures", "errors", "unexpected successes"))
    skipped = int(number.get("skipped", 0))
    # A class that skips or breaks as a whole counts as one here and as none in the tests run.
    passed = max(int(ran.group(1)) - failed - skipped, 0)
    return Count(passed, failed, skipped, [one or other for one, other in UNITTEST_REASON.findall(output)])


def count_pytest(output):
    end = PYTEST_END.search(output)
    if not end:
        return None
    number = {what: int(count) for count, what in re.findall(r"(\d+) (\w+)", end.group(1))}
    reasons = [f"{reason} [{file}]" for count, file, reason in PYTEST_REASON.findall(output) for _ in range(int(count))]
    failed = sum(number.get(what, 0) for what in ("failed", "error", "errors"))
    passed = sum(number.get(what, 0) for what in ("passed", "xfailed", "xpassed"))
    return Count(passed, failed, number.get("skipped", 0), reasons)


def count(case):
    """The Count of one <testcase>."""
    output = case.findtext("system-out") or ""
    known = count_gtest(output) or count_unittest(output) or count_pytest(output)
    if case.find("failure") is not None or case.get("status") == "fail":
        known = known or Count()
        known.failed = max(known.failed, 1)  # a crash or a timeout: no framework has counted it
        return known.explained(output)
    left_out = case.find("skipped")
    if left_out is not None or case.get("status") in {"notrun", "disabled"}:
        message = left_out.get("message", "") if left_out is not None else ""
        if message and not message.startswith("SKIP_") and case.get("status") != "disabled":
            return Count(failed=1, why_failed=message)  # its program is missing, or its needs failed
        reasons = known.reasons if known else GTEST_REASON.findall(output)
        lines = [line for line in output.splitlines() if line.strip()]
        reasons = reasons or PLAIN_REASON.findall(output) or lines[-1:]
        return Count(skipped=1, reasons=["; ".join(dict.fromkeys(map(one_line, reasons)))]).explained("")
    if known:
        return known.explained(output)
    plain = PLAIN_REASON.findall(output)
    return Count(1, 0, len(plain), plain).explained(output)


def last_lines(case):
    """Returns the last lines of a failed <testcase>: enough to find the fault where a log's end is kept."""
    return [line[:300] for line in (case.findtext("system-out") or "").splitlines() if line.strip()][-LAST_LINES:]


def summarize(path, out=sys.stdout):
    """Prints the summary of one JUnit file and returns (passed, failed, skipped)."""
    total = Count()
    skips, failures = {}, []
    for case in ElementTree.parse(path).getroot().iter("testcase"):
        one, name = count(case), case.get("name")
        total = Count(total.passed + one.passed, total.failed + one.failed, total.skipped + one.skipped)
        for reason in one.reasons:
            names = skips.setdefault(reason, {})
            names[name] = names.get(name, 0) + 1
        if one.failed:
            failures.append((name + (f": {one.why_failed}" if one.why_failed else ""), last_lines(case)))
    if skips:
        print("skipped:", file=out)
    for reason, names in skips.items():
        print(f"  {reason}  ({', '.join(f'{name} x {n}' if n > 1 else name for name, n in names.items())})", file=out)
    if failures:
        print("failed:", file=out)
    for name, lines in failures:
        print(f"  {name}", file=out)
        for line in lines:
            print(f"    | {line}", file=out)
    print(f"{total.passed} passed, {total.failed} failed, {total.skipped} skipped", file=out)
    return total.passed, total.failed, total.skipped


# (status, output, message, passed, failed, skipped, reasons)
SAMPLES = [
    ("run", "fine", "", 1, 0, 0, []),
    ("fail", "bad", "", 0, 1, 0, []),
    ("run", "one half ran\nSKIPPED: no table", "", 1, 0, 1, ["no table"]),
    ("notrun", "x.cpp:3: Skipped\nno CUDA device\n\n[  SKIPPED ] C.c (0 ms)", "SKIP_REGULAR_EXPRESSION_MATCHED",
     0, 0, 1, ["no CUDA device"]),
    ("notrun", "\nNOT tested: no numpy\n", "SKIP_RETURN_CODE=77", 0, 0, 1, ["NOT tested: no numpy"]),
    ("notrun", "SKIPPED: not built: oneTBB (libtbb-dev)", "SKIP_REGULAR_EXPRESSION_MATCHED", 0, 0, 1,
     ["not built: oneTBB (libtbb-dev)"]),
    ("notrun", "", "SKIP_RETURN_CODE=77", 0, 0, 1, [NO_REASON]),
    ("notrun", "", "Unable to find executable", 0, 1, 0, []),
    ("disabled", "", "Disabled", 0, 0, 1, [NO_REASON]),
    ("run", "x.cpp:3: Skipped\nno file\n\n[  SKIPPED ] A.b/0, where GetParam() = 3 (0 ms)\nx.cpp:9: Skipped\n"
            "no file\n[  SKIPPED ] A.c (0 ms)\n[==========] 5 tests from 1 test suite ran. (3 ms total)\n"
            "[  PASSED  ] 3 tests.\n[  SKIPPED ] 2 tests, listed below:\n[  SKIPPED ] A.b/0\n[  SKIPPED ] A.c", "",
     3, 0, 2, ["no file"] * 2),
    ("fail", "[==========] 4 tests from 1 test suite ran. (3 ms total)\n[  PASSED  ] 2 tests.\n"
             "[  FAILED  ] 2 tests, listed below:", "", 2, 2, 0, []),
    ("run", "test_x (a.B.test_x)\nSays more ... skipped 'no numpy'\ntest_y (a.B.test_y) ... skipped \"it's off\"\n"
            "Ran 4 tests in 0.1s\n\nOK (skipped=2)", "", 2, 0, 2, ["no numpy", "it's off"]),
    ("run", "SKIPPED: no engine\n..s.\nRan 4 tests in 0.1s\n\nOK (skipped=1)", "", 3, 0, 1, ["no engine"]),
    ("fail", "Ran 4 tests in 0.1s\n\nFAILED (failures=1, errors=1, skipped=1)", "", 1, 2, 1, [NO_REASON]),
    ("run", "..s. [100%]\n=== test summary ===\nSKIPPED [2] ../python/tests/test_a.py:12: no jax: not tested\n"
            "SKIPPED [1] python/tests/test_b.py: no torch\n120 passed, 3 skipped, 1 warning in 63.20s (0:01:03)", "",
     120, 0, 3, ["no jax: not tested [test_a.py]"] * 2 + ["no torch [test_b.py]"]),
    ("fail", "=== 1 failed, 5 passed, 1 skipped, 2 errors in 0.5s ===", "", 5, 3, 1, [NO_REASON]),
    ("fail", "7 passed in 1.00s\nSegmentation fault", "", 7, 1, 0, []),
]


def self_test():
    suite, bad = ElementTree.Element("testsuite"), 0
    for number, (status, output, message, *expected) in enumerate(SAMPLES):
        case = ElementTree.SubElement(suite, "testcase", name=f"case_{number}", status=status)
        if status == "fail":
            ElementTree.SubElement(case, "failure", message="")
        elif status != "run":
            ElementTree.SubElement(case, "skipped", message=message)
        ElementTree.SubElement(case, "system-out").text = output
        one = count(case)
        found = [one.passed, one.failed, one.skipped, one.reasons]
        if found != expected:
            bad += 1
            print(f"self-test: case {number} is counted as {found}, not as {expected}")
    said = io.StringIO()
    with tempfile.NamedTemporaryFile("wb", suffix=".xml") as file:
        ElementTree.ElementTree(suite).write(file)
        file.flush()
        total = summarize(file.name, said)
    expected = tuple(sum(sample[column] for sample in SAMPLES) for column in (3, 4, 5))
    shown = ["  no file  (case_9 x 2)\n", "  no torch [test_b.py]  (case_14)\n",
             "  case_7: Unable to find executable\n", "  case_1\n    | bad\n",
             f"\n{expected[0]} passed, {expected[1]} failed, {expected[2]} skipped\n"]
    missing = [line for line in shown if line not in said.getvalue()]
    if total != expected or missing:
        bad += 1
        print(f"self-test: sums {total}, expected {expected}; not printed: {missing}")
    print(f"self-test: {len(SAMPLES)} cases, {bad} wrong")
    return 1 if bad else 0


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
