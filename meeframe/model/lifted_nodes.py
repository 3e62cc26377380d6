"""Nodes without an admissible state because friction, whose limit jumps where contact begins, lifts them."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from meeframe.contact.conduction import MIN_TRACTION
from meeframe.contact.nested import has_nodal_data
from meeframe.contact.problem import ContactProblem, indenter_position
from meeframe.contact.scales import problem_scales
from meeframe.fields import MECHANICAL, N_MECHANICAL, Array
from meeframe.laws.base import (
    ConductivityLaw,
    ContactLaw,
    attraction,
    augmented_traction,
    contact_conductivity,
    fixed_point_map,
    has_resolvent,
)
from meeframe.model.kinematics import Increment
from meeframe.results.records import StepResult

_CANDIDATES: Final = 4
"""Number of nodes that are examined, those that violate the law most."""
_TRIALS: Final = np.logspace(-9, 3, 200)
"""Trial pressures and gaps, in units of the characteristic pressure and of the closure under it."""
_FRACTIONS: Final = np.linspace(0.0, 1.0, 21)
"""Trial fractions of the conduction of a node between open and closed."""
_SWEEPS: Final = 200
"""Projection steps for the friction of one node, which converge as one minus the ratio of two compliances."""
_MARGIN: Final = 1e-6
"""Overlap and gap that count, in units of the closure under the characteristic pressure on the node alone."""


def lifted_node(increment: Increment, step: StepResult) -> int | None:
    """Return a node without any admissible state under the loads of the others in a result; None if none is found.

    Open, such a node would overlap the indenter; in contact, friction lifts it, whatever its pressure. Fluxes of the
    node follow its state where they depend on the pressure alone. Laws that depend on the slip or the node are not
    examined.
    """
    problem, law = increment.problem, increment.problem.contact_law
    if has_resolvent(law) or has_nodal_data(law, len(problem.gap)):
        return None
    load = step.state.load
    if not np.isfinite(load).all():
        return None
    motion = (step.loading.motion - increment.base)[increment.free]
    position = indenter_position(problem, motion) - problem.system.offset - problem.system.apply(load)
    violation, scales = violations(problem, load, position), problem_scales(problem)
    conducting = _pressed_conductors(problem)
    fields = [*range(N_MECHANICAL), *conducting]
    compliances = problem.system.diagonal_blocks()[:, fields][:, :, fields]
    for number in np.argsort(-violation)[:_CANDIDATES]:
        if not violation[number] > 0.0:
            continue
        unloaded = position[number, fields] + compliances[number] @ load[number, fields]
        area = 1.0 if problem.area_fraction is None else float(problem.area_fraction[number])
        node = _Node(law, tuple(conducting.values()), compliances[number], unloaded, area)
        unit = scales.pressure * compliances[number, 2, 2]
        if node.overlaps(unit).min() > _MARGIN * unit and node.gaps_in_contact(scales.pressure).min() > _MARGIN * unit:
            return int(number)
    return None


def violations(problem: ContactProblem, load: Array, position: Array) -> Array:
    """Return by how much nodes violate the contact law, (n,) [Pa].

    load, position: (n, fields), of the nodes, and displacement of the indenter relative to them.
    """
    law, r = problem.contact_law, (1.0 / problem_scales(problem).normal_compliance,) * 2
    traction, gap = load[:, MECHANICAL], position[:, MECHANICAL]
    change = traction - fixed_point_map(law, augmented_traction(law, traction, gap, r), gap, r)
    return np.where(np.isfinite(problem.gap), np.linalg.norm(change, axis=1), 0.0)


def _pressed_conductors(problem: ContactProblem) -> dict[int, ConductivityLaw]:
    """Return the laws of conduction that depend on the pressure alone, by field; none where heat is generated."""
    if problem.friction_heat or problem.joule_heat:
        return {}
    channels = enumerate(problem.channels, N_MECHANICAL)
    return {k: channel.law for k, channel in channels if channel.is_conducting and not channel.law.across_gap}


@dataclass(frozen=True, eq=False)
class _Node:
    """A node under the loads of all others.

    conductors: laws of the fluxes that follow its state; compliance: (fields, fields) of the node, for its tractions
    and these fluxes; unloaded: (fields,), displacement of the indenter relative to the node without its own loads;
    area: fraction of its area in contact, of a contact edge between nodes.
    """

    law: ContactLaw
    conductors: tuple[ConductivityLaw, ...]
    compliance: Array
    unloaded: Array
    area: float

    def overlaps(self, unit: float) -> Array:
        """Return by how much trial gaps without pressure exceed those that result, with all fractions of conduction.

        These are gaps of an open node under their attraction, from zero on; at zero the node may conduct. unit: [m].
        """
        gaps = np.concatenate([np.zeros(len(_FRACTIONS)), unit * _TRIALS])
        fraction = np.concatenate([_FRACTIONS, np.zeros(len(_TRIALS))])
        traction = np.zeros((len(gaps), N_MECHANICAL))
        traction[:, 2] = attraction(self.law, gaps)
        exceeded: Array = gaps - self._position(traction, np.full(len(gaps), MIN_TRACTION), fraction)[:, 2]
        return exceeded

    def gaps_in_contact(self, pressure: float) -> Array:
        """Return the normal gap under each trial pressure and the friction and fluxes that then satisfy the laws.

        pressure: characteristic one [Pa].
        """
        contact = -pressure * _TRIALS
        traction, whole = np.zeros((len(contact), N_MECHANICAL)), np.ones(len(contact))
        traction[:, 2] = contact + attraction(self.law, np.zeros(1))
        scaling = self.law.tangential_scaling()
        step = 1.0 / max(np.linalg.norm(self.compliance[:2, :2] @ scaling, 2), np.finfo(float).tiny)
        for _ in range(_SWEEPS):
            slip = self._position(traction, contact, whole)[:, :2]
            trial = np.column_stack([traction[:, :2] + step * (slip @ scaling), contact])
            traction[:, :2] = self.law.project(trial)[:, :2]
        gaps: Array = self._position(traction, contact, whole)[:, 2]
        return gaps

    def _position(self, traction: Array, contact: Array, fraction: Array) -> Array:
        """Return the displacement of the indenter relative to the node, (m, 3), under tractions (m, 3) and its fluxes.

        contact: (m,), normal tractions without attraction; fraction: (m,), of the conduction in contact.
        """
        own = self.compliance[N_MECHANICAL:, N_MECHANICAL:]
        position = self.unloaded - traction @ self.compliance[:, MECHANICAL].T
        if self.conductors:
            kappa = np.column_stack([contact_conductivity(law, contact) for law in self.conductors])
            fractions = np.tile(fraction[:, None], len(self.conductors))
            touching = np.array([contact_conductivity(law, np.array([MIN_TRACTION]))[0] for law in self.conductors])
            if self.area < 1.0:  # what conducts without pressure does so on this area, in any state
                increase = np.subtract(kappa, touching, out=np.zeros_like(kappa), where=kappa > touching)
                partial = self.area * touching if self.area > 0.0 else 0.0
                kappa = np.where(touching > 0.0, partial + increase, kappa)
                fractions[:, touching > 0.0] = 1.0
            with np.errstate(divide="ignore", over="ignore"):
                transmitted = fractions / (1.0 + 1.0 / (kappa * np.diag(own)))
            # drop = flux / kappa, times the share of the drop that is transmitted
            matrix = transmitted[:, :, None] * own + (1.0 - transmitted)[:, :, None] * np.diag(np.diag(own))
            drive = transmitted * position[:, N_MECHANICAL:]
            flux = np.linalg.solve(matrix, drive[:, :, None])[:, :, 0]
            position = position - flux @ self.compliance[:, N_MECHANICAL:].T
        return np.asarray(position[:, MECHANICAL])
