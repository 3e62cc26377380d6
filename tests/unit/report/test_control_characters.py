"""Texts of others with control characters: they reach no terminal, and titles are no markup."""

import dataclasses

import pytest
from typer.testing import CliRunner

from meeframe.cli import app, console
from meeframe.common.errors import CaseError
from meeframe.common.literal import printable
from meeframe.results.files import write_result
from meeframe.results.records import Provenance

HOSTILE = "a\x1b]0;owned\x07b\x9b31m c\x7f \u202etxt.exe"
SHOWN = r"a\x1b]0;owned\x07b\x9b31m c\x7f \u202etxt.exe"


def test_printable_texts_are_unchanged():
    text = "contact pressure [Pa]\n\tν = 0.3, µm, 界面, \\x1b"
    assert printable(text) == text


@pytest.mark.parametrize(
    ("title", "shown"), [(HOSTILE, SHOWN.replace(r"\x07", "")), ("[/reload]", "[/reload]"), ("[mm]", "[mm]")]
)
def test_titles_of_results(tmp_path, synthetic, title, shown):
    step = dataclasses.replace(synthetic.step(1e-6), message=title)
    result = dataclasses.replace(synthetic.result(step), provenance=Provenance(title, "", {}, 1))
    write_result(tmp_path, result)
    done = CliRunner().invoke(app, ["show", str(tmp_path)])
    assert done.exit_code == 0
    assert done.stdout.count(shown) == 2  # title and message; rich drops bells
    assert done.stdout.replace("\n", "").isprintable()


def test_errors_and_warnings(capsys):
    with pytest.raises(BaseException), console.exit_status():  # noqa: B017, PT011  # the exit of typer
        raise CaseError(f"case.toml: {HOSTILE}: unknown key")
    console.warn(HOSTILE)
    assert capsys.readouterr().err == f"error: case.toml: {SHOWN}: unknown key\nwarning: {SHOWN}\n"


def test_names_in_case_files(tmp_path):
    path = tmp_path / "case.toml"
    path.write_text('"\\u001b[31mred" = 1\n', encoding="utf-8")
    done = CliRunner().invoke(app, ["check", str(path)])
    assert done.exit_code == 2
    assert "\x1b" not in done.output
    assert r"\x1b[31mred" in done.output
