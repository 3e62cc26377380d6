"""Two deformable bodies from case files agree with Hertz (16 x 16), closed forms, and exchanged roles."""

import importlib.util
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from meeframe.elements import Quad4
from meeframe.mesh import block_mesh, half_space_mesh
from meeframe.model.solve import reduce

FOLDER = Path(__file__).parents[3] / "validation" / "two_bodies"


def load_study():
    spec = importlib.util.spec_from_file_location("two_bodies_study", FOLDER / "study.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


study = load_study()
COARSE = half_space_mesh(0.1, 0.005, 10, 5, Quad4())


@pytest.mark.full
def test_equal_elastic_bodies_match_hertz():
    result = study.hertz("equal")
    assert result.force == pytest.approx(result.exact, rel=0.015)
    assert result.exact == pytest.approx(2 / 3 * 210e9 / (1 - 0.3**2) * np.sqrt(0.1 * 5e-5**3), rel=1e-9)
    assert result.pressure < 0.03
    assert result.tangential < 1e-6


@pytest.mark.full
@pytest.mark.parametrize("condition", ["EMII", "EMCI"])
def test_opposite_poling_matches_joined_half_space(condition):
    case = study.load("poled")
    other = study.second_body(case)
    opposite = replace(other, mesh=COARSE, material=other.material.rotated(study.TURN))
    case = replace(study.conducting(case, condition), mesh=COARSE, second_body=opposite)
    exact = study.closed_form(case, condition)
    solution = study.solve(case, reduce(case)).totals
    assert -solution.force[2] == pytest.approx(exact.force, rel=0.015)
    assert solution.charge == pytest.approx(exact.charge, rel=0.015, abs=0.0)
    assert solution.magnetic_flux == pytest.approx(exact.magnetic_flux, rel=0.015, abs=0.0)


@pytest.mark.full
def test_exchanged_roles():
    case = study.load("roles")
    half_space, block = half_space_mesh(0.1, 0.005, 7, 3, Quad4()), block_mesh(0.05, 0.12, 0.005, 7, 3, 2, Quad4())
    result = study.roles(replace(case, mesh=half_space, second_body=replace(study.second_body(case), mesh=block)))
    assert 0 < result.stuck < result.pressed
    assert result.alike
    assert result.differences.max() < 1e-8
    one, two = result.totals
    np.testing.assert_allclose(two.force, one.force * [-1, 1, 1], rtol=1e-9)
    assert two.charge == pytest.approx(-one.charge, rel=1e-8)
    assert two.magnetic_flux == pytest.approx(-one.magnetic_flux, rel=1e-8)
