"""Boundary elements and finite elements agree on the same case file."""

from pathlib import Path

import numpy as np
import pytest
from meeframe_skfem import FiniteElements

import meeframe
from meeframe.common.errors import CaseError

CASE = """
title = "Sphere on a block that conducts, by two formulations"

[material]
name = "{material}"

[mesh]
half_width = "15 mm"
height = "25 mm"
contact_width = "5 mm"
divisions = {divisions}
rings = {divisions}
layers = {divisions}
element = "{element}"

[[boundary]]
group = "base"
displacement = [0, 0, 0]
electric_potential = 0
magnetic_potential = 0

[[boundary]]
group = ["side_x-", "side_x+", "side_y-", "side_y+"]
electric_potential = 0
magnetic_potential = 0

[contact]
law = {{name = "isotropic-coulomb", mu = 0.3}}

[conductivity]
electric = {{name = "step", kappa = inf}}
magnetic = {{name = "step", kappa = inf}}

[indenter]
name = "sphere"
radius = "100 mm"

[formulation]
{formulation}

[solver]
name = "newton"

[[steps]]
approach = "50 um"
translation = ["5 um", 0]
"""


def totals(folder, element="quad9", **given):
    """Return tangential and normal force [N], charge [C] and magnetic flux [Wb]."""
    path = folder / "case.toml"
    path.write_text(CASE.format(element=element, **given), encoding="utf-8")
    step = meeframe.solve_case(meeframe.load_case(path))
    (last,) = step.steps
    assert last.status == "converged"
    loads = np.column_stack([last.traction[:, [0, 2]], last.fluxes])
    return step.zone.weights @ loads


@pytest.mark.full
def test_boundary_and_finite_elements_converge(tmp_path):
    """All elements of both methods are halved; the differences decrease accordingly."""
    coarse, fine = (differences(tmp_path, divisions, growth) for divisions, growth in ((2, 4.0), (4, 2.0)))
    assert (fine < 0.5 * coarse).all()
    assert (fine < [0.04, 0.01, 0.01, 0.02]).all()


def differences(folder, divisions, growth):
    """Return the differences of the totals by finite elements, relative to those by boundary elements."""
    formulations = ('name = "dense-bem"', f'name = "skfem"\ngrowth = {growth}')
    bem, fem = (
        totals(folder, material="orthotropic-mee", divisions=divisions, formulation=text) for text in formulations
    )
    return np.abs(fem / bem - 1)


@pytest.mark.full
def test_eight_node_elements_are_rejected_under_strong_coupling(tmp_path):
    """The response of a corner node to its pressure is negative under strong coupling only."""
    given = {"divisions": 2, "formulation": 'name = "skfem"\ngrid = "shells"\ngrowth = 3.0', "element": "quad8"}
    totals(tmp_path, material="batio3-cofe2o4", **given)
    with pytest.raises(CaseError, match=r"'quad8': 9 of 21 nodes .* towards a pressure.*allowed: 'quad9' or 'quad4'"):
        totals(tmp_path, material="orthotropic-mee", **given)


def test_example_is_accepted():
    example = Path(__file__).parents[1] / "examples" / "conducting_sphere.toml"
    assert isinstance(meeframe.load_case(example).formulation, FiniteElements)
