"""Studies solved on independent springs, whose contact has a closed form."""

import numpy as np
import pytest

from meeframe.core.errors import CaseError
from meeframe.study.solve import solve_study

STUDY = """
title = "springs"
case = "case.toml"
kind = "curves"

[references]
soft = {{ "formulation.stiffness" = 1e13 }}

[[panels]]
title = "depth"
set = {{ "solver" = {solver} }}
vary = "steps[1].approach"
values = [1e-5, 2e-5]
quantities = {quantities}
"""


@pytest.fixture
def write(write_case):
    def write(quantities='{ max_pressure = "soft" }', solver='"auto"'):
        path = write_case().parent / "study.toml"
        path.write_text(STUDY.format(quantities=quantities, solver=solver))
        return path

    return write


def test_quantities_are_divided_by_their_references(write, registry, tmp_path):
    """Pressure at the apex is stiffness times depth; the reference has a tenth of the stiffness, at 10 um."""
    study = solve_study(write('{ max_pressure = "soft", force = 2.0 }'), tmp_path / "cache", registry=registry)
    (panel,) = study.panels
    np.testing.assert_allclose(panel.quantities["max_pressure"], [10.0, 20.0], rtol=1e-9)
    assert panel.references == {"max_pressure": pytest.approx(1e8), "force": 2.0}
    np.testing.assert_array_equal(panel.values, [1e-5, 2e-5])
    assert panel.converged == (True, True)
    assert len(list((tmp_path / "cache").iterdir())) == 2  # one for each stiffness


def test_references_that_do_not_converge_count(write, registry, tmp_path):
    study = solve_study(write(solver='{ name = "uzawa", max_iterations = 1 }'), tmp_path / "cache", registry=registry)
    assert study.panels[0].converged == (False, False)
    assert study.not_converged == ("depth, 1e-05", "depth, 2e-05")


@pytest.mark.parametrize("reference", ['"soft"', "0.0"])
def test_division_by_zero_is_refused(write, registry, tmp_path, reference):
    path = write(f"{{ charge = {reference} }}")
    with pytest.raises(CaseError, match=r"study.toml: depth: charge is divided by .*, where it is 0; allowed"):
        solve_study(path, tmp_path / "cache", registry=registry)
