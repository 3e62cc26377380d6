"""The preconditioner of Newton's equations, where it ought to be their inverse."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import final

import numpy as np
import pytest
from meeframe_halfspace import HalfSpace
from meeframe_halfspace.system import HalfSpaceSystem

from meeframe.contact.channels import flux_channels
from meeframe.contact.problem import AT_REST, ContactProblem
from meeframe.elements import Quad4
from meeframe.fields import Array
from meeframe.laws import Insulating, IsotropicCoulomb, OrthotropicCoulomb, Signorini, StepConductivity
from meeframe.laws.base import ContactLaw
from meeframe.material import Material, library_material
from meeframe.mesh import half_space_mesh
from meeframe.mesh.body import Body
from meeframe.solvers.krylov import gmres
from meeframe.solvers.newton.globalization import _coupled
from meeframe.solvers.newton.jacobian import Rows
from meeframe.solvers.newton.preconditioner import preconditioner
from meeframe.solvers.newton.residual import Equation
from meeframe.system.reduced import NodalFields, ReducedSystem

N, MU = 60, 0.3
RANDOM = np.random.default_rng(8)


@final
@dataclass(frozen=True, eq=False)
class Springs(ReducedSystem):
    """Each node moves by its own load alone. compliance: (5, 5)."""

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


def test_inverse_where_nodes_do_not_know_of_each_other() -> None:
    """Stick, slip far and hardly at all, and no contact, conducting."""
    none, kind = np.zeros((N, 5)), np.arange(N) % 4
    points, frames = RANDOM.random((N, 3)), np.tile(np.eye(3), (N, 1, 1))
    system = Springs(points, frames, np.ones(N), (), none, np.diag([3.0, 3.0, 2.0, 5.0, 7.0]))
    gap, angle = np.where(kind == 0, 1.0, -1.0), RANDOM.random(N) * 2.0 * np.pi
    dragged = MU * np.choose(kind, [0.0, 0.5, 10.0, 1.1]) * [np.cos(angle), np.sin(angle)]
    flux = StepConductivity(np.inf)
    problem = ContactProblem(system, IsotropicCoulomb(MU), flux_channels(flux, flux), gap, dragged.T, none[:, :2])
    equation = Equation.of(problem)
    blocks = equation.at(none, np.zeros(N), np.zeros(N, bool), AT_REST).linearise()
    rows = Rows.of(equation, blocks, _coupled(blocks), np.dtype(float))
    assert len(rows.nodes) == (kind > 0).sum()
    unknowns = RANDOM.normal(size=rows.coupled.shape) * rows.coupled
    multiply, precondition = rows.multiplication(), preconditioner(rows)
    np.testing.assert_allclose(precondition(multiply(unknowns.ravel())), unknowns.ravel(), atol=1e-12)


def test_inverse_where_nodes_are_all_but_closed() -> None:
    """Their gap follows from the closed fraction alone: it conducts, and flux moves them."""
    none, grazing = np.zeros((N, 5)), np.arange(N) % 3 == 0
    compliance = np.diag([3.0, 3.0, 2.0, 5.0, 7.0])
    compliance[2, 3:], compliance[3:, 2] = [0.5, 0.3], [-0.5, -0.3]
    points, frames = 100.0 * RANDOM.random((N, 3)), np.tile(np.eye(3), (N, 1, 1))
    system = Springs(points, frames, np.ones(N), (), none, compliance)
    gap, flux = np.where(grazing, 0.0, -1.0), StepConductivity(np.inf)
    potentials = np.tile([0.4, 0.2], (N, 1))
    problem = ContactProblem(system, IsotropicCoulomb(MU), flux_channels(flux, flux), gap, none[:, :2], potentials)
    equation = Equation.of(problem)
    blocks = equation.at(none, np.full(N, 1.0 - 1e-10), grazing, AT_REST).linearise()
    rows = Rows.of(equation, blocks, _coupled(blocks), np.dtype(float))
    assert rows.coupled[-1].sum() == grazing.sum()
    unknowns = RANDOM.normal(size=rows.coupled.shape) * rows.coupled
    multiply, precondition = rows.multiplication(), preconditioner(rows)
    np.testing.assert_allclose(precondition(multiply(unknowns.ravel())), unknowns.ravel(), atol=1e-7)


@pytest.mark.parametrize(
    ("law", "axis", "more"), [(IsotropicCoulomb(MU), 0.0, 1), (OrthotropicCoulomb(MU, 0.5 * MU, 0.4), 0.4, 2)]
)
def test_nodes_that_hardly_slip_cost_as_much_in_all_directions(law: ContactLaw, axis: float, more: int) -> None:
    """They stick across their direction, which may be none of the grid's axes nor of the law's: then what friction
    says of tangential tractions is not symmetric."""
    system = HalfSpace(matrix_up_to=0).reduce(
        Body(Material.isotropic(1e9, 0.0).stiffness, half_space_mesh(10.0, 1.0, 39, 1, Quad4()), (), "contact")
    )
    none = np.zeros_like(system.offset)
    gap = np.where(np.hypot(*system.points.T[:2]) < 0.35, -1e-3, np.inf)
    flux = Insulating()
    problem = ContactProblem(system, law, flux_channels(flux, flux), gap, none[:, :2], none[:, :2])
    equation = Equation.of(problem)

    def products(angle: float) -> int:
        load, count = none.copy(), 0
        borne = law.project(np.array([[np.cos(angle), np.sin(angle), -1.0]]))
        load[np.isfinite(gap), :3] = borne * [1.001, 1.001, 1.0]
        blocks = equation.beside(1e6 * load, none, np.zeros(len(gap)), np.zeros(len(gap), bool), AT_REST).linearise()
        rows = Rows.of(equation, blocks, _coupled(blocks), np.dtype(float))
        multiply = rows.multiplication()

        def counted(values: Array) -> Array:
            nonlocal count
            count += 1
            return multiply(values)

        right = np.random.default_rng(0).normal(size=rows.coupled.shape) * rows.coupled
        gmres(counted, preconditioner(rows), right.ravel(), 1e-6)
        return count

    assert max(products(axis + turn) for turn in (0.3, 0.6)) <= products(axis) + more


@pytest.mark.parametrize("kappa", [0.0, np.inf])
def test_contact_without_friction_costs_less_by_what_goes_on_beside_it(
    kappa: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Fewer products for a system that knows how displacements go on beside contact, and the same solution."""
    mesh = half_space_mesh(10.0, 1.0, 39, 1, Quad4())
    system = HalfSpace(matrix_up_to=0).reduce(Body(library_material("orthotropic-mee").stiffness, mesh, (), "contact"))
    none, flux = np.zeros_like(system.offset), StepConductivity(kappa)
    x, y = system.points.T[:2]
    gap = np.where(np.hypot((x + 0.5) % 0.25 - 0.125, (y + 0.5) % 0.25 - 0.125) < 0.08, -1e-3, np.inf)  # 16 spots
    problem = ContactProblem(system, Signorini(), flux_channels(flux, flux), gap, none[:, :2], none[:, :2])
    equation = Equation.of(problem)
    blocks = equation.at(none, np.zeros(len(gap)), np.zeros(len(gap), bool), AT_REST).linearise()
    rows = Rows.of(equation, blocks, _coupled(blocks), np.dtype(float))
    right = np.random.default_rng(1).normal(size=rows.coupled.shape) * rows.coupled
    multiply, counts, solutions = rows.multiplication(), [0, 0], list[Array]()
    for place in range(2):

        def counted(values: Array, place: int = place) -> Array:
            counts[place] += 1
            return multiply(values)

        solutions.append(gmres(counted, preconditioner(rows), right.ravel(), 1e-9)[0])
        monkeypatch.setattr(HalfSpaceSystem, "extension", lambda system, nodes: None)
    np.testing.assert_allclose(solutions[0], solutions[1], rtol=0.0, atol=1e-6 * np.abs(solutions[0]).max())
    assert counts[0] < 0.8 * counts[1], counts
