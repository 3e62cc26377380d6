"""Compare friction with closed forms on boundary elements, from case files."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from study import FRICTION, RADIUS, YOUNG, BondedRow, SlipRow, SlipState, slip_row

import meeframe
from meeframe.contact.problem import Status
from meeframe.elements import Quad4
from meeframe.fields import Array
from meeframe.laws import Signorini
from meeframe.mesh import half_space_mesh
from meeframe.model.case import Case
from meeframe.model.solve import reduce, solve_steps
from meeframe.results.records import StepResult, Zone, zone_of
from meeframe.results.resultants import resultants
from meeframe.testing.closed_forms_friction import (
    HertzContact,
    PartialSlip,
    SphereTorsion,
    bonding_factor,
    contact_modulus,
)

HERE = Path(__file__).parent
SPHERE_POISSON, PUNCH_POISSON = 0.49, 0.2
"""Poisson's ratios of sphere.toml, torsion.toml and punch.toml, which repeat RADIUS, YOUNG and FRICTION."""
ELEMENTS_SIDE = 5e-3
"""Side of the zone in the case files [m]."""


def load(name: str, divisions: int) -> Case:
    """Load a case file with boundary elements and the given number of elements along a side of the zone."""
    case = meeframe.load_case(HERE / f"{name}.toml")
    rings = round(10 * (divisions / 24) ** 0.5)
    return replace(case, mesh=half_space_mesh(0.1, ELEMENTS_SIDE, divisions, rings, Quad4()))


@dataclass(frozen=True)
class DragRow:
    """Cattaneo-Mindlin on boundary elements, under prescribed forces.

    per_radius: elements in a contact radius; approach: relative difference; row: at the first reversal, with the
    displacement as its load; second_reversal: relative difference of the displacement at the second reversal;
    dissipation: relative difference in the loop.
    """

    per_radius: float
    approach: float
    row: SlipRow
    second_reversal: float
    dissipation: float


def drag_on_elements(divisions: int) -> tuple[DragRow, SlipState]:
    """Solve sphere.toml: a tangential force, the opposite one, and the first again."""
    zone, (pressed, *turns) = _solved("sphere", divisions)
    exact = PartialSlip(_hertz_of(zone, pressed), FRICTION)
    force = float(resultants(zone, turns[0]).tangential_force[0])
    along = _global_traction(zone, turns[0])[:, 0]
    r = np.hypot(zone.points[:, 0], zone.points[:, 1])
    state = _state_on_elements(
        zone, turns[0], along, exact.traction(r, force), exact.hertz, exact.stick_radius(force), divisions
    )
    there, back = (float(step.loading.translation[0]) / exact.displacement(force) for step in turns[:2])
    row = slip_row(state, force / exact.limit_force, there - 1.0, SPHERE_POISSON, False, divisions)
    dissipated = sum(resultants(zone, step).dissipated_energy for step in turns[1:]) / exact.loop_dissipation(force)
    approach = pressed.loading.approach / exact.hertz.approach
    return DragRow(state.contact_radius / state.size, approach - 1.0, row, -back - 1.0, dissipated - 1.0), state


def torsion_on_elements(divisions: int) -> tuple[SlipRow, SlipState]:
    """Solve torsion.toml: a twist; the load of the row is the torque."""
    zone, (pressed, twisted) = _solved("torsion", divisions)
    exact = SphereTorsion(_hertz_of(zone, pressed), FRICTION)
    twist = twisted.loading.twist
    x, y, _ = zone.points.T
    r, traction = np.hypot(x, y), _global_traction(zone, twisted)
    # on the axis the circumferential direction is undefined and the traction zero
    around = np.divide(x * traction[:, 1] - y * traction[:, 0], r, out=np.zeros_like(r), where=r > 0.0)
    share = exact.stick_share(twist)
    state = _state_on_elements(
        zone, twisted, around, exact.traction(r, twist), exact.hertz, share * exact.hertz.contact_radius, divisions
    )
    torque = resultants(zone, twisted).torque / exact.torque(twist)
    return slip_row(state, share, torque - 1.0, SPHERE_POISSON, False, divisions), state


def _solved(name: str, divisions: int) -> tuple[Zone, list[StepResult]]:
    case = load(name, divisions)
    system = reduce(case)
    steps = list(solve_steps(case, system))
    check_converged(*steps)
    return zone_of(system), steps


def _hertz_of(zone: Zone, pressed: StepResult) -> HertzContact:
    """Return the Hertz contact under the normal force of a step."""
    normal = resultants(zone, pressed).normal_force
    approach = (0.75 * normal / contact_modulus(YOUNG, SPHERE_POISSON)) ** (2 / 3) / RADIUS ** (1 / 3)
    return HertzContact(YOUNG, SPHERE_POISSON, RADIUS, approach)


def _global_traction(zone: Zone, step: StepResult) -> Array:
    """Return tractions (n, 3) [Pa] in global axes; frames of a flat zone are these axes rotated about the normal."""
    return np.asarray(np.einsum("na,nai->ni", step.traction, zone.frames))


def _state_on_elements(
    zone: Zone, step: StepResult, along: Array, exact: Array, hertz: HertzContact, stick_radius: float, divisions: int
) -> SlipState:
    r = np.hypot(zone.points[:, 0], zone.points[:, 1])
    size = ELEMENTS_SIDE / divisions
    return SlipState(r, step.traction, along, exact, zone.weights, size, hertz.contact_radius, stick_radius, FRICTION)


def punch_on_elements(divisions: int) -> BondedRow:
    """Solve punch.toml with mu = inf and with mu = 0."""
    case = load("punch", divisions)
    system = reduce(case)
    (bonded,) = solve_steps(case, system)
    (free,) = solve_steps(replace(case, contact_law=Signorini()), system)
    check_converged(bonded, free)
    forces = [-resultants(zone_of(system), step).force[2] for step in (bonded, free)]
    exact = 2.0 * contact_modulus(YOUNG, PUNCH_POISSON) * case.indenter.radius * bonded.loading.approach
    return BondedRow(
        PUNCH_POISSON, divisions, bonding_factor(PUNCH_POISSON), forces[0] / forces[1], forces[1] / exact - 1.0
    )


def check_converged(*steps: StepResult) -> None:
    """Raise RuntimeError for a step that is not a solution."""
    for step in steps:
        if step.status is not Status.CONVERGED:
            raise RuntimeError(f"{step.loading}: {step.status}: {step.message}")
