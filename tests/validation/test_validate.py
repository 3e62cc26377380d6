"""`meeframe validate`: verdicts, what is written and when, broken cases, and the report in a browser."""

import io
import json
import re
import shutil
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console
from typer.testing import CliRunner

from meeframe.cli import app
from meeframe.core.errors import CaseError
from meeframe.report.validation import CaseReport, Row, Validation
from meeframe.report.validation_page import page
from meeframe.report.validation_table import validation_json, validation_table
from meeframe.study.validate import Check, Claim, Curve, Map, Plot, Skip, Verdict, validate

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
    place = folder / name
    place.mkdir(parents=True)
    (folder / "shared.py").write_text("VALUE = 1.0\n")
    (place / "beside.py").write_text(f"VALUE = {value}\n")
    (place / "checks.py").write_text(CHECKS.replace("{more}", more))
    return folder


def command(*arguments):
    """Exit status, standard output, standard error."""
    result = CliRunner().invoke(app, ["validate", *map(str, arguments)])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result.exit_code, result.stdout, result.stderr


@pytest.mark.parametrize(
    ("found", "verdict"),
    [
        (Check("", 1.009, 1.0, 0.01), "pass"),
        (Check("", 1.011, 1.0, 0.01), "fail"),
        (Check("", 0.989, 1.0, 0.01), "fail"),
        (Check("", -1.0, 1.0, 0.01), "fail"),
        (Check("", np.nan, 1.0, 0.01), "fail"),
        (Check("", np.nan, 1.0, 0.01, explained="known"), "fail"),
        (Check("", 3.0, 2.0, 1.5, absolute=True), "pass"),
        (Check("", 3.6, 2.0, 1.5, absolute=True), "fail"),
        (Check("", 1.5, 1.0, 0.01, explained="known"), "differs"),
        (Check("", 1.0, 1.0, 0.01, explained="known"), "pass"),
        (Claim("", "", "", True), "pass"),
        (Claim("", "", "", False), "fail"),
        (Claim("", "", "", False, "known"), "differs"),
        (Claim("", "", "", None), "not resolved"),
        (Skip("", "not there"), "skipped"),
    ],
)
def test_verdicts(found, verdict):
    assert found.verdict == verdict
    case = CaseReport("case", "Case", "Source", (Row(found, 0.1),))
    assert Validation(True, {}, (case,), planned=1).passed is (verdict != "fail")


@pytest.mark.parametrize(
    ("numbers", "words"),
    [((1.0, 0.0, 0.1), "absolute = True"), ((1.0, np.nan, 0.1), "finite"), ((1.0, 1.0, -0.1), "tolerance >= 0")],
)
def test_what_cannot_be_compared_is_refused(numbers, words):
    with pytest.raises(CaseError, match=words):
        Check("name", *numbers)


def test_passing_case_and_what_it_writes(tmp_path):
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


def test_one_failing_check_is_status_1_and_the_others_run(tmp_path):
    cases = make_case(tmp_path / "cases", "a", value="1.02")
    make_case(cases, "b")
    status, out, _ = command("--validation", cases, "--out", tmp_path / "out")
    assert status == 1
    assert "full validation, 2 of 2 cases: 1 pass, 1 fail" in out
    status, out, _ = command("--validation", cases, "--out", tmp_path / "out", "--only", "b")
    assert status == 0
    assert "1 of 1 cases" in out


@pytest.mark.parametrize(
    ("source", "words"),
    [
        ("raise RuntimeError('no convergence')", "no convergence"),
        ("TITLE = 'x'", "SOURCE is missing"),
        ("TITLE = SOURCE = 'x'\ndef run(quick):\n    yield from ()", "checks nothing"),
        ("def", "SyntaxError"),
    ],
)
def test_a_broken_case_is_an_error_and_the_others_run(tmp_path, source, words):
    cases = make_case(tmp_path / "cases", "b")
    (cases / "a").mkdir()
    (cases / "a" / "checks.py").write_text(source)
    status, out, _ = command("--validation", cases, "--out", tmp_path / "out")
    assert status == 1
    assert "1 pass, 0 fail, 1 error" in out
    broken, whole = json.loads((tmp_path / "out" / "validation.json").read_text())["cases"]
    assert words in broken["error"]
    assert whole["checks"][0]["verdict"] == "pass"
    assert words in (tmp_path / "out" / "report.html").read_text()


def test_what_was_done_before_an_interruption_is_there(tmp_path):
    cases = make_case(tmp_path / "cases", more="raise KeyboardInterrupt")
    status, _, _ = command("--validation", cases, "--out", tmp_path / "out")
    assert status == 130
    data = json.loads((tmp_path / "out" / "validation.json").read_text())
    assert [check["name"] for check in data["cases"][0]["checks"]] == ["first"]
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["validation.json"]


def test_the_example_of_the_page_is_a_case(tmp_path):
    text = (Path(__file__).parents[2] / "docs" / "trust.md").read_text(encoding="utf-8")
    (example,) = re.findall(r"^```python\n(.*?)^```", text, re.DOTALL | re.MULTILINE)
    make_case(tmp_path / "cases")
    (tmp_path / "cases" / "one" / "checks.py").write_text(example)
    found = validate(tmp_path / "cases", tmp_path / "out")
    assert found.passed
    assert len(found.cases[0].figures) == 1


def test_modules_of_one_case_are_not_those_of_another(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "beside", "of somebody else")
    path = list(sys.path)
    cases = make_case(tmp_path / "cases", "a", value="1.001")
    make_case(cases, "b", value="1.002")
    found = validate(cases, tmp_path / "out")
    assert [case.rows[0].found.computed for case in found.cases] == [1.001, 1.002]
    assert sys.modules["beside"] == "of somebody else"
    assert "shared" not in sys.modules
    assert sys.path == path


def test_bad_input_names_what_is_allowed(tmp_path):
    cases = make_case(tmp_path / "cases", "hertz")
    with pytest.raises(CaseError, match=r"unknown case 'herz'; .*hertz"):
        validate(cases, tmp_path / "out", ["herz"])
    with pytest.raises(CaseError, match="does not exist"):
        validate(tmp_path / "none", tmp_path / "out")
    with pytest.raises(CaseError, match=r"no \*/checks.py"):
        validate(tmp_path / "cases" / "hertz", tmp_path / "out")
    assert command("--validation", cases, "--only", "herz", "--out", tmp_path / "out")[0] == 2


def test_without_plotly_the_message_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "plotly.offline", None)
    status, _, err = command("--validation", make_case(tmp_path / "cases"), "--out", tmp_path / "out")
    assert status == 2
    assert "install meeframe[validation]" in err


def report():
    """A validation with everything that can be in one."""
    plot = Plot("a plot </script>", "x", "y", (Curve("c", np.array([1.0, 2.0]), np.array([np.nan, 1.0]), True),))
    field = Map("m", "x", "y", "u", np.arange(2.0), np.arange(3.0), {"f": np.ones((3, 2)), "g": np.zeros((3, 2))})
    rows = [Check("c & d", np.nan, 1.0, 0.1), Claim("says", "found", "judged", False, "known reason"), Skip("s", "why")]
    case = CaseReport("name", "Title <1>", "Source", tuple(Row(r, 0.1) for r in rows), (plot, field), 1.0)
    return Validation(False, {"meeframe": "0"}, (case,), planned=2)


def test_reasons_are_told_and_missing_numbers_are_null():
    console = Console(width=200, record=True, file=io.StringIO())
    console.print(validation_table(report()))
    text = console.export_text()
    assert "name, says: known reason" in text
    assert "why" in text
    assert "full validation, 1 of 2 cases: 0 pass, 1 fail, 1 differs, 1 skipped" in text
    checks = json.loads(validation_json(report()))["cases"][0]["checks"]
    assert checks[0]["computed"] is None
    assert [check["verdict"] for check in checks] == ["fail", "differs", "skipped"]


class Loaded(HTMLParser):
    """What a page would load from elsewhere, the text of its elements, and its plots."""

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


def test_the_page_is_whole_and_loads_nothing():
    html = page(report(), "/* library */")
    parsed = Loaded()
    parsed.feed(html)
    assert parsed.links == ["#name"]
    assert parsed.plots == len(parsed.data) == 2
    assert parsed.data[0]["data"][0]["y"] == [None, 1.0]
    assert parsed.data[0]["layout"]["title"]["text"] == "a plot </script>"
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
