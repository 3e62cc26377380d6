"""Texts of users appear literally in terminals and pages."""

import dataclasses
import io
import json
import re
from html import unescape
from html.parser import HTMLParser

import numpy as np
import pytest
from rich.console import Console

from meeframe.cli import console
from meeframe.results.records import Provenance
from meeframe.results.summary import summary_table
from meeframe.results.sweep_records import SweepAxis, SweepResult
from meeframe.study.reports.compare import ComparedRun, Comparison, comparison_table
from meeframe.study.reports.sweep import sweep_table
from meeframe.study.reports.validation import CaseReport, Check, Curve, Plot, Row, Validation
from meeframe.study.reports.validation_page import page
from meeframe.study.reports.validation_table import validation_table
from meeframe.study.reports.verified import Verification, VerifiedRun
from meeframe.study.reports.verify import verification_table

TEXTS = ("[bold]loud[/bold]", "[/red]", "<script>alert(1)</script>", ":warning: a & b", "[link=x]")


def render(table, out=None):
    """Return the output of a console that interprets markup, or of a given console."""
    file = io.StringIO()
    out = out or Console(file=file, width=200)
    out.file = file
    out.print(table)
    return file.getvalue()


@pytest.mark.parametrize("text", TEXTS)
def test_on_the_terminal(synthetic, text):
    step = dataclasses.replace(synthetic.step(1e-6), message=text)
    result = dataclasses.replace(synthetic.result(step), provenance=Provenance(text, "", {}, 1))
    runs = (
        ComparedRun({"solver": text}, synthetic.zone(), 1, (step,)),
        ComparedRun({"solver": "b"}, synthetic.zone(), 1, refusal=text),
    )
    tables = [summary_table(result), comparison_table(Comparison(text, "", {}, runs))]
    tables.append(
        verification_table(Verification(text, "", {}, {}, runs=(VerifiedRun(text, 0.1, 4, "stalled", text),)))
    )
    texts = np.array(["not-converged"]), np.array([text]), np.array(["key"])
    names = ("normal_force", "contact_area", "max_pressure", "max_abs_electric_potential")
    quantities = {name: np.ones(1) for name in (*names, "residual")}
    axes = (SweepAxis(text, (text,)),)
    tables.append(sweep_table(SweepResult(text, axes, quantities, dict.fromkeys(names, "1"), *texts)))
    tables.append(validation_table(Validation(False, {}, (report(text),), planned=1)))
    for table in tables:
        assert render(table).count(text) >= 1
        assert render(table, console.stdout()).count(text) >= 1


def report(text):
    check = Check(text, 1.0, 1.0, 0.1, "m")
    figure = Plot(text, text, text, (Curve(text, np.arange(3.0), np.arange(3.0)),), note=text)
    return CaseReport(text, text, text, (Row(check, 0.1),), (figure,), error=text, finished=True)


class Page(HTMLParser):
    """Collects the scripts of a page and its text outside of them."""

    def __init__(self, text):
        super().__init__()
        self.scripts, self.text, self.inside = [], "", False
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        self.inside = tag == "script"
        if self.inside:
            self.scripts.append("")

    def handle_endtag(self, tag):
        self.inside = False

    def handle_data(self, data):
        if self.inside:
            self.scripts[-1] += data
        else:
            self.text += data


@pytest.mark.parametrize("text", [*TEXTS, "<!--<script>", '" onclick="alert(1)'])
def test_in_pages(text):
    content = Page(page(Validation(False, {"plugin": text}, (report(text),), planned=1), "LIBRARY"))
    assert len(content.scripts) == 3
    assert content.text.count(text) >= 6
    drawn = json.loads(content.scripts[1])
    assert unescape(drawn["layout"]["title"]["text"]) == text
    assert "<" not in drawn["layout"]["title"]["text"]
    assert not re.search(r"<script>alert", content.text.replace(text, ""))
