"""Test built-in registrations and the templates of new plugins."""

from importlib import resources
from pathlib import Path

import pytest

from meeframe.plugin.registry import Kind, load
from meeframe.plugin.sources import BUNDLED_PACKAGES
from meeframe.solvers.auto import STAGES

TEMPLATES = resources.files("meeframe.plugin") / "templates"


def test_summary_of_auto_names_its_stages_in_order():
    registry = load()
    names = {registry.get(Kind.SOLVER, name).factory: name for name in registry.names(Kind.SOLVER)}
    words = registry.get(Kind.SOLVER, "auto").summary.replace(",", "").split()
    stages = [names[type(stage.solver)] for stage in STAGES]
    assert [word for word in words if word in names.values()] == stages


@pytest.mark.parametrize("file", ["module.py.template", "test.py.template"])
@pytest.mark.parametrize("kind", [kind.value.replace(" ", "-") for kind in Kind])
def test_imports_of_templates_are_sorted(kind, file):
    lines = (TEMPLATES / kind / file).read_text(encoding="utf-8").splitlines()
    modules = [line.split()[1] for line in lines if line.startswith("from meeframe")]
    assert modules
    assert modules == sorted(modules)


def test_bundled_packages():
    folder = Path(__file__).parents[3] / "plugins"
    assert {plugin.name.replace("-", "_") for plugin in folder.iterdir() if (plugin / "pyproject.toml").exists()} == (
        BUNDLED_PACKAGES
    )
