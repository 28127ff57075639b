"""What docs/python.md shows is what happens."""

import re

from conftest import ROOT
from test_mistakes import MISTAKES

PAGE = (ROOT / "docs" / "python.md").read_text(encoding="utf-8")


def test_the_quickstart_runs():
    block = re.search(r"```python\n(.*?)```", PAGE, re.DOTALL).group(1)
    names = {}
    exec(compile(block, "docs/python.md", "exec"), names)
    assert names["solution"].solved.all()
    assert abs(names["solution"].lambda_[1, 1] + 0.5 * 9.81) < 1e-3


def test_messages_in_the_table_are_those_that_come():
    table = re.findall(r"^\| ([^|]+) \| `([^`]+)` \|$", PAGE.partition("## Mistakes")[2], re.MULTILINE)
    assert len(table) > 10
    said = []
    for _, _, call in MISTAKES.values():
        try:
            call()
        except Exception as error:  # of any type: what it says is looked for here
            said.append(str(error))
    elsewhere = ("a device that is not there", "a batch on another device", "a gradient")
    for mistake, message in table:
        if mistake in elsewhere:
            continue
        parts = [part for part in message.split("...") if part.strip()]
        assert any(all(part.strip() in text for part in parts) for text in said), message
