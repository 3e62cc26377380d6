"""The conductance of contacts agrees with Holm's constriction resistance and Barber's relation to the stiffness."""

import math
from dataclasses import replace

import numpy as np
import pytest

import meeframe
from meeframe.cli.examples import example_texts
from meeframe.model.load import load_case
from meeframe.study.sweep.numbers import numbers_of

SIGMA, MODULUS = 6e6, 210e9 / (1 - 0.3**2)


def solve(tmp_path, *changes, divisions=28):
    """Solve the example with changes of its text, in a single increment and on a coarser grid by default."""
    text = example_texts()["contact-resistance"].replace("divisions = 48", f"divisions = {divisions}")
    for old, new in (("increments = 4", "increments = 1"), *changes):
        assert old in text
        text = text.replace(old, new, 1)
    (tmp_path / "case.toml").write_text(text, encoding="utf-8")
    result = meeframe.solve_case(load_case(tmp_path / "case.toml"))
    assert result.status == "converged"
    return result


def test_conductance_of_circular_contact_matches_holm(tmp_path):
    result = solve(tmp_path)
    (step,) = result.steps
    numbers = numbers_of(result.zone, step)
    assert numbers["conductance"] == pytest.approx(-numbers["charge"])  # at one volt
    assert numbers["conductance"] == pytest.approx(4 * SIGMA * math.sqrt(1e-6 * 10e-3), rel=0.02)
    scalars = dict.fromkeys(step.loading.scalars, 0.0)
    grounded = replace(step, loading=replace(step.loading, scalars=scalars))
    assert math.isnan(numbers_of(result.zone, grounded)["conductance"])


def test_each_scalar_field_has_a_conductance(tmp_path):
    """Closed contacts conduct magnetic flux as charge: 4 mu a, while the current remains that of 1 V."""
    magnetic = (
        "[indenter]",
        '[conductivity.magnetic]\nname = "step"\nkappa = inf\n\n[indenter]\nmagnetic_potential = "2 A"',
    )
    result = solve(tmp_path, ("permittivity = 6e6", "permittivity = 6e6\npermeability = 3e-4"), magnetic)
    numbers = numbers_of(result.zone, result.steps[-1])
    assert numbers["magnetic_conductance"] == pytest.approx(4 * 3e-4 * math.sqrt(1e-6 * 10e-3), rel=0.02)
    assert numbers["magnetic_conductance"] / numbers["conductance"] == pytest.approx(3e-4 / SIGMA, rel=1e-6)
    units = result.to_dataframe().attrs["units"]
    assert (units["conductance"], units["magnetic_conductance"]) == ("F", "H")


def test_conductance_with_resolved_contact_edge(tmp_path):
    """With the contact edge between the nodes, conductances at three approaches agree with Holm's to 0.3 %."""
    formulation = ('name = "half-space"\n', 'name = "half-space"\nedges = "resolved"\n')
    for approach in (0.8, 0.9, 1.0):
        result = solve(tmp_path, formulation, ('approach = "1 um"', f'approach = "{approach} um"'), divisions=48)
        conductance = numbers_of(result.zone, result.steps[-1])["conductance"]
        assert conductance == pytest.approx(4 * SIGMA * math.sqrt(approach * 1e-6 * 10e-3), rel=3e-3)


def test_conductance_is_proportional_to_stiffness(tmp_path):
    """Barber's relation G = 2 sigma / E* dP/dg for an elliptic contact; a central difference gives the stiffness."""
    shape = ('name = "sphere"\nradius = "10 mm"', 'name = "paraboloid"\nradius_x = "10 mm"\nradius_y = "5 mm"')
    forces, conductances = [], []
    for approach in (0.8, 0.9, 1.0):
        result = solve(tmp_path, shape, ('approach = "1 um"', f'approach = "{approach} um"'))
        numbers = numbers_of(result.zone, result.steps[-1])
        forces.append(numbers["normal_force"])
        conductances.append(numbers["conductance"])
    stiffness = (forces[2] - forces[0]) / 0.2e-6
    assert np.mean(conductances) == pytest.approx(2 * SIGMA / MODULUS * stiffness, rel=0.02)
