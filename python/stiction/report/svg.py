"""Plots of a report, as SVG text. Colours are the page's, so that they follow light and dark."""

import html
import math

_WIDTH, _LEFT, _ROW = 640, 150, 26


def number(value) -> str:
    """A number as it is read: three digits, no more."""
    if value is None:
        return "not finite"
    if isinstance(value, int) or (float(value).is_integer() and abs(value) < 1e6):
        return f"{int(value):,}".replace(",", " ")
    return f"{value:.3g}"


def _svg(height, label, body):
    return (f'<svg viewBox="0 0 {_WIDTH} {height}" role="img" aria-label="{html.escape(label, quote=True)}">'
            + "".join(body) + "</svg>")


def _text(x, y, text, kind="", anchor="start"):
    return f'<text x="{x:.1f}" y="{y:.1f}" class="{kind}" text-anchor="{anchor}">{html.escape(text)}</text>'


def bars(label, values, unit="") -> str:
    """Horizontal bars of {name: number}, in their order. Values that are not finite have no bar."""
    largest = max([value for value in values.values() if value is not None], default=0) or 1
    body, room = [], _WIDTH - _LEFT - 90
    for i, (name, value) in enumerate(values.items()):
        y, length = i * _ROW + 4, 0.0 if value is None else max(0.0, room * value / largest)
        shown = number(value) + (f" {unit}" if unit and value is not None else "")
        body += [_text(_LEFT - 8, y + 13, name, "name", "end"),
                 f'<rect x="{_LEFT}" y="{y}" width="{length:.1f}" height="18" rx="3" class="bar"/>',
                 _text(_LEFT + length + 6, y + 13, shown, "value")]
    return _svg(len(values) * _ROW + 4, label, body)


def quantiles(label, values, is_log) -> str:
    """A line from the smallest to the largest, a box from median to p90, of {name: {min, median, p90, max}}."""
    known = [value for row in values.values() for value in row.values() if value is not None]
    positive = [value for value in known if value > 0]
    if is_log:
        low = math.floor(math.log10(min(positive))) if positive else -1
        high = math.ceil(math.log10(max(positive))) if positive else 0
        low = max(low, high - 24) - (len(positive) < len(known))  # one more, where zero stands
        high = max(high, low + 1)
    else:
        low, high = 0, max(known, default=0) or 1
    room = _WIDTH - _LEFT - 40

    def place(value):
        at = (math.log10(value) if value > 0 else low) if is_log else value
        return _LEFT + room * min(1.0, max(0.0, (at - low) / (high - low)))

    body, height = [], len(values) * 46 + 30
    step = max(1, math.ceil((high - low) / 8)) if is_log else high / 4
    tick = low
    while tick <= high + 1e-9:
        x = _LEFT + room * (tick - low) / (high - low)
        name = number(tick) if not is_log else "0" if tick == low and len(positive) < len(known) else f"1e{tick}"
        body += [f'<line x1="{x:.1f}" x2="{x:.1f}" y1="4" y2="{height - 24}" class="grid"/>',
                 _text(x, height - 8, name, "tick", "middle")]
        tick += step
    for i, (name, row) in enumerate(values.items()):
        y = i * 46 + 26
        body.append(_text(_LEFT - 8, y + 4, name, "name", "end"))
        if any(row[key] is None for key in ("min", "median", "p90", "max")):
            body.append(_text(_LEFT, y + 4, ", ".join(f"{key} {number(row[key])}" for key in row), "value"))
            continue
        least, half, most, last = (place(row[key]) for key in ("min", "median", "p90", "max"))
        body += [f'<line x1="{least:.1f}" x2="{last:.1f}" y1="{y}" y2="{y}" class="whisker"/>',
                 f'<rect x="{half:.1f}" y="{y - 8}" width="{max(most - half, 2):.1f}" height="16" rx="3" class="bar"/>']
        body += [f'<circle cx="{x:.1f}" cy="{y}" r="4" class="dot"><title>{key} {number(row[key])}</title></circle>'
                 for key, x in (("min", least), ("median", half), ("p90", most), ("max", last))]
    return _svg(height, label, body)


def lines(label, xs, rows, name) -> str:
    """Lines of {name: numbers at xs} over xs, which ascend from above zero: both axes from zero, a tick at every x.
    name: label of x. A number that is None breaks its line.
    """
    known = [value for row in rows.values() for value in row if value is not None]
    top, right, room, height = max(known, default=0) or 1, max(xs), _WIDTH - _LEFT - 130, 240
    across = [_LEFT + room * x / right for x in xs]

    def up(value):
        return height - 40 - (height - 60) * max(0.0, value) / top

    body = []
    for x, at in zip(xs, across):
        body += [f'<line x1="{at:.1f}" x2="{at:.1f}" y1="20" y2="{height - 40}" class="grid"/>',
                 _text(at, height - 24, number(x), "tick", "middle")]
    for value in (0, top / 2, top):
        body += [f'<line x1="{_LEFT}" x2="{_LEFT + room}" y1="{up(value):.1f}" y2="{up(value):.1f}" class="grid"/>',
                 _text(_LEFT - 8, up(value) + 4, number(value), "tick", "end")]
    body.append(_text(_LEFT + room / 2, height - 6, name, "tick", "middle"))
    ends = []
    for k, (title, row) in enumerate(rows.items()):
        points = [(at, up(value), value) for at, value in zip(across, row) if value is not None]
        path = " ".join(f"{at:.1f},{y:.1f}" for at, y, _ in points)
        dash = "" if k == 0 else f' stroke-dasharray="{6 / k:.1f} 4"'
        body.append(f'<polyline points="{path}" fill="none" class="whisker"{dash}/>')
        body += [f'<circle cx="{at:.1f}" cy="{y:.1f}" r="4" class="dot"><title>{html.escape(title)} {number(value)}'
                 "</title></circle>" for at, y, value in points]
        ends += [(points[-1][1], points[-1][0], title)] if points else []
    lowest = -math.inf
    for y, at, title in sorted(ends):  # names under one another where lines end together
        lowest = max(y, lowest + 15)
        body.append(_text(at + 8, lowest + 4, title, "name"))
    return _svg(height, label, body)


def histogram(label, counts, edges, names) -> str:
    """Columns of counts between edges; names: of the first and last edge, and of the counted things."""
    top, room, height = max(counts, default=0) or 1, _WIDTH - 80, 180
    width = room / max(len(counts), 1)
    body = [f'<line x1="50" x2="{_WIDTH - 30}" y1="{height - 30}" y2="{height - 30}" class="grid"/>',
            _text(44, 18, number(int(top)), "tick", "end"), _text(44, height - 28, "0", "tick", "end")]
    for i, count in enumerate(counts):
        tall = (height - 44) * count / top
        body.append(f'<rect x="{50 + i * width + 1:.1f}" y="{height - 30 - tall:.1f}" width="{max(width - 2, 1):.1f}" '
                    f'height="{tall:.1f}" class="bar"><title>{edges[i]} to {edges[i + 1]}: {count}</title></rect>')
    body += [_text(50, height - 12, names[0], "tick"), _text(_WIDTH - 30, height - 12, names[1], "tick", "end"),
             _text(_WIDTH / 2, height - 12, names[2], "tick", "middle")]
    return _svg(height, label, body)
