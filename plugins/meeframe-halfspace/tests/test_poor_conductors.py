"""Contacts that conduct little under large potentials or charges: what is called converged satisfies the laws."""

import numpy as np
import pytest

from meeframe import Case

KAPPA, MU = 1e-12, 0.3
CASE = """
[material]
name = "batio3-cofe2o4"

[mesh]
type = "half-space"
contact_width = "5 mm"
divisions = 12

[formulation]
name = "half-space"

[contact]
law = {{ name = "isotropic-coulomb", mu = {mu} }}

[conductivity]
electric = {{ name = "step", kappa = {kappa} }}

[indenter]
name = "sphere"
radius = "100 mm"

[solver]
name = "{solver}"

[[steps]]
approach = "40 um"
{prescribed}
increments = 2
"""


@pytest.mark.full(except_for=2)
@pytest.mark.parametrize(
    ("prescribed", "solver"),
    [
        *(("electric_potential = 1e10", solver) for solver in ("auto", "uzawa", "uzawa-bb")),
        ("charge = 1e-3", "auto"),
        *(("charge = 1.0", solver) for solver in ("auto", "uzawa", "uzawa-bb")),
    ],
)
def test_laws_hold_in_units_of_the_solution(prescribed, solver):
    """Stated for each node by the numbers of the result alone, relative to its own largest pressure and flux."""
    result = Case.from_toml(CASE.format(mu=MU, kappa=KAPPA, solver=solver, prescribed=prescribed)).solve()
    for one in result:
        assert one.status == "converged"
        pressure, flux = -one.traction[:, 2], one.fluxes[:, 0]
        largest = pressure.max()
        assert pressure.min() >= -1e-8 * largest
        assert abs(pressure * one.gap).max() <= 1e-7 * largest * np.abs(one.displacement).max()
        friction = np.linalg.norm(one.traction[:, :2], axis=1)
        assert (friction - MU * pressure).max() <= 1e-8 * largest
        drop = one.potentials[:, 0] - one.loading.electric_potential
        conducted = np.where(pressure > 1e-6 * largest, KAPPA * drop, flux)
        assert np.abs(flux - conducted).max() <= 1e-6 * np.abs(flux).max()
        if "charge" in one.loading.prescribed:
            assert result.zone.weights @ flux == pytest.approx(
                np.asarray(one.loading.prescribed["charge"]).item(), rel=1e-8
            )
