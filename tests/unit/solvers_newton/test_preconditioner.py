"""The preconditioner of Newton's equations is exact in special cases."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from meeframe.contact.channels import flux_channels
from meeframe.contact.problem import AT_REST, ContactProblem
from meeframe.fields import Array
from meeframe.laws import IsotropicCoulomb, StepConductivity
from meeframe.solvers.newton.jacobian import ReducedJacobian
from meeframe.solvers.newton.linear import coupled_rows
from meeframe.solvers.newton.preconditioner import preconditioner
from meeframe.solvers.newton.residual import ContactResidual
from meeframe.system.reduced import NodalFields, ReducedSystem

N, MU = 60, 0.3
RANDOM = np.random.default_rng(8)


@final
@dataclass(frozen=True, eq=False)
class Springs(ReducedSystem):
    """Uncoupled nodes with compliance (5, 5)."""

    compliance: Array

    def apply(self, load: Array) -> Array:
        return load @ self.compliance.T

    def diagonal_blocks(self) -> Array:
        return np.tile(self.compliance, (N, 1, 1))

    def dense(self) -> None:
        return None

    def recover(self, load: Array) -> NodalFields:
        raise NotImplementedError

    def approximate_inverse(self, fields: Sequence[int]) -> Callable[[Array], Array]:
        return lambda displacement: np.linalg.solve(self.compliance[np.ix_(fields, fields)], displacement.T).T


def test_preconditioner_is_exact_for_uncoupled_nodes() -> None:
    """Nodes stick, slip far, slip slightly, or are open, and conduct."""
    none, kind = np.zeros((N, 5)), np.arange(N) % 4
    points, frames = RANDOM.random((N, 3)), np.tile(np.eye(3), (N, 1, 1))
    system = Springs(points, frames, np.ones(N), (), none, np.diag([3.0, 3.0, 2.0, 5.0, 7.0]))
    gap, angle = np.where(kind == 0, 1.0, -1.0), RANDOM.random(N) * 2.0 * np.pi
    dragged = MU * np.choose(kind, [0.0, 0.5, 10.0, 1.1]) * [np.cos(angle), np.sin(angle)]
    flux = StepConductivity(np.inf)
    problem = ContactProblem(system, IsotropicCoulomb(MU), flux_channels(flux, flux), gap, dragged.T, none[:, :2])
    equation = ContactResidual.of(problem)
    blocks = equation.at(none, np.zeros(N), np.zeros(N, bool), AT_REST).linearise()
    rows = ReducedJacobian.of(equation, blocks, coupled_rows(blocks), np.dtype(float))
    assert len(rows.nodes) == (kind > 0).sum()
    unknowns = RANDOM.normal(size=rows.coupled.shape) * rows.coupled
    multiply, precondition = rows.multiplication(), preconditioner(rows)
    np.testing.assert_allclose(precondition(multiply(unknowns.ravel())), unknowns.ravel(), atol=1e-12)


def test_preconditioner_of_nearly_closed_nodes() -> None:
    """The gap depends on the contact fraction only: the node conducts, and flux displaces it."""
    none, biactive = np.zeros((N, 5)), np.arange(N) % 3 == 0
    compliance = np.diag([3.0, 3.0, 2.0, 5.0, 7.0])
    compliance[2, 3:], compliance[3:, 2] = [0.5, 0.3], [-0.5, -0.3]
    points, frames = 100.0 * RANDOM.random((N, 3)), np.tile(np.eye(3), (N, 1, 1))
    system = Springs(points, frames, np.ones(N), (), none, compliance)
    gap, flux = np.where(biactive, 0.0, -1.0), StepConductivity(np.inf)
    potentials = np.tile([0.4, 0.2], (N, 1))
    problem = ContactProblem(system, IsotropicCoulomb(MU), flux_channels(flux, flux), gap, none[:, :2], potentials)
    equation = ContactResidual.of(problem)
    blocks = equation.at(none, np.full(N, 1.0 - 1e-10), biactive, AT_REST).linearise()
    rows = ReducedJacobian.of(equation, blocks, coupled_rows(blocks), np.dtype(float))
    assert rows.coupled[-1].sum() == biactive.sum()
    unknowns = RANDOM.normal(size=rows.coupled.shape) * rows.coupled
    multiply, precondition = rows.multiplication(), preconditioner(rows)
    np.testing.assert_allclose(precondition(multiply(unknowns.ravel())), unknowns.ravel(), atol=1e-7)
