"""Test study files: keys, changes of cases, messages."""

import re
from pathlib import Path

import pytest

from meeframe.common.errors import CaseError
from meeframe.plugin import registry
from meeframe.study.declare import PanelTable, changed, load_study, unit_at

TABLES = {"solver": "auto", "contact": {"law": {"name": "isotropic-coulomb", "mu": 0.3}}, "steps": [{"approach": 1.0}]}

STUDY = """
title = "a study"
case = "case.toml"
kind = "curves"
quantities = { force = "base", charge = 2.0 }

[references]
base = { "contact.law" = "signorini" }

[[panels]]
title = "a panel"
axis = "friction"
vary = "contact.law.mu"
values = [0.0, 0.5, inf]
runs = [{ label = "none", set = { "contact.law" = "signorini" } }]
"""


@pytest.fixture
def write(tmp_path):
    def write(*changes):
        text = STUDY
        for old, new in changes:
            assert old in text
            text = text.replace(old, new)
        (tmp_path / "case.toml").write_text('title = "a case"\n')
        path = tmp_path / "study.toml"
        path.write_text(text)
        return path

    return write


def test_runs_of_a_study(write):
    study, tables = load_study(write())
    assert tables == {"title": "a case"}
    (panel,) = study.panels
    runs = panel.all_runs()
    assert [(run.label, run.value) for run in runs] == [("0", 0.0), ("0.5", 0.5), ("inf", float("inf")), ("none", None)]
    assert [run.set for run in runs] == [{"contact.law.mu": v} for v in panel.values] + [{"contact.law": "signorini"}]
    assert study.quantities_of(panel) == {"force": "base", "charge": 2.0}


@pytest.mark.parametrize(
    ("value", "label", "position"),
    [
        (0.5, "0.5", 0.5),
        ("10 um", "10 um", 1e-5),
        ("-.5 GPa", "-.5 GPa", -5e8),
        ("90 deg", "90 deg", 1.5707963267948966),
        ("bar", "bar", None),  # a name, although there is a unit of that name
        ("4 widgets", "4 widgets", None),
        (True, "True", None),
        ({"kappa": 2.0, "name": "step"}, "step kappa=2.0", None),
    ],
)
def test_labels_and_positions_of_values(value, label, position):
    (run,) = PanelTable(title="a panel", vary="some.key", values=[value]).all_runs()
    assert run.label == label
    assert run.value == (None if position is None else pytest.approx(position))
    assert run.set == {"some.key": value}


def test_changes_do_not_modify_the_tables_or_each_other():
    value = {"kappa": 1.0}
    computed = changed(TABLES, {"steps[1].approach": 2.0, "conductivity.electric": value}, {"contact.law.mu": 0.9})
    assert computed["steps"] == [{"approach": 2.0}]
    assert computed["contact"] == {"law": {"name": "isotropic-coulomb", "mu": 0.9}}
    assert computed["conductivity"] == {"electric": {"kappa": 1.0}}
    computed["conductivity"]["electric"]["kappa"] = 5.0
    assert value == {"kappa": 1.0}
    assert TABLES["steps"] == [{"approach": 1.0}]
    assert TABLES["contact"]["law"]["mu"] == 0.3


def test_later_changes_replace_complete_entries():
    computed = changed(TABLES, {"contact.law.mu": 0.1}, {"contact.law": "signorini", "steps[1]": {"normal_force": 3}})
    assert computed["contact"] == {"law": "signorini"}
    assert computed["steps"] == [{"normal_force": 3}]


@pytest.mark.parametrize(
    ("key", "unit"),
    [
        ("steps[1].approach", "m"),
        ("steps[1].electric_potential", "V"),
        ("steps[1].increments", ""),
        ("steps[1].translation[1]", ""),
        ("indenter.radius", "m"),
        ("contact.law.work_of_adhesion", "J/m^2"),
        ("contact.law.mu", ""),
        ("conductivity.electric.kappa", ""),
        ("mesh.contact_width[1]", ""),
        ("material.young_modulus", ""),
        ("title", ""),
    ],
)
def test_units_of_numbers(key, unit):
    """Pure numbers, conductivities of any field, and what is neither a step nor a registered object have none."""
    tables = {
        "material": {"name": "isotropic"},
        "mesh": {"contact_width": [1e-3, 1e-3]},
        "steps": [{"translation": [0, 0]}],
        "indenter": {"name": "sphere"},
        "contact": {"law": {"name": "dugdale"}},
        "conductivity": {"electric": {"name": "step"}},
    }
    assert unit_at(key, tables, registry.load()) == unit


@pytest.mark.parametrize(
    ("key", "text"),
    [
        ("solver.tolerance", "solver.tolerance: leads into 'auto', not into a table"),
        ("steps[2].approach", "steps[2].approach: there is 1 entry only"),
        ("steps[2]", "steps[2]: there is 1 entry only"),
        ("steps.approach", "steps.approach: leads into a list, not into a table"),
        ("contact[1]", "contact[1]: leads into a table, not into a list"),
    ],
)
def test_changes_of_unknown_keys(key, text):
    with pytest.raises(CaseError) as caught:
        changed(TABLES, {key: 1})
    assert text in str(caught.value)


WRONG = {
    "unknown key": (("axis =", "axes ="), "panels[1].axes = 'friction': unknown key; did you mean 'axis'?"),
    "unknown kind": (('"curves"', '"curve"'), "kind = 'curve'"),
    "unknown quantity": (("charge = 2.0", "charges = 2.0"), "unknown quantity 'charges'; did you mean 'charge'?"),
    "nodal quantity": (("charge = 2.0", "pressure = 2.0"), "unknown quantity 'pressure'"),
    "total on a map": (('"curves"', '"maps"'), "unknown quantity 'force'"),
    "unknown reference": (('"base"', '"bass"'), "unknown reference 'bass'; did you mean 'base'?"),
    "no values": (("values = [0.0, 0.5, inf]", ""), "vary and values belong together"),
    "no key": (('"contact.law.mu"', '"contact..mu"'), "'contact..mu' is not a key of a case file"),
    "too long": (('"contact.law.mu"', f'"{"a." * 5000}mu"'), "is not a key of a case file"),
    "too large": (('"contact.law" =', f'"steps[{"9" * 5000}]" ='), "is not a key of a case file"),
    "counts from 0": (('"contact.law" =', '"steps[0]" ='), "'steps[0]' is not a key of a case file"),
    "no TOML": (("[references]", "[references"), "is not a TOML file"),
    "no case": (('"case.toml"', '"absent.toml"'), "absent.toml: cannot be read"),
    "nothing shown": (('{ force = "base", charge = 2.0 }', "{}"), "panel 'a panel' shows no quantities"),
}


@pytest.mark.parametrize("kind", WRONG)
def test_invalid_studies(write, kind):
    change, text = WRONG[kind]
    with pytest.raises(CaseError) as caught:
        load_study(write(change))
    assert text in str(caught.value)
    assert "study.toml: " in str(caught.value)


def test_maps_that_show_different_quantities(write):
    changes = [('"curves"', '"maps"'), ('{ force = "base", charge = 2.0 }', '{ pressure = "base" }')]
    path = write(*changes)
    more = '\n[[panels]]\ntitle = "other"\nquantities = { stick = 1.0 }\nruns = [{ label = "one" }]\n'
    path.write_text(path.read_text() + more)
    with pytest.raises(CaseError, match="maps: all panels must show the same quantities"):
        load_study(path)


def test_documented_study(tmp_path):
    page = Path(__file__).parents[3] / "docs" / "howto" / "reproduce.md"
    (example,) = re.findall(r"```toml\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)
    (tmp_path / "emii.toml").write_text("")
    (tmp_path / "study.toml").write_text(example, encoding="utf-8")
    study, _ = load_study(tmp_path / "study.toml")
    (panel,) = study.panels
    assert [run.label for run in panel.all_runs()] == ["0", "0.1", "0.3", "no friction"]
    assert study.quantities_of(panel) == {"force": "frictionless"}


def test_panel_without_runs(write):
    with pytest.raises(CaseError, match="nothing to run"):
        load_study(write(('vary = "contact.law.mu"\nvalues = [0.0, 0.5, inf]\n', ""), ("runs = [{", "# runs = [{")))
