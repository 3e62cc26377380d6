"""Test `meeframe example`: its cases are validated elsewhere, load, and never overwrite files."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from meeframe.cli import app
from meeframe.cli.examples import example_texts
from meeframe.model.load import load_case

ROOT = Path(__file__).parents[3]
SOURCES = {
    "adhesion": "plugins/meeframe-laws/cases/dugdale.toml",
    "emci": "validation/transversely_isotropic_indentation/emci.toml",
    "emii": "validation/transversely_isotropic_indentation/emii.toml",
    "film": "plugins/meeframe-halfspace/examples/film.toml",
    "friction-loop": "validation/load_histories/loop.toml",
    "rough": "plugins/meeframe-halfspace/examples/rough.toml",
    "two-bodies": "validation/two_bodies/equal.toml",
}


def test_every_example_is_validated():
    """The case of contact resistance has its separate test."""
    assert set(example_texts()) == {*SOURCES, "contact-resistance"}


def invoke(*arguments):
    result = CliRunner().invoke(app, list(arguments))
    return result.exit_code, result.stdout, result.stderr


@pytest.mark.parametrize("name", SOURCES)
def test_examples_are_the_validated_cases(name):
    assert example_texts()[name] == (ROOT / SOURCES[name]).read_text(encoding="utf-8")


@pytest.mark.parametrize("name", example_texts())
def test_examples_are_written_and_valid(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    status, out, err = invoke("example", name)
    assert (status, err) == (0, "")
    assert f"meeframe run {name}.toml" in out
    assert load_case(tmp_path / f"{name}.toml").steps


def test_list_names_every_example_and_its_plugin():
    status, out, _ = invoke("example")
    assert status == 0
    rows = {line.split()[0]: line for line in out.splitlines() if line}
    assert set(example_texts()) < set(rows)
    assert "meeframe-halfspace" in rows["rough"]


def test_files_are_not_overwritten(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("emii.toml").write_text("mine")
    status, _, err = invoke("example", "emii")
    assert status == 2
    assert "File exists" in err
    assert Path("emii.toml").read_text() == "mine"
    assert invoke("example", "emii", "--out", "other.toml")[0] == 0
    assert load_case(Path("other.toml")).title.endswith("EMII")


def test_unknown_example_suggests_similar_names():
    status, _, err = invoke("example", "emi")
    assert status == 2
    assert "emii" in err
