"""Notebooks of docs/notebooks; the documentation build runs them, and these tests check their form."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "docs" / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.py"))
each_notebook = pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)


def test_there_are_notebooks():
    assert len(NOTEBOOKS) >= 8


@each_notebook
def test_it_says_what_readers_learn_and_where_to_go_next(notebook):
    text = notebook.read_text(encoding="utf-8")
    first, *_, last = re.split(r"^# %%.*\n", text, flags=re.MULTILINE)[1:]
    assert re.match(r"# # \w", first)
    assert re.search(r"\b[Yy]ou (also )?(learn|write|see)\b", first)
    assert last.startswith("# ## Where to go next\n")
    assert "](" in last


@each_notebook
def test_it_checks_numbers_and_labels_axes_with_units(notebook):
    text = notebook.read_text(encoding="utf-8")
    assert len(re.findall(r"^\s*assert ", text, re.MULTILINE)) >= 3
    for label in re.findall(r'[xy]label=f?"([^"]*)"', text):
        assert re.search(r" \[.+\]$", label), label


@each_notebook
def test_the_site_and_the_index_have_it(notebook):
    assert f"notebooks/{notebook.stem}.md" in (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    assert f"({notebook.name})" in (FOLDER / "index.md").read_text(encoding="utf-8")


@each_notebook
def test_links_lead_somewhere(notebook):
    for target in re.findall(r"\]\(([^)\s#]+)", notebook.read_text(encoding="utf-8")):
        assert target.startswith("http") or (FOLDER / target).exists(), target
