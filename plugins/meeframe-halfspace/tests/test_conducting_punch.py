"""Conducting flat punch on a piezoelectric half space, poled along its normal: totals and fields on the axis."""

import numpy as np
import pytest

import meeframe

RADIUS, UNIT = 1e-3, 1e9
"""Radius of the punch [m], and potential [V] in terms of which the closed form is written."""


def stiffness():
    """Return the extended stiffness (3, 4, 4, 3) of PZT-4 without the magnetic field, from its printed constants."""
    c11, c12, c13, c33, c44 = 139e9, 77.8e9, 74.3e9, 115e9, 25.6e9
    voigt = np.diag([c11, c11, c33, c44, c44, (c11 - c12) / 2.0])
    voigt[:3, :3] = [[c11, c12, c13], [c12, c11, c13], [c13, c13, c33]]
    e = np.zeros((3, 6))
    e[0, 4] = e[1, 3] = 12.7
    e[2, :3] = -5.2, -5.2, 15.1
    index = np.array([[0, 5, 4], [5, 1, 3], [4, 3, 2]])
    result = np.zeros((3, 4, 4, 3))
    result[:, :3, :3, :] = voigt[index[:, :, None, None], index[None, None]]
    result[:, :3, 3, :] = UNIT * e[:, index].transpose(1, 2, 0)
    result[:, 3, :3, :] = UNIT * e[:, index]
    result[:, 3, 3, :] = -(UNIT**2) * np.diag([6.46e-9, 6.46e-9, 5.62e-9])
    return result


class Punch:
    """Closed form by Stroh's eigenvectors of plane waves along x1 that decay into the depth.

    Under the punch all loads are proportional to 1 / sqrt(a^2 - r^2), whose Hankel transform is sin(ka) / ka.
    """

    def __init__(self, approach, potential):
        c = stiffness()
        q, r, t = c[0, :, :, 0], c[0, :, :, 2], c[2, :, :, 2]
        companion = np.block([[np.zeros((4, 4)), np.eye(4)], [-np.linalg.solve(t, q), -np.linalg.solve(t, r + r.T)]])
        exponents, vectors = np.linalg.eig(companion)
        decays = exponents.imag < 0.0
        self.p, self.values = exponents[decays], vectors[:4, decays]
        self.fluxes = 1j * (r.T @ self.values + t @ self.values * self.p)
        compliance = (self.values @ np.linalg.inv(self.fluxes))[2:, 2:].real
        self.totals = 4.0 * RADIUS * np.linalg.solve(compliance, [-approach, potential / UNIT])
        self.force, self.charge = self.totals[0], self.totals[1] / UNIT

    def on_axis(self, depth):
        """Return displacement, potential, stress, electric displacement and field along x3 at a depth."""
        amplitudes, lengths = np.linalg.solve(self.fluxes, [0.0, 0.0, *self.totals]), 1j * self.p * depth

        def value(weights):
            return (weights * amplitudes * np.arctan(RADIUS / lengths)).sum().real / (2.0 * np.pi * RADIUS)

        def flux(weights):
            return (weights * amplitudes / (RADIUS**2 + lengths**2)).sum().real / (2.0 * np.pi)

        return (
            value(self.values[2]),
            UNIT * value(self.values[3]),
            flux(self.fluxes[2]),
            flux(self.fluxes[3]) / UNIT,
            -UNIT * flux(1j * self.p * self.values[3]),
        )


@pytest.fixture(scope="module")
def result():
    return meeframe.Case(
        material="pzt-4",
        mesh=meeframe.mesh.half_space(2.4 * RADIUS, 32),
        formulation=meeframe.formulation("half-space", edges="resolved"),
        indenter=meeframe.FlatPunch(RADIUS),
        conductivity={"electric": meeframe.StepConductivity(float("inf"))},
        steps=[
            meeframe.Step(approach=1e-6, electric_potential=500.0),
            meeframe.Step(electric_potential=-500.0),
            meeframe.Step(approach=1.5e-6),
        ],
    ).solve(progress=False)


def test_force_and_charge(result):
    for step in result:
        totals = meeframe.resultants(result.zone, step)
        exact = Punch(step.loading.approach, step.loading.electric_potential)
        assert totals.force[2] == pytest.approx(exact.force, rel=2e-3)
        assert totals.charge == pytest.approx(exact.charge, rel=2e-3)


def test_force_and_charge_derive_from_one_energy(result):
    """The indenter carries the charge -Q, so that P d(delta) + Q dV is a total differential: dP/dV = dQ/d(delta)."""
    first, second, third = (meeframe.resultants(result.zone, step) for step in result)
    by_potential = (first.normal_force - second.normal_force) / 1000.0
    by_approach = (third.charge - second.charge) / 0.5e-6
    assert by_potential == pytest.approx(by_approach, rel=1e-8)


def test_fields_on_the_axis(result):
    depths = RADIUS * np.array([0.25, 0.5, 1.0, 2.0, 4.0])
    fields = meeframe.interior(result, np.stack([0.0 * depths, 0.0 * depths, -depths], axis=1), step=1)
    computed = np.stack(
        [
            fields.displacement[:, 2],
            fields.potentials[:, 0],
            fields.stress[:, 2, 2],
            fields.electric_displacement[:, 2],
            fields.electric_field[:, 2],
        ],
        axis=1,
    )
    exact = np.array([Punch(1e-6, 500.0).on_axis(depth) for depth in depths])
    assert (np.abs(computed - exact).max(axis=0) < 3e-3 * np.abs(exact).max(axis=0)).all()
