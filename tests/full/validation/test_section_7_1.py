"""Section 7.1 of the paper on the paper's mesh agrees with the closed forms of the half space."""

import importlib.util
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest

FOLDER = Path(__file__).parents[3] / "validation" / "transversely_isotropic_indentation"
CONDITIONS = ("EMII", "ECMII", "EIMCI", "EMCI")


def load_study():
    spec = importlib.util.spec_from_file_location("section_7_1_study", FOLDER / "study.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


study = load_study()


@pytest.fixture(scope="module")
def case():
    return study.load("EMII")


@pytest.fixture(scope="module")
def system(case):
    """Return one reduced system for all conditions, which differ in their laws only."""
    return case.formulation.reduce(case.body)


@pytest.fixture(scope="module")
def solve(system):
    """Return a function that solves a condition once."""
    return cache(lambda condition: study.solve(study.load(condition), system))


def test_mesh_matches_the_paper(case):
    assert case.mesh.n_elements == 1088
    assert len(case.mesh.points) == 1090
    assert len(case.mesh.group_points("contact")) == 17 * 17


@pytest.mark.parametrize("condition", CONDITIONS)
def test_totals_and_sections_under_the_four_conditions(condition, case, solve):
    solved = solve(condition)
    exact = study.closed_form(case, condition)
    computed = study.differences(solved, exact)
    assert len(computed) == 1 + sum(potential is not None for potential in study.CONDITIONS[condition])
    assert max(abs(value) for value in computed.values()) < 0.015
    on_section = study.section_differences(solved, exact, study.closed_form(case, "EMII"))
    assert max(on_section.values()) < 0.03


@pytest.mark.parametrize("condition", ["ECMII", "EIMCI"])
def test_force_and_flux_are_monotone_in_conductivity(condition, case, system, solve):
    """Fig. 3; with the printed sign of the conductivity law they would not be (docs/explanation/theory.md)."""
    computed = study.sweep(case, system, condition, np.logspace(-3, 3, 5))
    force = [-solved.totals.force[2] for solved in computed.solved]
    name = "charge" if condition == "ECMII" else "magnetic_flux"
    flux = [abs(study.totals(solved)[name]) for solved in computed.solved]
    limits = [solve(name) for name in ("EMII", condition)]
    assert np.all(np.diff(force) < 0)
    assert np.all(np.diff(flux) > 0)
    assert -limits[1].totals.force[2] < force[-1] < force[0] < -limits[0].totals.force[2]
    assert force[0] == pytest.approx(-limits[0].totals.force[2], rel=1e-2)
    assert force[-1] == pytest.approx(-limits[1].totals.force[2], rel=1e-3)


def test_difference_from_half_space_is_due_to_the_block(case, solve):
    """On a semi-infinite body with as many elements in the zone, only the discretisation error remains."""
    (half_space,) = study.refinements(case, [(np.inf, 16)])
    for condition in CONDITIONS:
        exact = study.closed_form(case, condition)
        remaining = study.relative(half_space.totals[condition], study.exact_totals(exact))
        for name, block in study.differences(solve(condition), exact).items():
            assert abs(remaining[name]) < min(0.003, 0.7 * abs(block)), (condition, name)
