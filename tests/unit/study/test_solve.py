"""Studies on independent springs agree with closed forms."""

import numpy as np
import pytest

from meeframe.common.errors import CaseError
from meeframe.study.reports.study import study_figure
from meeframe.study.solve import solve_study

STUDY = """
title = "springs"
case = "case.toml"
kind = "{kind}"

[references]
soft = {{ "formulation.stiffness" = 1e13 }}

[[panels]]
title = "depth"
set = {{ "solver" = {solver} }}
vary = "{vary}"
values = {values}
quantities = {quantities}
"""


@pytest.fixture
def write(write_case):
    def write(quantities='{ max_pressure = "soft" }', **others):
        texts = {"solver": '"auto"', "kind": "curves", "vary": "steps[1].approach", "values": "[1e-5, 2e-5]"} | others
        path = write_case().parent / "study.toml"
        path.write_text(STUDY.format(quantities=quantities, **texts))
        return path

    return write


def test_quantities_are_divided_by_their_references(write, registry, tmp_path):
    """The pressure at the apex is stiffness times depth; the reference has a tenth of the stiffness, at 10 um."""
    study = solve_study(write('{ max_pressure = "soft", force = 2.0 }'), tmp_path / "cache", registry=registry)
    (panel,) = study.panels
    np.testing.assert_allclose(panel.quantities["max_pressure"], [10.0, 20.0], rtol=1e-9)
    assert panel.references == {"max_pressure": pytest.approx(1e8), "force": 2.0}
    np.testing.assert_array_equal(panel.values, [1e-5, 2e-5])
    assert panel.converged == (True, True)
    assert len(list((tmp_path / "cache").iterdir())) == 2  # one for each stiffness


def test_unconverged_references_are_reported(write, registry, tmp_path):
    study = solve_study(write(solver='{ name = "uzawa", max_iterations = 1 }'), tmp_path / "cache", registry=registry)
    assert study.panels[0].converged == (False, False)
    assert study.not_converged == ("depth, 1e-05", "depth, 2e-05")


@pytest.mark.parametrize(
    ("vary", "values", "sizes"),
    [("mesh.contact_width", '["4 mm", "8 mm"]', (4e-3, 8e-3)), ("mesh.divisions", "[4, 6]", (5e-3, 5e-3))],
)
@pytest.mark.parametrize("kind", ["sections", "maps"])
def test_every_run_has_the_zone_of_its_mesh(write, registry, tmp_path, kind, vary, values, sizes):
    """The pressure is the stiffness of the springs times the depth of the paraboloid, at the nodes of each mesh."""
    path = write("{ pressure = 1.0 }", kind=kind, vary=vary, values=values)
    study = solve_study(path, tmp_path / "cache", registry=registry)
    (panel,) = study.panels
    for zone, pressure, size in zip(panel.zones, panel.quantities["pressure"], sizes, strict=True):
        assert np.ptp(zone.points[:, 0]) == pytest.approx(size)
        x, y, _ = zone.points.T
        depth = np.maximum(1e-5 - (x**2 + y**2) / 0.2, 0.0)
        np.testing.assert_allclose(pressure, 1e14 * depth, rtol=1e-6, atol=1.0)
    study_figure(study)


def test_values_with_units_are_placed_in_si(write, registry, tmp_path):
    study = solve_study(write(values='["10 um", "0.02 mm"]'), tmp_path / "cache", registry=registry)
    np.testing.assert_allclose(study.panels[0].values, [1e-5, 2e-5])
    assert study.panels[0].runs == ("10 um", "0.02 mm")


@pytest.mark.parametrize("reference", ['"soft"', "0.0"])
def test_division_by_zero_is_rejected(write, registry, tmp_path, reference):
    path = write(f"{{ charge = {reference} }}")
    with pytest.raises(CaseError, match=r"study.toml: depth: charge is divided by .*, where it is 0; allowed"):
        solve_study(path, tmp_path / "cache", registry=registry)
