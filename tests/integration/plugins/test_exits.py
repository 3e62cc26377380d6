"""Plugins that end the process, or raise what no `except Exception` catches."""

import textwrap

import pytest
from typer.testing import CliRunner

from meeframe.cli import app

LAW = """
    import sys
    from dataclasses import dataclass

    import numpy as np

    from meeframe.plugin import CaseError, ContactLaw, Record, hookimpl


    class Ending(BaseException):
        pass


    class Mute(BaseException):
        def __str__(self):
            sys.exit(0)


    class Dividing(ValueError):
        def __str__(self):
            return str(1 // 0)


    class Refusing(CaseError):
        def __str__(self):
            sys.exit(0)


    def end(place):
        if place == "{place}":
            {what}


    @dataclass(frozen=True)
    class Exits(ContactLaw):
        def project(self, trial):
            end("project")
            return np.minimum(trial, 0.0) * np.array([0.0, 0.0, 1.0])

        def tangential_scaling(self):
            return np.zeros((2, 2))


    @hookimpl
    def meeframe_contact_laws():
        end("hook")
        return [Record("exits", Exits, "ends the process", "nobody")]


    end("module")
"""
CASE = """
    [material]
    name = "silicon"

    [mesh]
    type = "half-space"
    contact_width = "5 mm"
    divisions = 8

    [formulation]
    name = "half-space"

    [contact]
    law = "exits"

    [indenter]
    name = "sphere"
    radius = "100 mm"

    [[steps]]
    approach = "10 um"
"""
FAILING_LINE = LAW.splitlines().index("            {what}") + 1
WHATS = {
    "sys.exit(0)": "SystemExit: 0",
    "sys.exit()": "SystemExit: ",
    "raise Ending('mine')": "Ending: mine",
    "raise GeneratorExit('late')": "GeneratorExit: late",
    "raise Mute": "Mute, whose text cannot be shown: it raises SystemExit",
    "raise Dividing": "Dividing, whose text cannot be shown: it raises ZeroDivisionError",
    "raise Refusing": "Refusing, whose text cannot be shown: it raises SystemExit",
}


@pytest.fixture
def run(tmp_path):
    """Runs the case with a law that ends the process at a place."""
    (tmp_path / "case.toml").write_text(textwrap.dedent(CASE), encoding="utf-8")

    def command(place, what):
        law = tmp_path / "law.py"
        law.write_text(textwrap.dedent(LAW).replace("{place}", place).replace("{what}", what), encoding="utf-8")
        arguments = [str(tmp_path / "case.toml"), "--out", str(tmp_path / "out"), "--plugin", str(law)]
        return CliRunner().invoke(app, ["run", *arguments]), tmp_path / "out"

    return command


@pytest.mark.parametrize(("what", "reason"), WHATS.items())
@pytest.mark.parametrize("place", ["project", "hook", "module"])
def test_a_plugin_that_ends_the_process_is_reported_as_faulty(run, place, what, reason):
    done, out = run(place, what)
    assert done.exit_code == 2
    assert f"law.py, line {FAILING_LINE}" in done.stderr
    assert reason in done.stderr
    assert "Traceback" not in done.output
    assert not (out / "result.h5").exists()


def test_a_law_that_ends_the_process_as_its_parameter_is_read(run, tmp_path, monkeypatch):
    """Results record the parameters of laws, which no code of the plugin but this one evaluates."""
    attribute = """
    limit: float = 0.0

    def __getattribute__(self, name):
        if name == "limit":
            sys.exit(0)
        return object.__getattribute__(self, name)
    """
    law = textwrap.dedent(LAW).replace("class Exits(ContactLaw):", f"class Exits(ContactLaw):{attribute}")
    monkeypatch.setattr(f"{__name__}.LAW", law)
    done, out = run("nowhere", "pass")
    assert done.exit_code == 2
    assert "law.py, line" in done.stderr
    assert "in __getattribute__: SystemExit: 0" in done.stderr
    assert "Traceback" not in done.output
    assert not (out / "result.h5").exists()


def test_the_law_by_itself_converges(run):
    done, out = run("nowhere", "pass")
    assert done.exit_code == 0
    assert (out / "result.h5").exists()


@pytest.mark.parametrize("place", ["project", "hook", "module"])
def test_an_interruption_in_a_plugin_stays_one(run, place):
    done, _ = run(place, "raise KeyboardInterrupt")
    assert done.exit_code == 130
