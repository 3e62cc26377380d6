"""Solve section 7.1: the four conditions, the sweeps of Fig. 3, the sections of Fig. 4, and convergence."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import meeframe
from meeframe.elements import Quad4
from meeframe.fields import Array
from meeframe.laws import StepConductivity
from meeframe.material.half_space import axisymmetric_compliance
from meeframe.mesh import block_mesh, half_space_mesh
from meeframe.model.case import Case
from meeframe.model.solve import solve_steps
from meeframe.results.records import StepResult, Zone, zone_of
from meeframe.results.resultants import Resultants, resultants
from meeframe.system.reduced import ReducedSystem
from meeframe.testing.closed_forms import CONDITIONS, Indentation, Sphere, indent

HERE = Path(__file__).parent


def load(condition: str) -> Case:
    """Load the case file of one of the four conditions."""
    return meeframe.load_case(HERE / f"{condition.lower()}.toml")


def closed_form(case: Case, condition: str) -> Indentation:
    """Return the closed form of the half space under the sphere of a case (docs/explanation/theory.md)."""
    xi = axisymmetric_compliance(case.material.stiffness)
    return indent(xi, Sphere(case.indenter.radius), case.steps[0].approach, *CONDITIONS[condition])


@dataclass(frozen=True, eq=False)
class Solved:
    """Solution of one condition on one reduced system."""

    zone: Zone
    step: StepResult

    @property
    def totals(self) -> Resultants:
        """Force, charge, magnetic flux, maxima."""
        return resultants(self.zone, self.step)

    def section(self) -> tuple[Array, Array, Array]:
        """Return the section along x through the centre: x (m,) [m], pressure (m,) [Pa], potentials (m, 2)."""
        x, y = self.zone.points[:, 0], self.zone.points[:, 1]
        line = np.flatnonzero(np.abs(y) < 1e-9 * np.ptp(y))
        line = line[np.argsort(x[line])]
        return x[line], -self.step.traction[line, 2], self.step.potentials[line]


def solve(case: Case, system: ReducedSystem) -> Solved:
    """Solve the single step of a case. Raises RuntimeError if it does not converge."""
    (step,) = solve_steps(case, system)
    if step.status != "converged":
        raise RuntimeError(f"{case.title}: {step.status}: {step.message}")
    return Solved(zone_of(system), step)


def totals(solved: Solved) -> dict[str, float]:
    """Return force of the indenter [N], charge [C] and magnetic flux [Wb]."""
    result = solved.totals
    return {"force": float(-result.force[2]), "charge": result.charge, "magnetic_flux": result.magnetic_flux}


def exact_totals(exact: Indentation) -> dict[str, float]:
    """Return the totals of a closed form."""
    return {"force": exact.force, "charge": exact.charge, "magnetic_flux": exact.magnetic_flux}


def relative(computed: dict[str, float], true: dict[str, float]) -> dict[str, float]:
    """Return the relative differences of the totals whose exact values are not zero."""
    return {name: computed[name] / value - 1 for name, value in true.items() if value != 0}


def differences(solved: Solved, exact: Indentation) -> dict[str, float]:
    """Return the relative differences from the half space of the totals that are not zero there."""
    return relative(totals(solved), exact_totals(exact))


def section_differences(solved: Solved, exact: Indentation, insulated: Indentation) -> dict[str, float]:
    """Return the largest differences on the section, relative to the largest value of the insulated half space.

    Nodes within one element of the contact radius are excluded.
    """
    x, pressure, potentials = solved.section()
    element = np.diff(x).max()
    inner = np.abs(np.abs(x) - exact.contact_radius) > element
    r, origin = np.abs(x[inner]), np.zeros(1)
    columns = {
        "pressure": (pressure[inner], exact.pressure(r), exact.pressure(origin)),
        "electric potential": (potentials[inner, 0], exact.electric_potential(r), insulated.electric_potential(origin)),
        "magnetic potential": (potentials[inner, 1], exact.magnetic_potential(r), insulated.magnetic_potential(origin)),
    }
    return {
        name: float(np.abs(computed - true).max() / np.abs(scale).max())
        for name, (computed, true, scale) in columns.items()
    }


def conducting(case: Case, electric: float, magnetic: float) -> Case:
    """Return a case with step conductivities [F/m^2], [H/m^2]."""
    return replace(case, conductivity={"electric": StepConductivity(electric), "magnetic": StepConductivity(magnetic)})


@dataclass(frozen=True, eq=False)
class Sweep:
    """Sweep of the conductivity of one field: kappa (m,) relative to the characteristic value, and the solutions."""

    condition: str
    kappa: Array
    solved: tuple[Solved, ...]
    limit: Indentation


def characteristic_conductivity(case: Case, field: int) -> float:
    """Return 1 / (|xi_cc| a), with c the electric (1) or magnetic (2) field."""
    xi = axisymmetric_compliance(case.material.stiffness)
    return float(1 / (abs(xi[field, field]) * closed_form(case, "EMII").contact_radius))


def sweep(case: Case, system: ReducedSystem, condition: str, kappa: Array) -> Sweep:
    """Solve Fig. 3: from insulating to conducting, electric (ECMII) or magnetic (EIMCI)."""
    field = 1 if condition == "ECMII" else 2
    unit = characteristic_conductivity(case, field)

    def at(value: float) -> Case:
        return conducting(case, value * unit, 0.0) if field == 1 else conducting(case, 0.0, value * unit)

    return Sweep(condition, kappa, tuple(solve(at(k), system) for k in kappa), closed_form(case, condition))


@dataclass(frozen=True)
class Refinement:
    """One mesh of the convergence study; half_width [m]; enlargement: inf for a half space; totals by condition."""

    enlargement: float
    half_width: float
    divisions: int
    elements: int
    totals: dict[str, dict[str, float]]


def refined(case: Case, enlargement: float, divisions: int) -> Case:
    """Return the case on a block `enlargement` times as large in all directions, or on a half space (inf).

    Rings and layers are numerous enough that the zone, `divisions` elements wide, limits the accuracy.
    """
    finer = (divisions / 16) ** 0.5
    if np.isinf(enlargement):
        mesh = half_space_mesh(3.2, 0.005, divisions, round(20 * finer), Quad4())
        return replace(case, mesh=mesh, conditions=())
    rings = round((14 + np.log2(enlargement)) * finer)
    layers = round((8 + np.log2(enlargement)) * finer)
    mesh = block_mesh(0.05 * enlargement, 0.12 * enlargement, 0.005, divisions, rings, layers, Quad4())
    return replace(case, mesh=mesh)


def refinements(case: Case, meshes: list[tuple[float, int]]) -> Iterator[Refinement]:
    """Solve the four conditions on meshes (enlargement, divisions)."""
    for enlargement, divisions in meshes:
        larger = refined(case, enlargement, divisions)
        system = larger.formulation.reduce(larger.body)
        result = {}
        for condition, potentials in CONDITIONS.items():
            electric, magnetic = (np.inf if potential is not None else 0.0 for potential in potentials)
            result[condition] = totals(solve(conducting(larger, electric, magnetic), system))
        half_width = float(np.ptp(larger.mesh.points[:, 0]) / 2)
        yield Refinement(enlargement, half_width, divisions, larger.mesh.n_elements, result)
