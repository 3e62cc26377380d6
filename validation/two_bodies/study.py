"""Solve contact of two deformable bodies: Hertz, joined half spaces in closed form, and exchanged roles."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

import meeframe
from meeframe.fields import Array
from meeframe.laws import OrthotropicCoulomb, StepConductivity
from meeframe.material.half_space import axisymmetric_compliance
from meeframe.model.case import Case
from meeframe.model.second_body import SecondBody
from meeframe.model.solve import reduce, solve_steps
from meeframe.results.records import Region, StepResult, Zone, zone_of
from meeframe.results.resultants import Resultants, resultants
from meeframe.system.reduced import ReducedSystem
from meeframe.system.two_body import match_nodes
from meeframe.testing.closed_forms import CONDITIONS, Indentation, Sphere, indent

HERE = Path(__file__).parent
TURN: Final = np.diag([1.0, -1.0, -1.0])
EXCHANGED: Final = np.array([-1.0, 1.0, 1.0, -1.0, -1.0])
"""Signs of a load (t1, t2, t.nu, q, s) seen from the other body: reversed and rotated about x1."""


def load(name: str) -> Case:
    """Load a case file of this folder."""
    return meeframe.load_case(HERE / f"{name}.toml")


@dataclass(frozen=True, eq=False)
class Solved:
    """Last increment of a case on its contact zone."""

    zone: Zone
    step: StepResult

    @property
    def totals(self) -> Resultants:
        """Force, charge, magnetic flux, maxima."""
        return resultants(self.zone, self.step)

    @property
    def load(self) -> Array:
        """Load (n, 5) as in ReducedSystem."""
        return self.step.state.load


def solve(case: Case, system: ReducedSystem) -> Solved:
    """Solve a case and return its end. Raises RuntimeError if an increment does not converge."""
    steps = list(solve_steps(case, system, boundary=False))
    for step in steps:
        if step.status != "converged":
            raise RuntimeError(f"{case.title}: {step.status}: {step.message}")
    return Solved(zone_of(system), steps[-1])


def second_body(case: Case) -> SecondBody:
    """Return the second body of a case that has one."""
    if case.second_body is None:
        raise ValueError(f"{case.title}: one body only")
    return case.second_body


def closed_form(case: Case, condition: str = "EMII") -> Indentation:
    """Return the closed form of two axisymmetric half spaces, xi = xi_A + D xi_B D (docs/explanation/theory.md)."""
    flip = np.array([-1.0, 1.0, 1.0])
    first, second = (axisymmetric_compliance(body.material.stiffness) for body in (case, second_body(case)))
    joined = first + flip[:, None] * second * flip
    return indent(joined, Sphere(case.indenter.radius), case.steps[0].approach, *CONDITIONS[condition])


def pressure_difference(solved: Solved, exact: Indentation) -> float:
    """Return the largest relative difference of the pressure, without nodes of elements on the contact edge."""
    points = solved.zone.points
    r = np.hypot(points[:, 0], points[:, 1])
    element = np.diff(np.unique(np.round(points[:, 0], 12))).max()
    retained = np.abs(r - exact.contact_radius) > np.sqrt(2.0) * element  # the diagonal
    difference = -solved.step.traction[retained, 2] - exact.pressure(r[retained])
    return float(np.abs(difference).max() / exact.pressure(np.zeros(1))[0])


def tangential_share(solved: Solved) -> float:
    """Return the ratio of the largest tangential traction and the largest pressure."""
    return float(np.linalg.norm(solved.step.traction[:, :2], axis=1).max() / solved.totals.max_pressure)


@dataclass(frozen=True)
class Hertz:
    """Elastic bodies: force [N] and its exact value, difference of the pressure, tangential_share."""

    title: str
    force: float
    exact: float
    pressure: float
    tangential: float


def hertz(name: str) -> Hertz:
    """Compare a case of two elastic bodies with Hertz."""
    case = load(name)
    solved, exact = solve(case, reduce(case)), closed_form(case)
    force = -float(solved.totals.force[2])
    return Hertz(case.title, force, exact.force, pressure_difference(solved, exact), tangential_share(solved))


def rigid_share(name: str) -> float:
    """Return the tangential_share with a rigid sphere in place of the second body."""
    case = replace(load(name), second_body=None)
    return tangential_share(solve(case, reduce(case)))


def conducting(case: Case, condition: str) -> Case:
    """Return a case in one of the four conditions, perfectly conducting or insulating."""
    electric, magnetic = (0.0 if potential is None else np.inf for potential in CONDITIONS[condition])
    return replace(case, conductivity={"electric": StepConductivity(electric), "magnetic": StepConductivity(magnetic)})


@dataclass(frozen=True)
class Joined:
    """Two bodies of Table 1 in one condition: computed and exact totals (P, Q, M)."""

    poling: str
    condition: str
    observed: tuple[float, float, float]
    exact: tuple[float, float, float]


def joined() -> list[Joined]:
    """Solve the four conditions, with bodies poled towards each other and in the same direction."""
    rows = []
    for poling in ("towards each other", "the same way in space"):
        case = load("poled")
        if poling == "the same way in space":
            case = replace(
                case, second_body=replace(second_body(case), material=second_body(case).material.rotated(TURN))
            )
        system = reduce(case)
        for condition in CONDITIONS:
            result, exact = solve(conducting(case, condition), system).totals, closed_form(case, condition)
            totals = -float(result.force[2]), result.charge, result.magnetic_flux
            rows.append(Joined(poling, condition, totals, (exact.force, exact.charge, exact.magnetic_flux)))
    return rows


def exchanged(case: Case) -> Case:
    """Return the case seen from the other body: everything rotated by 180 degrees about x1, and reversed."""
    other = second_body(case)
    law, place = case.contact_law, case.placement
    if isinstance(law, OrthotropicCoulomb):
        law = replace(law, angle=-law.angle)
    return replace(
        case,
        material=other.material,
        mesh=other.mesh,
        conditions=other.conditions,
        zone=other.zone,
        formulation=other.formulation,
        second_body=SecondBody(case.material, case.mesh, case.conditions, case.zone, case.formulation),
        contact_law=law,
        placement=replace(place, y=-place.y),
        potentials={name: -value for name, value in case.potentials.items()},
        steps=tuple(
            step if step.translation is None else replace(step, translation=(-step.translation[0], step.translation[1]))
            for step in case.steps
        ),
    )


@dataclass(frozen=True)
class Roles:
    """Results of a case seen from the first body and from the other.

    totals: from either; differences: (5,) the largest of each column of the load over its largest value; pressed,
    stuck: how many nodes are in contact, and stick; alike: the regions of open, slip and stick agree at every node.
    """

    totals: tuple[Resultants, Resultants]
    differences: Array
    pressed: int
    stuck: int
    alike: bool


def roles(case: Case) -> Roles:
    """Solve a case and the same case with exchanged roles."""
    one, two = (solve(variant, reduce(variant)) for variant in (case, exchanged(case)))
    partners = match_nodes(one.zone, two.zone)
    assert partners is not None
    seen = two.load[partners] * EXCHANGED
    region = one.step.region
    return Roles(
        totals=(one.totals, two.totals),
        differences=np.abs(seen - one.load).max(axis=0) / np.abs(one.load).max(axis=0),
        pressed=int((region != Region.OPEN).sum()),
        stuck=int((region == Region.STICK).sum()),
        alike=bool(np.array_equal(region, two.step.region[partners])),
    )
