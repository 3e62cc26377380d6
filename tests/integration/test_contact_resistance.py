"""Conductance of contacts: Holm's constriction resistance, and Barber's relation to the stiffness of the contact."""

import math
from dataclasses import replace

import numpy as np
import pytest

import meeframe
from meeframe.cli.examples import example_texts
from meeframe.model.load import load_case
from meeframe.study.sweep.numbers import numbers_of

SIGMA, MODULUS = 6e6, 210e9 / (1 - 0.3**2)


def solved(tmp_path, *changes):
    text = example_texts()["contact-resistance"].replace("divisions = 48", "divisions = 28")
    for old, new in (("increments = 4", "increments = 1"), *changes):
        assert old in text
        text = text.replace(old, new)
    (tmp_path / "case.toml").write_text(text, encoding="utf-8")
    result = meeframe.solve_case(load_case(tmp_path / "case.toml"))
    assert result.status == "converged"
    return result


def test_a_circular_contact_has_the_conductance_of_holm(tmp_path):
    result = solved(tmp_path)
    (step,) = result.steps
    numbers = numbers_of(result.zone, step)
    assert numbers["conductance"] == pytest.approx(-numbers["charge"])  # at one volt
    assert numbers["conductance"] == pytest.approx(4 * SIGMA * math.sqrt(1e-6 * 10e-3), rel=0.02)
    scalars = dict.fromkeys(step.loading.scalars, 0.0)
    grounded = replace(step, loading=replace(step.loading, scalars=scalars))
    assert math.isnan(numbers_of(result.zone, grounded)["conductance"])


def test_the_conductance_of_any_contact_is_its_stiffness(tmp_path):
    """An elliptic contact: G = 2 sigma / E* dP/dg, with the stiffness from two more approaches."""
    shape = ('name = "sphere"\nradius = "10 mm"', 'name = "paraboloid"\nradius_x = "10 mm"\nradius_y = "5 mm"')
    forces, conductances = [], []
    for approach in (0.8, 0.9, 1.0):
        result = solved(tmp_path, shape, ('approach = "1 um"', f'approach = "{approach} um"'))
        numbers = numbers_of(result.zone, result.steps[-1])
        forces.append(numbers["normal_force"])
        conductances.append(numbers["conductance"])
    stiffness = (forces[2] - forces[0]) / 0.2e-6
    assert np.mean(conductances) == pytest.approx(2 * SIGMA / MODULUS * stiffness, rel=0.02)
