"""The preconditioner of Newton's equations, where it ought to be their inverse."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from meeframe.core.contact import AT_REST, ContactProblem
from meeframe.core.fields import Array
from meeframe.core.formulation import NodalFields, ReducedSystem
from meeframe.laws import IsotropicCoulomb, StepConductivity
from meeframe.solvers.newton_preconditioner import preconditioner
from meeframe.solvers.newton_rows import Rows
from meeframe.solvers.newton_steps import _coupled
from meeframe.solvers.nonsmooth import Equation

N, MU = 60, 0.3
RANDOM = np.random.default_rng(8)


@final
@dataclass(frozen=True, eq=False)
class Springs(ReducedSystem):
    """Each node moves by its own load alone, each field of the displacement by that field of the load."""

    compliance: Array

    def apply(self, load: Array) -> Array:
        return load * self.compliance

    def diagonal_blocks(self) -> Array:
        return np.tile(np.diag(self.compliance), (N, 1, 1))

    def dense(self) -> None:
        return None

    def recover(self, load: Array) -> NodalFields:
        raise NotImplementedError

    def approximate_inverse(self, fields: Sequence[int]) -> Callable[[Array], Array]:
        return lambda displacement: displacement / self.compliance[list(fields)]


def test_inverse_where_nodes_do_not_know_of_each_other() -> None:
    """Stick, slip, and no contact at all, conducting."""
    none, kind = np.zeros((N, 5)), np.arange(N) % 3
    points, frames = RANDOM.random((N, 3)), np.tile(np.eye(3), (N, 1, 1))
    system = Springs(points, frames, np.ones(N), (), none, np.array([3.0, 4.0, 2.0, 5.0, 7.0]))
    gap, angle = np.where(kind == 0, 1.0, -1.0), RANDOM.random(N) * 2.0 * np.pi
    dragged = MU * np.where(kind == 1, 0.5, 10.0) * [np.cos(angle), np.sin(angle)]
    flux = StepConductivity(np.inf)
    problem = ContactProblem(system, IsotropicCoulomb(MU), flux, flux, gap, dragged.T, none[:, :2])
    equation = Equation.of(problem)
    blocks = equation.at(none, np.zeros(N), np.zeros(N, bool), AT_REST).linearise()
    rows = Rows.of(equation, blocks, _coupled(blocks), np.dtype(float))
    assert len(rows.nodes) == (kind > 0).sum()
    unknowns = RANDOM.normal(size=rows.coupled.shape) * rows.coupled
    multiply, precondition = rows.multiplication(), preconditioner(rows)
    np.testing.assert_allclose(precondition(multiply(unknowns.ravel())), unknowns.ravel(), atol=1e-12)
