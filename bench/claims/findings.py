"""What was measured (a long table of numbers) and what follows for each of the chapter's claims (a short one of sentences)."""

COLUMNS = ["claim", "problem", "setting", "quantity", "value"]


class Findings:
    def __init__(self):
        self.numbers, self.claims, self.tables = [], [], []

    def add(self, claim, problem, setting, **quantities):
        for quantity, value in quantities.items():
            text = value if isinstance(value, str) else f"{value:.6g}"
            self.numbers.append(dict(zip(COLUMNS, (claim, problem, setting, quantity, text))))

    def conclude(self, claim, section, said, measured, verdict):
        """verdict: 'holds', 'partly' or 'does not hold', computed from the numbers by the caller."""
        self.claims.append((claim, section, said, measured, verdict))
        print(f"{claim}: {verdict}. {measured}", flush=True)

    def table(self, title, head, rows):
        self.tables.append((title, head, rows))

    def markdown(self, comments):
        lines = [f"<!-- {'; '.join(comments)} -->", "", "| | section | the chapter says | measured | |", "|---|---|---|---|---|"]
        lines += [f"| {claim} | {section} | {said} | {measured} | **{verdict}** |"
                  for claim, section, said, measured, verdict in self.claims]
        for title, head, rows in self.tables:
            lines += ["", f"**{title}**", "", "| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
            lines += ["| " + " | ".join(str(cell) for cell in row) + " |" for row in rows]
        return "\n".join(lines) + "\n"


def short(value, digits=2):
    """A number as one reads it aloud; '-' where there is none."""
    if value is None or value != value or abs(value) == float("inf"):
        return "-"
    if value and not 1e-3 <= abs(value) < 1e7:
        return f"{value:.{digits - 1}e}"
    if abs(value) >= 100:
        return f"{value:.0f}"
    return f"{value:.{digits}g}"
