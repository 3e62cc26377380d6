"""Friction and conduction under a sphere on an orthotropic half space agree with an independent solver.

Its figures are listed on docs/explanation/theory.md, Half space. The ratios do not depend on the size of the sphere.
"""

from collections.abc import Sequence

import numpy as np
import pytest

import meeframe
from meeframe.contact.problem import Status
from meeframe.model.load import case_from_tables

INDEPENDENT = {1e-12: 1.02, 1e-9: 0.92, 5e-9: 0.71, 8e-9: 0.63, 1e-8: 0.59}
"""Rise of the largest electric potential at mu = 0.9, by the scale of the magneto-electric coefficients [s/m]."""


def sphere(mu: float, scale: float, conducting: Sequence[str] = ()) -> np.ndarray:
    """Return the force [N], the largest electric potential [V] and the largest magnetic potential [A]."""
    tables = {
        "title": "sphere on an orthotropic half space",
        "material": {"name": "orthotropic-mee", "magnetoelectric_scale": scale},
        "mesh": {"type": "half-space", "half_width": 0.05, "contact_width": 5e-3, "divisions": 24, "rings": 1},
        "formulation": {"name": "half-space"},
        "contact": {"law": {"name": "isotropic-coulomb", "mu": mu}},
        "conductivity": {field: {"name": "step", "kappa": np.inf} for field in conducting},
        "indenter": {"name": "sphere", "radius": 0.1, "electric_potential": 0.0, "magnetic_potential": 0.0},
        "steps": [{"approach": 5e-5}],
    }
    result = meeframe.solve_case(case_from_tables(tables))
    (step,) = result.steps
    assert step.status is Status.CONVERGED
    return np.array([-result.zone.weights @ step.traction[:, 2], *np.abs(step.potentials).max(axis=0)])


@pytest.mark.full(except_for=2)
@pytest.mark.parametrize(("scale", "rise"), INDEPENDENT.items())
def test_friction_increases_potentials_under_insulating_sphere(scale: float, rise: float) -> None:
    _, electric, magnetic = sphere(0.9, scale) / sphere(0.0, scale) - 1.0
    assert electric == pytest.approx(rise, abs=0.01)
    assert magnetic == pytest.approx(0.33, abs=0.01)


def test_forces_of_conducting_spheres() -> None:
    both = ("electric", "magnetic")
    assert sphere(0.9, 1e-8, both)[0] / sphere(0.0, 1e-8, both)[0] - 1.0 == pytest.approx(0.016, abs=0.002)
    assert sphere(0.0, 1e-8, ("magnetic",))[0] / sphere(0.0, 1e-8)[0] == pytest.approx(0.43, abs=0.005)
