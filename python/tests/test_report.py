"""Pages of reports have the command line's numbers; files that are no report are refused in one sentence."""

import copy
import html.parser
import importlib.util
import json
import random
import subprocess
import sys
import xml.etree.ElementTree

import pytest
from conftest import DATA

import stiction
from stiction import report
from stiction.report.svg import bars, lines, number, quantiles


class Page(html.parser.HTMLParser):
    """Texts of a page, and whatever it would fetch."""

    def __init__(self, text):
        super().__init__()
        self.texts, self.fetched, self.open = [], [], []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        names = dict(attrs)
        self.fetched += [names[key] for key in ("src", "href", "xlink:href") if key in names]
        if tag in ("script", "link", "img", "iframe"):
            self.fetched.append(tag)

    def handle_data(self, data):
        self.texts.append(data.strip())


@pytest.fixture(params=["solve", "step"])
def run(request, cli, tmp_path):
    """A report of the command line, and its path."""
    path = tmp_path / f"{request.param}.json"
    what = ["solve", str(DATA / "pile.h5"), "--solver", "auto", "--tolerance", "1e-6"] if request.param == "solve" else \
        ["step", "pile", "--envs", "4", "--steps", "40"]
    subprocess.run([cli, *what, "--json", str(path), "--quiet"], check=True)
    return json.loads(path.read_text()), path


def svgs(text):
    """The plots of a page, parsed as XML."""
    pieces = text.split("<svg")[1:]
    return [xml.etree.ElementTree.fromstring("<svg" + piece.split("</svg>")[0] + "</svg>") for piece in pieces]


def test_the_page_has_the_reports_numbers(run, capsys):
    values, path = run
    assert report.main([str(path)]) == 0
    assert capsys.readouterr().out == f"report: {path.with_suffix('.html')}\n"
    text = path.with_suffix(".html").read_text(encoding="utf-8")
    page = Page(text)
    for key in ("hash", "device", "solver", "precision"):
        assert values[key] in page.texts
    shown = [plot.attrib["aria-label"] for plot in svgs(text)]
    assert shown[0] == "quantiles of the residual" and "seconds by stage" in shown
    titles = [title.text for title in svgs(text)[0].iter("title")]
    assert titles == [f"{key} {number(values['residual'][key])}" for key in ("min", "median", "p90", "max")]
    for stage, seconds in values["seconds"].items():
        assert stage in page.texts and f"{number(seconds)} s" in page.texts
    for code, count in values.get("ended", values.get("answered")).items():
        assert code in page.texts and number(count) in page.texts


def test_the_page_needs_no_network_and_follows_light_and_dark(run):
    text = report.page(run[0])
    assert Page(text).fetched == [] and "http" not in text and "url(" not in text and "@import" not in text
    assert "prefers-color-scheme: dark" in text and "color-scheme: light dark" in text
    assert "#" not in "".join(text.split("<svg")[1:]), "plots take the page's colours"


def test_lengths_of_bars_are_in_proportion():
    plot = svgs(bars("x", {"a": 2.0, "b": 1.0, "c": None, "d": 0}))[0]
    widths = [float(rect.attrib["width"]) for rect in plot.iter("rect")]
    assert widths[0] == 2 * widths[1] > 0 and widths[2:] == [0, 0]
    wide, width = svgs(bars("x", {"a": 1e30}))[0], float(plot.attrib["viewBox"].split()[2])
    assert width / 2 < float(next(wide.iter("rect")).attrib["width"]) < width


def test_boxes_are_from_the_median_to_p90():
    rows = {"r": {"min": 1e-8, "median": 1e-6, "p90": 1e-4, "max": 1.0}}
    centres = [float(dot.attrib["cx"]) for dot in svgs(quantiles("q", rows, True))[0].iter("circle")]
    gaps = [right - left for left, right in zip(centres, centres[1:])]
    assert gaps == [pytest.approx(gaps[0])] * 2 + [pytest.approx(2 * gaps[0])]
    box = next(svgs(quantiles("q", rows, True))[0].iter("rect"))
    assert float(box.attrib["x"]) == pytest.approx(centres[1], abs=0.1)
    assert float(box.attrib["width"]) == pytest.approx(gaps[1], abs=0.1)
    assert "not finite" in quantiles("q", {"r": dict(rows["r"], max=None)}, True)
    rows["r"]["min"] = 0  # which has a tick of its own, left of the decades
    plot = svgs(quantiles("q", rows, True))[0]
    ticks = [text for text in plot.iter("text") if text.attrib["class"] == "tick"]
    assert [tick.text for tick in ticks][:2] == ["0", "1e-6"]
    assert next(plot.iter("circle")).attrib["cx"] == ticks[0].attrib["x"]
    assert svgs(quantiles("q", {"r": dict.fromkeys(rows["r"], 0)}, True))


def test_lines_are_in_proportion_and_break_where_there_is_no_number():
    plot = svgs(lines("l", [1, 2, 4], {"a": [1.0, 2.0, 3.0], "b": [2.0, None, 4.0]}, "threads"))[0]
    first, second = [[tuple(map(float, point.split(","))) for point in line.attrib["points"].split()]
                     for line in plot.iter() if line.tag.endswith("polyline")]
    assert [x for x, _ in first] == [pytest.approx(first[0][0] + k * (first[1][0] - first[0][0]), abs=0.2) for k in (0, 1, 3)]
    steps = [low[1] - high[1] for low, high in zip(first, first[1:])]
    assert steps[0] > 0 and steps == [pytest.approx(steps[0], abs=0.2)] * 2, "1, 2, 3 are equally far apart, upwards"
    assert len(second) == 2 and second[0][1] == first[1][1]
    titles = [title.text for title in plot.iter("title")]
    assert titles == ["a 1", "a 2", "a 3", "b 2", "b 4"]


@pytest.fixture
def scaling(cli, tmp_path):
    """A report of stiction scaling, and its path."""
    path = tmp_path / "scaling.json"
    subprocess.run([cli, "scaling", "pile", "--envs", "4", "--steps", "3", "--threads", "2,3", "--weak", "--repeat", "1",
                    "--json", str(path), "--quiet"], check=True)
    return json.loads(path.read_text()), path


def test_the_page_of_scaling_has_its_points(scaling):
    values, path = scaling
    assert report.main([str(path)]) == 0
    text = path.with_suffix(".html").read_text(encoding="utf-8")
    plots = svgs(text)
    assert [plot.attrib["aria-label"] for plot in plots] == ["speed-up", "shares", "imbalance"] * 2
    for series, plot in (("strong", plots[0]), ("weak", plots[3])):
        titles = [title.text for title in plot.iter("title")]
        assert titles[:2] == [f"measured {number(point['speedup'])}" for point in values[series]]
        assert titles[2:] == ["perfect 1", "perfect 1.5"]
    shares = [title.text for title in plots[1].iter("title")]
    assert shares == [f"{name} {number(value)}" for name, row in (
        ("efficiency", [point["efficiency"] for point in values["strong"]]),
        ("waiting", [point["thread_use"]["synchronisation_share"] for point in values["strong"]]),
        ("serial", [point["serial_share"] for point in values["strong"]])) for value in row]
    assert values["hash"] in Page(text).texts and Page(text).fetched == []


def test_a_report_of_scaling_with_one_thing_wrong_is_told_which(scaling):
    for threads in ([1, 1], [2, 1], [0, 1]):
        changed = copy.deepcopy(scaling[0])
        for point, count in zip(changed["strong"], threads):
            point["threads"] = count
        with pytest.raises(ValueError, match="expected 'threads' that ascend"):
            report.page(changed)
    for broken in ([3], "x", {"a": 1}, [{}]):
        with pytest.raises(ValueError, match="expected"):
            report.page(dict(scaling[0], strong=broken))


def test_the_page_has_what_threads_did(run):
    values = run[0]
    busy = next(plot for plot in svgs(report.page(values)) if plot.attrib["aria-label"] == "seconds at work by thread")
    assert [text.text for text in busy.iter("text")] == [
        text for k, seconds in enumerate(values["thread_use"]["busy"]) for text in (f"thread {k}", f"{number(seconds)} s")]
    assert "seconds at work" not in report.page(dict(values, thread_use=None))


def test_histograms_of_a_solution(cli, tmp_path, capsys):
    if importlib.util.find_spec("h5py") is None:
        pytest.skip("histograms of solutions are NOT tested: pip install h5py")
    paths = [str(tmp_path / name) for name in ("r.json", "s.h5")]
    subprocess.run([cli, "solve", str(DATA / "pile.h5"), "--json", paths[0], "-o", paths[1], "--quiet",
                    "--max-iterations", "20"], check=False)
    assert report.main([paths[0], "--solution", paths[1]]) == 0
    text = (tmp_path / "r.html").read_text(encoding="utf-8")
    plots = {plot.attrib["aria-label"]: plot for plot in svgs(text)}
    counts = [int(title.text.split(": ")[1]) for title in plots["histogram of iterations"].iter("title")]
    assert sum(counts) == 40
    values = json.loads((tmp_path / "r.json").read_text())
    codes = [text.text for text in plots["codes of environments"].iter("text")]
    assert codes[codes.index("max_iterations") + 1] == str(values["unconverged"]) != "0"
    (tmp_path / "bad.h5").write_bytes(b"nothing")
    capsys.readouterr()
    assert report.main([paths[0], "--solution", str(tmp_path / "bad.h5")]) == 2
    values["environments"] = 41
    (tmp_path / "r.json").write_text(json.dumps(values))
    assert report.main([paths[0], "--solution", paths[1]]) == 2
    assert "expected a solution of the report's 41 environments, got one of 40" in capsys.readouterr().err


def test_what_is_written_in_a_report_is_text_on_the_page(run):
    values = dict(run[0], device="<script>alert(1)</script>", hash='"&<b>', seconds={"<b>": 1.0})
    text = report.page(values, "<img src=x>")
    assert "<script" not in text and "<img" not in text and "<b>" not in text
    assert "<script>alert(1)</script>" in Page(text).texts


BROKEN = ["", "{", "[]", "3", "null", "{}", '{"schema_version": 9}', '{"schema_version": "2"}', "NaN", "\x00",
          '{"schema_version": 2, "seconds": {"solve": NaN}}', "[" * 100000, '{"schema_version": true}']


@pytest.mark.parametrize("text", BROKEN, ids=range(len(BROKEN)))
def test_what_is_no_report_gets_a_sentence_and_status_2(tmp_path, text, capsys):
    path = tmp_path / "run.json"
    path.write_text(text)
    assert report.main([str(path), "-o", str(tmp_path / "o.html")]) == 2
    said = capsys.readouterr()
    assert said.out == "" and said.err.startswith(f"stiction.report: {path}: ") and said.err.count("\n") == 1
    assert not (tmp_path / "o.html").exists()


@pytest.mark.parametrize("change, said", [
    (lambda text: text.replace('"load":', '"load": NaN, "was":').replace('"wall":', '"wall": NaN, "was":'), "got NaN"),
    (lambda text: text.replace(f'"epoch": {stiction.numerics_epoch}', '"epoch": true'), "at 'epoch', got bool"),
    (lambda text: text.replace('"seconds": {', '"seconds": {"a\\nb": "x",'), "at 'seconds.a b', got str"),
    (lambda text: text.replace('"schema_version": 2', '"schema_version": 3'), "got 3: take the package of that version"),
    (lambda text: text.replace('"p90"', '"p91"'), "residual.p90', which is missing"),
])
def test_a_report_with_one_thing_wrong_is_told_which(run, tmp_path, capsys, change, said):
    path = tmp_path / "one.json"
    path.write_text(change(run[1].read_text()))
    assert path.read_text() != run[1].read_text()
    assert report.main([str(path)]) == 2
    found = capsys.readouterr().err
    assert said in found.replace("iterations.p90", "residual.p90") and found.count("\n") == 1


def test_a_batch_in_the_place_of_a_report_is_told_what_reads_it(tmp_path, capsys):
    assert report.main([str(DATA / "pile.h5"), "-o", str(tmp_path / "o.html")]) == 2
    said = capsys.readouterr()
    assert said.out == "" and said.err.count("\n") == 1 and "codec" not in said.err and "0x" not in said.err
    for word in (str(DATA / "pile.h5"), "--json", "an HDF5 file", "`stiction inspect`", "`stiction view`", "--solution"):
        assert word in said.err, word


def test_a_file_that_is_not_there_or_not_text(tmp_path, capsys):
    binary = tmp_path / "binary.json"
    binary.write_bytes(b"\xff\xfe\x80")
    for path in (tmp_path / "none.json", binary, tmp_path):
        assert report.main([str(path), "-o", str(tmp_path / "o.html")]) == 2
        assert capsys.readouterr().err.count("\n") == 1


def test_a_page_does_not_replace_its_report(run, tmp_path, capsys):
    path = tmp_path / "run.json"
    path.write_text(run[1].read_text())
    assert report.main([str(path), "-o", str(tmp_path / "." / "run.json")]) == 2
    assert "would overwrite" in capsys.readouterr().err and path.read_text() == run[1].read_text()


def mutations(values, rng, count):
    """Reports with one key removed, or with another value in its place."""
    def places(value, path=()):
        for key, inner in value.items():
            yield (*path, key)
            if isinstance(inner, dict):
                yield from places(inner, (*path, key))

    others = [None, True, -1, 0, 1e308, "x", "<b>", [], {}, [1], {"a": {"b": 1}}, -1e-300, 2**70, 10**400]
    for _ in range(count):
        changed = copy.deepcopy(values)
        path = rng.choice(list(places(values)))
        inner = changed
        for key in path[:-1]:
            inner = inner[key]
        if rng.random() < 0.3:
            del inner[path[-1]]
        else:
            inner[path[-1]] = rng.choice(others)
        yield path, changed


def test_mutated_reports_make_a_page_or_a_sentence(run, tmp_path, capsys):
    values, made, refused = run[0], 0, 0
    path = tmp_path / "mutated.json"
    for place, changed in mutations(values, random.Random(29), 400):
        path.write_text(json.dumps(changed))
        status = report.main([str(path), "-o", str(tmp_path / "o.html")])
        said = capsys.readouterr()
        if status == 0:
            made += 1
            text = (tmp_path / "o.html").read_text(encoding="utf-8")
            assert svgs(text) and "nan" not in text.replace("finance", "").lower().split("<svg", 1)[1], place
        else:
            refused += 1
            assert status == 2 and said.err.count("\n") == 1, (place, said.err)
    assert made > 50 and refused > 50, (made, refused)


def test_cut_reports_get_a_sentence(run, tmp_path, capsys):
    text = run[1].read_text()
    path = tmp_path / "cut.json"
    for length in range(0, len(text.rstrip()) - 1, 37):
        path.write_text(text[:length])
        assert report.main([str(path)]) == 2
        assert capsys.readouterr().err.count("\n") == 1


def test_it_is_a_command(run, tmp_path):
    out = tmp_path / "page.html"
    done = subprocess.run([sys.executable, "-m", "stiction", "report", str(run[1]), "-o", str(out)], capture_output=True,
                          text=True)
    assert done.returncode == 0 and not done.stderr and out.exists()
