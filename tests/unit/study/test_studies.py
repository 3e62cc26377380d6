"""The studies of the paper's figures load, and their values agree with closed forms."""

from pathlib import Path

import numpy as np
import pytest

from meeframe.material.half_space import axisymmetric_compliance
from meeframe.model.load import case_from_tables, load_case
from meeframe.study.declare import changed, load_study
from meeframe.study.reproduce import known_studies
from meeframe.testing.closed_forms import CONDITIONS, Sphere, indent

STUDIES = known_studies(Path(__file__).parents[3] / "validation")


def test_studies_of_all_figures_exist():
    assert {f"fig-{number:02d}" for number in range(3, 15)} <= set(STUDIES)


@pytest.mark.full(except_for=4)
@pytest.mark.parametrize("name", STUDIES)
def test_first_and_last_run_and_references_load(name):
    study, tables = load_study(STUDIES[name])
    tables = changed(tables, {"mesh.divisions": 4, "mesh.rings": 2})
    for panel in study.panels:
        runs = [panel.all_runs()[position].set for position in (0, -1)]
        for changes in (*runs, *study.references.values()):
            case_from_tables(changed(tables, panel.set, changes), folder=STUDIES[name].parent)


def test_figs_3_and_4_match_the_half_space():
    case = load_case(STUDIES["fig-03"].parent / "emii.toml")
    xi = axisymmetric_compliance(case.material.stiffness)
    exact = {
        name: indent(xi, Sphere(case.indenter.radius), case.steps[0].approach, *potentials)
        for name, potentials in CONDITIONS.items()
    }
    totals = load_study(STUDIES["fig-03"])[0].quantities
    assert totals["force"] == pytest.approx(exact["EMII"].force, rel=1e-5)
    assert totals["charge"] == pytest.approx(exact["ECMII"].charge, rel=1e-5)
    assert totals["magnetic_flux"] == pytest.approx(exact["EIMCI"].magnetic_flux, rel=1e-5)
    fields = load_study(STUDIES["fig-04"])[0].quantities
    for name, value in fields.items():
        assert value == pytest.approx(getattr(exact["EMII"], name)(np.zeros(1))[0], rel=1e-4), name
