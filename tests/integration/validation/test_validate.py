"""Test `meeframe validate`: outcomes, written files, broken cases, and the report in a browser."""

import importlib.util
import io
import json
import re
import shutil
import signal
import subprocess
import sys
from dataclasses import replace
from html import escape
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console
from typer.testing import CliRunner

from meeframe.cli import app
from meeframe.common.errors import CaseError, ResultError
from meeframe.results.output import locked
from meeframe.study.reports.validation import CaseReport, Row, Validation
from meeframe.study.reports.validation_page import page
from meeframe.study.reports.validation_table import validation_json, validation_table
from meeframe.study.validate import Check, Claim, Curve, Map, Plot, Skip, Verdict, validate

FOLDER = Path(__file__).parents[3] / "validation"
_spec = importlib.util.spec_from_file_location("trust", FOLDER / "trust.py")
trust = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(trust)

CHECKS = """
from meeframe.study.validate import Check, Claim, Curve, Map, Plot, Skip
import beside, shared
TITLE = "A case"
SOURCE = "A <source> & more"

def run(quick):
    yield Check("first", beside.VALUE, shared.VALUE, 0.01, "N")
    yield Plot("A plot </script><b>", "x", "y", (Curve("line", [1.0, 2.0, 3.0], [1.0, float("nan"), 2.0]),), log_x=True)
    yield Map("Two fields", "x", "y", "u", [0.0, 1.0], [0.0, 1.0, 2.0], {"one": [[1, 2]] * 3, "two": [[3, 4]] * 3})
    {more}
"""


def make_case(folder, name="one", more="", value="1.005"):
    position = folder / name
    position.mkdir(parents=True)
    (folder / "shared.py").write_text("VALUE = 1.0\n")
    (position / "beside.py").write_text(f"VALUE = {value}\n")
    (position / "checks.py").write_text(CHECKS.replace("{more}", more))
    return folder


def command(*arguments):
    """Return exit status, standard output and standard error."""
    result = CliRunner().invoke(app, ["validate", *map(str, arguments)])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result.exit_code, result.stdout, result.stderr


@pytest.mark.parametrize(
    ("computed", "verdict"),
    [
        (Check("", 1.009, 1.0, 0.01), "pass"),
        (Check("", 1.011, 1.0, 0.01), "fail"),
        (Check("", 0.989, 1.0, 0.01), "fail"),
        (Check("", -1.0, 1.0, 0.01), "fail"),
        (Check("", np.nan, 1.0, 0.01), "fail"),
        (Check("", np.nan, 1.0, 0.01, explained="known", explained_up_to=0.5), "fail"),
        (Check("", 3.0, 2.0, 1.5, absolute=True), "pass"),
        (Check("", 3.6, 2.0, 1.5, absolute=True), "fail"),
        (Check("", 1.4, 1.0, 0.01, explained="known", explained_up_to=0.5), "differs"),
        (Check("", 1.6, 1.0, 0.01, explained="known", explained_up_to=0.5), "fail"),
        (Check("", 0.4, 1.0, 0.01, explained="known", explained_up_to=0.5), "fail"),
        (Check("", 1.0, 1.0, 0.01, explained="known", explained_up_to=0.5), "pass"),
        (Check("", 3.0, 1.0, 0.1, absolute=True, explained="known", explained_up_to=2.5), "differs"),
        (Claim("", "", "", True), "pass"),
        (Claim("", "", "", False), "fail"),
        (Claim("", "", "", False, "known"), "fail"),
        (Claim("", "", "", False, "known", as_explained=True), "differs"),
        (Claim("", "", "", False, "", as_explained=True), "fail"),
        (Claim("", "", "", None), "not resolved"),
        (Skip("", "not there"), "skipped"),
    ],
)
def test_outcomes(computed, verdict):
    assert computed.verdict == verdict
    case = CaseReport("case", "Case", "Source", (Row(computed, 0.1),), finished=True)
    assert Validation(True, {}, (case,), planned=1).passed is (verdict != "fail")
    assert not Validation(True, {}, (case,), planned=2).passed
    assert not Validation(True, {}, (replace(case, finished=False),), planned=1).passed


@pytest.mark.parametrize(
    ("numbers", "words"),
    [
        ((1.0, 0.0, 0.1), "absolute = True"),
        ((1.0, np.nan, 0.1), "finite"),
        ((1.0, 1.0, -0.1), "tolerance >= 0"),
        ((None, 1.0, 0.1), "computed = None; allowed: a real number"),
        ((1.0 + 1.0j, 1.0, 0.1), r"computed = \(1\+1j\); allowed: a real number"),
        ((np.ones(2), 1.0, 0.1), r"computed = array\(\[1., 1.\]\); allowed: a real number"),
        ((1.0, "1", 0.1), "reference = '1'; allowed: a real number"),
    ],
)
def test_incomparable_values_are_rejected(numbers, words):
    with pytest.raises(CaseError, match=f"check 'name': .*{words}"):
        Check("name", *numbers)


@pytest.mark.parametrize("bound", [0.0, 0.1, np.inf, np.nan])
def test_explanation_has_a_bound(bound):
    with pytest.raises(CaseError, match=r"explained_up_to = .* finite numbers above the tolerance 0.1"):
        Check("name", 1.0, 1.0, 0.1, explained="known", explained_up_to=bound)
    with pytest.raises(CaseError, match="explained = 3; allowed: a text"):
        Check("name", 1.0, 1.0, 0.1, explained=3)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Claim("c", "f", "j", 1.0), "claim 'c': holds = 1.0; allowed: True, False or None"),
        (lambda: Claim("c", 3, "j", True), "claim 'c': observed = 3; allowed: a text"),
        (lambda: Skip("s", None), "reason = None; allowed: a text"),
        (lambda: Curve("c", np.ones(3), np.ones(4)), r"curve 'c': y is float64 \(4,\); allowed: real numbers \(3,\)"),
        (lambda: Curve("c", np.ones((2, 2)), np.ones(4)), r"x is float64 \(2, 2\); allowed: real numbers \(4,\)"),
        (lambda: Curve("c", [], []), "at least one"),
        (lambda: Curve("c", [1.0], [1.0j]), "y is complex128"),
        (lambda: Curve("c", [1.0], [None]), "y is object"),
        (lambda: Plot("p", "x", "y", ()), "plot 'p': curves = .*at least one Curve"),
        (lambda: Plot("p", "x", "y", ("line",)), "plot 'p': curves = .*at least one Curve"),
        (
            lambda: Map("m", "x", "y", "u", [0, 1], [0, 1, 2], {"f": np.ones((2, 3))}),
            r"field 'f' is .*\(2, 3\).*\(3, 2\)",
        ),
        (lambda: Map("m", "x", "y", "u", [0, 1], [0], {"f": [[np.nan, np.nan]]}), "map 'm': no finite value"),
        (lambda: Map("m", "x", "y", "u", [0, 1], [0], {}), "map 'm': no finite value"),
        (lambda: Map("m", "x", "y", "u", [0, 1], [0, 1], {"f": [[1, 2], [3]]}), r"is object \(2,\)"),
    ],
)
def test_items_of_other_kinds_or_shapes_are_rejected(make, words):
    with pytest.raises(CaseError, match=words):
        make()


def test_passing_case_and_its_files(tmp_path):
    cases = make_case(tmp_path / "cases")
    status, out, _ = command("--validation", cases, "--out", tmp_path / "out", "--quick")
    assert status == 0
    for words in ("one", "first", "1.005 N", "1 N", "+0.5 %", "1 %", "pass", "quick validation, 1 of 1 cases: 1 pass"):
        assert words in out
    data = json.loads((tmp_path / "out" / "validation.json").read_text())
    assert data["passed"] is True
    assert data["quick"] is True
    ((check,),) = (case["checks"] for case in data["cases"])
    assert check["difference"] == pytest.approx(0.005)
    assert (check["unit"], check["verdict"], check["tolerance"]) == ("N", "pass", 0.01)
    assert "meeframe" in data["versions"]


def test_failing_check_gives_status_1_and_others_run(tmp_path):
    cases = make_case(tmp_path / "cases", "a", value="1.02")
    make_case(cases, "b")
    status, out, _ = command("--validation", cases, "--out", tmp_path / "out")
    assert status == 1
    assert "full validation, 2 of 2 cases: 1 pass, 1 fail" in out
    status, out, _ = command("--validation", cases, "--out", tmp_path / "out", "--only", "b")
    assert status == 0
    assert "1 of 1 cases" in out


NAMES = "from meeframe.study.validate import Check, Curve\nTITLE = SOURCE = 'x'\n"


@pytest.mark.parametrize(
    ("source", "words"),
    [
        ("raise RuntimeError('no convergence')", "no convergence"),
        ("TITLE = 'x'", "SOURCE is missing"),
        ("TITLE = SOURCE = 'x'\ndef run(quick):\n    yield from ()", "checks nothing"),
        ("def", "SyntaxError"),
        ("import sys\nsys.exit(0)", "SystemExit"),
        (f"{NAMES}def run(quick):\n    import sys\n    sys.exit(0)\n    yield", "SystemExit"),
        (f"{NAMES}def run(quick):\n    yield 'what'", "yields 'what'; allowed: Check, Claim, Skip, Plot, Map"),
        (f"{NAMES}def run(quick):\n    yield None", "yields None"),
        (f"{NAMES}def run(quick):\n    return 3", "not iterable"),
        (f"{NAMES}def run(quick):\n    yield Check('c', None, 1.0, 0.1)", "computed = None"),
        (f"{NAMES}def run(quick):\n    yield Curve('c', [1, 2, 3], [1, 2, 3, 4])", "curve 'c': y is"),
    ],
)
def test_broken_case_is_an_error_and_others_run(tmp_path, source, words):
    cases = make_case(tmp_path / "cases", "b")
    (cases / "a").mkdir()
    (cases / "a" / "checks.py").write_text(source)
    status, out, _ = command("--validation", cases, "--out", tmp_path / "out")
    assert status == 1
    assert "1 pass, 0 fail, 1 error" in out
    broken, whole = json.loads((tmp_path / "out" / "validation.json").read_text())["cases"]
    assert words in broken["error"]
    assert whole["checks"][0]["verdict"] == "pass"
    assert escape(words) in (tmp_path / "out" / "report.html").read_text()


def test_finished_checks_survive_an_interruption(tmp_path):
    cases, out = make_case(tmp_path / "cases", more="raise KeyboardInterrupt"), tmp_path / "out"
    out.mkdir()
    (out / "report.html").write_text("of an earlier run")
    status, _, err = command("--validation", cases, "--out", out)
    assert status == 130
    assert f"0 of 1 cases finished; results so far are in {out / 'validation.json'}" in err
    data = json.loads((out / "validation.json").read_text())
    assert [check["name"] for check in data["cases"][0]["checks"]] == ["first"]
    assert sorted(path.name for path in out.iterdir()) == ["validation.json"]


KILLED = "import os, signal; os.kill(os.getpid(), signal.SIGKILL)"


@pytest.mark.full
def test_killed_validation_has_not_passed(tmp_path):
    cases, out = make_case(tmp_path / "cases", "a"), tmp_path / "out"
    make_case(cases, "b", more=KILLED)
    words = [sys.executable, "-m", "meeframe", "validate", "--validation", str(cases), "--out", str(out)]
    assert subprocess.run(words, capture_output=True, check=False).returncode == -signal.SIGKILL
    data = json.loads((out / "validation.json").read_text())
    assert data["passed"] is False
    assert [(case["name"], case["finished"]) for case in data["cases"]] == [("a", True), ("b", False)]
    assert "full validation, 1 of 2 cases: 1 pass, 0 fail" in (out / "report.html").read_text()
    with pytest.raises(ValueError, match="b: not run to the end"):
        trust.joined([trust.read(data)])


def test_report_names_cases_that_were_not_run(tmp_path):
    cases = make_case(tmp_path / "cases", "hertz")
    assert command("--validation", cases, "--out", tmp_path / "out")[0] == 0
    validation = trust.joined([trust.read(json.loads((tmp_path / "out" / "validation.json").read_text()))])
    assert not validation.passed
    head = trust.pages(validation)["trust.md"].partition("|")[0]
    assert f"Full validation, 1 of {len(trust.known_cases(FOLDER))} cases" in head
    assert "Not run: cone, " in head
    assert " hertz" not in head.partition("Not run")[2]


def test_example_of_the_page_runs(tmp_path):
    text = (Path(__file__).parents[3] / "docs" / "validation" / "trust.md").read_text(encoding="utf-8")
    (example,) = re.findall(r"^```python\n(.*?)^```", text, re.DOTALL | re.MULTILINE)
    make_case(tmp_path / "cases")
    (tmp_path / "cases" / "one" / "checks.py").write_text(example)
    validation = validate(tmp_path / "cases", tmp_path / "out")
    assert validation.passed
    assert len(validation.cases[0].figures) == 1


def test_modules_of_cases_are_separate(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "beside", "of somebody else")
    path = list(sys.path)
    cases = make_case(tmp_path / "cases", "a", value="1.001")
    make_case(cases, "b", value="1.002")
    validation = validate(cases, tmp_path / "out")
    assert [case.rows[0].item.computed for case in validation.cases] == [1.001, 1.002]
    assert sys.modules["beside"] == "of somebody else"
    assert "shared" not in sys.modules
    assert sys.path == path


def test_invalid_input_names_allowed_values(tmp_path):
    cases = make_case(tmp_path / "cases", "hertz")
    with pytest.raises(CaseError, match=r"unknown case 'herz'; .*hertz"):
        validate(cases, tmp_path / "out", ["herz"])
    with pytest.raises(CaseError, match="does not exist"):
        validate(tmp_path / "none", tmp_path / "out")
    with pytest.raises(CaseError, match=r"no \*/checks.py"):
        validate(tmp_path / "cases" / "hertz", tmp_path / "out")
    assert command("--validation", cases, "--only", "herz", "--out", tmp_path / "out")[0] == 2


def test_folder_in_use_is_rejected(tmp_path):
    cases, out = make_case(tmp_path / "cases"), tmp_path / "out"
    validate(cases, out)
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    with locked(out), pytest.raises(ResultError, match="out is in use: another process writes there"):
        validate(cases, out)
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before


def test_missing_plotly_names_the_extra(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "plotly.offline", None)
    status, _, err = command("--validation", make_case(tmp_path / "cases"), "--out", tmp_path / "out")
    assert status == 2
    assert "install meeframe[validation]" in err


def report():
    """Return the report of a validation with items of all kinds."""
    plot = Plot("a plot </script>", "x", "y", (Curve("c", np.array([1.0, 2.0]), np.array([np.nan, 1.0]), True),))
    field = Map("m", "x", "y", "u", np.arange(2.0), np.arange(3.0), {"f": np.ones((3, 2)), "g": np.zeros((3, 2))})
    rows = [
        Check("c & d", np.nan, 1.0, 0.1),
        Claim("says", "found", "judged", False, "known reason", True),
        Skip("s", "why"),
    ]
    rows = tuple(Row(row, 0.1) for row in rows)
    case = CaseReport("name", "Title <1>", "Source", rows, (plot, field), 1.0, finished=True)
    return Validation(False, {"meeframe": "0"}, (case,), planned=2)


def test_reasons_are_reported_and_missing_numbers_are_null():
    console = Console(width=200, record=True, file=io.StringIO())
    console.print(validation_table(report()))
    text = console.export_text()
    assert "name, says: known reason" in text
    assert "why" in text
    assert "full validation, 1 of 2 cases: 0 pass, 1 fail, 1 differs, 1 skipped" in text
    checks = json.loads(validation_json(report()))["cases"][0]["checks"]
    assert checks[0]["computed"] is None
    assert [check["verdict"] for check in checks] == ["fail", "differs", "skipped"]


class PageContent(HTMLParser):
    """Collects the external resources of a page, the text of its elements, and its plots."""

    def __init__(self):
        super().__init__()
        self.links, self.plots, self.data, self._open = [], 0, [], False

    def handle_starttag(self, tag, attrs):
        given = dict(attrs)
        self.links += [given[key] for key in ("src", "href") if key in given]
        self.plots += given.get("class") == "plot"
        self._open = given.get("type") == "application/json"

    def handle_data(self, data):
        if self._open:
            self.data.append(json.loads(data.replace("<\\/", "</")))
            self._open = False


def test_page_is_complete_and_loads_nothing():
    html = page(report(), "/* library */")
    parsed = PageContent()
    parsed.feed(html)
    assert parsed.links == ["#name"]
    assert parsed.plots == len(parsed.data) == 2
    assert parsed.data[0]["data"][0]["y"] == [None, 1.0]
    assert parsed.data[0]["layout"]["title"]["text"] == "a plot &lt;/script&gt;"
    assert len(parsed.data[1]["layout"]["updatemenus"][0]["buttons"]) == 2
    assert "Title &lt;1&gt;" in html
    assert str(Verdict.DIFFERS) in html
    assert "known reason" in html


PROBE = """<script>
window.addEventListener("load", async () => {
  const plots = [...document.querySelectorAll(".plot")];
  const [low, high] = plots[0].layout.xaxis.range;
  await Plotly.relayout(plots[0], {"xaxis.range": [low, (low + high) / 2]});
  document.title = JSON.stringify({
    drawn: plots.filter((plot) => plot.querySelector(".main-svg")).length,
    zoomed: plots[0].layout.xaxis.range[1] < high,
    loaded: performance.getEntriesByType("resource").map((entry) => entry.name),
  });
});
</script></body>"""


@pytest.mark.full
def test_every_plot_is_drawn_and_zooms_in_a_browser_without_network(tmp_path):
    browser = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if browser is None:
        pytest.skip("no Chromium installed (Debian: apt-get install chromium)")
    cases = make_case(tmp_path / "cases")
    validate(cases, tmp_path / "out")
    probed = tmp_path / "probed.html"
    html = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    probed.write_text(html.replace("</body>", PROBE), encoding="utf-8")
    flags = ["--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking", "--no-first-run"]
    flags += [f"--user-data-dir={tmp_path / 'profile'}", "--virtual-time-budget=30000", "--dump-dom"]
    dumped = subprocess.run([browser, *flags, probed.as_uri()], capture_output=True, text=True, timeout=120, check=True)
    title = re.search(r"<title>(.*?)</title>", dumped.stdout)[1]
    assert json.loads(title) == {"drawn": 2, "zoomed": True, "loaded": []}
