"""The linearisation agrees with differences of the residual; Newton steps agree with and without a matrix."""

import math
from dataclasses import replace

import numpy as np
import pytest

from meeframe.contact.problem import AT_REST, PrescribedResultant
from meeframe.laws import IsotropicCoulomb, OrthotropicCoulomb, Signorini
from meeframe.solvers.newton.linear import newton_step
from meeframe.solvers.newton.residual import ContactResidual

RANDOM = np.random.default_rng(3)


def jacobian_times(equation, blocks, step):
    moved = equation.problem.system.apply(step[:, :5])
    return np.einsum("nij,nj->ni", blocks.a.dense(6), step) + np.einsum("nij,nj->ni", blocks.b.dense(5), moved)


def test_tangent_of_slip_is_the_derivative_of_the_radial_return() -> None:
    mu, trial = 0.4, np.array([[3.0, 4.0, -2.0], [0.1, 0.2, -2.0], [1.0, 1.0, 0.5]])
    unit = np.array([0.6, 0.8])
    slip = np.zeros((3, 3))
    slip[:2, :2] = mu * 2.0 / 5.0 * (np.eye(2) - np.outer(unit, unit))
    slip[:2, 2], slip[2, 2] = -mu * unit, 1.0
    tangent = IsotropicCoulomb(mu).tangent(trial)
    np.testing.assert_allclose(tangent, [slip, np.eye(3), np.zeros((3, 3))], atol=1e-9)


def test_tangent_without_an_indenter_above_is_zero() -> None:
    trial = np.array([[0.0, 0.0, math.inf], [0.0, 0.0, -1.0]])
    np.testing.assert_allclose(Signorini().tangent(trial), [np.zeros((3, 3)), np.diag([0.0, 0.0, 1.0])], atol=1e-9)


def test_tangent_in_principal_axes() -> None:
    """The projection is homogeneous of degree one, so P'(t) t = P(t) (Euler); slip does not depend on the magnitude
    of the trial."""
    law = OrthotropicCoulomb(0.1, 0.7, 0.4)
    trial = RANDOM.normal(size=(50, 3))
    np.testing.assert_allclose((law.tangent(trial) @ trial[:, :, None])[:, :, 0], law.project(trial), atol=1e-9)


@pytest.mark.parametrize("biactive", [False, True])
def test_linearisation_is_the_derivative_of_the_residual(sphere, growing, biactive) -> None:
    problem = sphere("orthotropic", OrthotropicCoulomb(0.1, 0.5, 0.3), (0.5, 2.0), cells=8)
    equation = ContactResidual.of(problem)
    pressure, compliance = equation.scales.pressure, equation.self_compliance[0]
    problem = problem.with_laws(electric=growing(1.0 / compliance[0], pressure, 0.5))
    equation = ContactResidual.of(problem)
    n = len(problem.gap)
    load = equation.scales.load * RANDOM.normal(size=(n, 5))
    load[:, 2] = -np.abs(load[:, 2])
    contact_fraction, mask = np.full(n, 0.5), np.zeros(n, bool)
    if biactive:
        # where the trial is far from zero the equation of the contact fraction is clipped: only the flux
        # equations depend on it
        mask[::3] = True
    here = equation.at(load, contact_fraction, mask, AT_REST)
    step = np.column_stack(
        [equation.scales.load * RANDOM.normal(size=(n, 5)), np.where(mask, RANDOM.normal(size=n), 0.0)]
    )
    width = 1e-6
    forward, backward = (
        equation.at(load + h * step[:, :5], here.contact_fraction + h * step[:, 5], mask, AT_REST)
        for h in (width, -width)
    )
    between = mask & (here.switch > 0.0) & (here.switch < 1.0)
    # an intermediate node is written differently, see ResidualState.linearise; the others must match, except at kinks
    smooth = ~between & (np.sign(forward.trial[:, 2]) == np.sign(backward.trial[:, 2]))
    assert smooth.sum() > n // 2
    expected = (forward.residual - backward.residual) / (2.0 * width)
    blocks = here.linearise()
    got = jacobian_times(equation, blocks, step)
    rows = slice(0, 5)
    np.testing.assert_allclose(got[smooth, rows], expected[smooth, rows], atol=2e-5 * np.abs(expected).max())


def test_biactive_node_has_zero_traction_and_zero_gap(sphere) -> None:
    problem = sphere("orthotropic", Signorini(), (0.0, 1.0), cells=8)
    equation = ContactResidual.of(problem)
    point = equation.at(np.zeros((64, 5)), np.zeros(64), np.zeros(64, bool), AT_REST)
    for _ in range(2):
        step = newton_step(equation, point.linearise()).local
        point = equation.at(point.load + step[:, :5], point.contact_fraction, point.biactive, AT_REST)
    edge = np.flatnonzero(point.load[:, 2] < 0.0)[0]
    mask = np.arange(64) == edge
    # in the middle of its graph
    contact_fraction = np.where(mask, 0.5 + point.trial[:, 2] / point.sigma, point.contact_fraction)
    point = equation.at(point.load, contact_fraction, mask, AT_REST)
    step = newton_step(equation, point.linearise()).local
    moved = equation.problem.system.apply(point.load + step[:, :5])
    scale = equation.scales
    assert abs(point.load[edge, 2] + step[edge, 2]) < 1e-12 * scale.pressure
    assert abs(problem.gap[edge] - moved[edge, 2]) < 1e-10 * scale.displacement[2]


@pytest.mark.parametrize("kappa", [(0.0, 0.0), (np.inf, 0.3)])
def test_newton_steps_agree_with_and_without_matrix(sphere, matrixless, kappa) -> None:
    problem = sphere("orthotropic", IsotropicCoulomb(0.6), kappa, cells=8)
    hidden = replace(problem, system=matrixless(problem.system))
    dense, krylov = ContactResidual.of(problem), ContactResidual.of(hidden)
    load = np.zeros((64, 5))
    for _ in range(3):
        point = dense.at(load, np.zeros(64), np.zeros(64, bool), AT_REST)
        step = newton_step(dense, point.linearise()).local
        other = newton_step(krylov, krylov.at(load, np.zeros(64), np.zeros(64, bool), AT_REST).linearise()).local
        unit = np.append(dense.scales.load, 1.0)
        np.testing.assert_allclose(other / unit, step / unit, atol=1e-6 * np.abs(step / unit).max())
        product = jacobian_times(dense, point.linearise(), step)
        np.testing.assert_allclose(product, -point.residual, atol=1e-11 * np.abs(point.residual).max())
        load = load + step[:, :5]


@pytest.mark.parametrize("hidden", [False, True])
def test_free_motions_are_solved_with_the_loads(sphere, matrixless, hidden) -> None:
    """The bordered system is computed by differences of the residual: the step is that of Newton's method for it."""
    problem = sphere("orthotropic", IsotropicCoulomb(0.5), (1.0, np.inf), cells=6)
    n, weights = 36, problem.system.weights
    modes = [np.tile(mode, (n, 1)) for mode in np.diag([1.0, 1.0, -1.0, -1.0, 1.0])[[0, 2, 3]]]
    prescribed_resultants = tuple(
        PrescribedResultant(mode, mode, weights, total) for mode, total in zip(modes, (4e3, 2e4, 1e-4), strict=True)
    )
    if hidden:
        problem = replace(problem, system=matrixless(problem.system))
    equation = ContactResidual.of(replace(problem, prescribed_resultants=prescribed_resultants))
    biactive = np.zeros(n, bool)
    load = np.zeros((n, 5))
    load[:, :3] = IsotropicCoulomb(0.5).project(1e7 * RANDOM.normal(size=(n, 3)))
    units = np.append(np.tile(equation.scales.load, n), equation.units)

    def rows(unknowns):
        values = unknowns * units
        point = equation.at(values[: 5 * n].reshape(n, 5), np.zeros(n), biactive, values[5 * n :])
        return np.append(point.residual[:, :5].ravel(), point.balance)

    start = np.append(load.ravel(), [1e-6, 2e-6, 1e3]) / units
    width = 1e-7
    jacobian = np.column_stack(
        [(rows(start + width * axis) - rows(start - width * axis)) / (2.0 * width) for axis in np.eye(len(start))]
    )
    expected = np.linalg.solve(jacobian, -rows(start))
    values = start * units
    point = equation.at(values[: 5 * n].reshape(n, 5), np.zeros(n), biactive, values[5 * n :])
    step = newton_step(equation, point.linearise())
    got = np.append(step.local[:, :5].ravel(), step.motion) / units
    np.testing.assert_allclose(got, expected, atol=1e-5 * np.abs(expected).max())


def test_effect_of_the_contact_fraction_on_the_trial_of_a_node(sphere) -> None:
    """If a node opens between perfect conductors, its flux vanishes and the surface moves according to the matrix."""
    problem = sphere("orthotropic", Signorini(), (math.inf, math.inf), cells=8)
    equation = ContactResidual.of(problem)
    n, node = len(problem.gap), 27
    load = equation.scales.load * RANDOM.normal(size=(n, 5))
    contact_fraction, open_ = (equation.at(load, np.full(n, c), np.ones(n, bool), AT_REST) for c in (1.0, 0.0))
    compliance = np.diagonal(problem.system.diagonal_blocks()[node])[3:]
    # the fluxes for which its equations hold as before, open and closed
    flux = (open_.residual - contact_fraction.residual)[node, 3:5] * equation.scales.displacement[3:] / compliance
    moved = load.copy()
    moved[node, 3:] += flux
    raised = equation.at(moved, np.ones(n), np.ones(n, bool), AT_REST).trial - contact_fraction.trial
    assert contact_fraction.closing_increment[node] == pytest.approx(raised[node, 2], rel=1e-9)
    assert np.ptp(np.sign(contact_fraction.closing_increment)) == 2.0
