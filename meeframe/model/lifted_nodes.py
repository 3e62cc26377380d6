"""Nodes without an admissible state because friction, whose limit jumps where contact begins, lifts them."""

from typing import Final

import numpy as np

from meeframe.contact.nested import has_nodal_data
from meeframe.contact.problem import contact_gap
from meeframe.contact.scales import problem_scales
from meeframe.fields import MECHANICAL, Array
from meeframe.laws.base import ContactLaw, attraction, augmented_traction, fixed_point_map, has_resolvent
from meeframe.model.kinematics import Increment
from meeframe.results.records import StepResult

_CANDIDATES: Final = 4
"""Number of nodes that are examined, those that violate the law most."""
_TRIALS: Final = np.logspace(-9, 3, 200)
"""Trial pressures and gaps, in units of the characteristic pressure and of the closure under it."""
_SWEEPS: Final = 200
"""Projection steps for the friction of one node, which converge as one minus the ratio of two compliances."""
_MARGIN: Final = 1e-6
"""Overlap and gap that count, in units of the closure under the characteristic pressure on the node alone."""


def lifted_node(increment: Increment, step: StepResult) -> int | None:
    """Return a node without any admissible state under the loads of the others in a result; None if none is found.

    Open, such a node would overlap the indenter; in contact, friction lifts it, whatever its pressure. Results with
    contact edges between nodes, and laws that depend on the slip or the node, are not examined.
    """
    problem, law = increment.problem, increment.problem.contact_law
    if step.area_fraction is not None or has_resolvent(law) or has_nodal_data(law, len(problem.gap)):
        return None
    if not np.isfinite(step.traction).all():
        return None
    load = step.state.load
    displacement = problem.system.offset + problem.system.apply(load)
    motion = (step.loading.motion - increment.base)[increment.free]
    gap = contact_gap(problem, displacement, motion)
    scales = problem_scales(problem)
    r = (1.0 / scales.normal_compliance,) * 2
    traction = load[:, MECHANICAL]
    change = traction - fixed_point_map(law, augmented_traction(law, traction, gap, r), gap, r)
    violation = np.where(np.isfinite(problem.gap), np.linalg.norm(change, axis=1), 0.0)
    compliances = problem.system.diagonal_blocks()[:, MECHANICAL, MECHANICAL]
    for node in np.argsort(-violation)[:_CANDIDATES]:
        if not violation[node] > 0.0:
            continue
        compliance = compliances[node]
        unit = scales.pressure * compliance[2, 2]
        unloaded = gap[node] + compliance @ traction[node]
        if (
            _overlaps(law, compliance, unloaded, unit).min() > _MARGIN * unit
            and _gaps_in_contact(law, compliance, unloaded, scales.pressure).min() > _MARGIN * unit
        ):
            return int(node)
    return None


def _overlaps(law: ContactLaw, compliance: Array, unloaded: Array, unit: float) -> Array:
    """Return by how much trial gaps of an open node exceed those that result under their attraction, from zero on.

    compliance, unloaded: as for _gaps_in_contact; unit: of the gaps [m].
    """
    gaps = np.append(0.0, unit * _TRIALS)
    exceeded: Array = gaps + compliance[2, 2] * attraction(law, gaps) - unloaded[2]
    return exceeded


def _gaps_in_contact(law: ContactLaw, compliance: Array, unloaded: Array, pressure: float) -> Array:
    """Return the normal gap of a node under each trial pressure and the friction that then satisfies the law.

    compliance: (3, 3) of the node; unloaded: (3,), its gap without load; pressure: characteristic one [Pa].
    """
    contact = -pressure * _TRIALS
    normal = contact + attraction(law, np.zeros(1))
    friction, scaling = np.zeros((len(normal), 2)), law.tangential_scaling()
    step = 1.0 / max(np.linalg.norm(compliance[:2, :2] @ scaling, 2), np.finfo(float).tiny)
    for _ in range(_SWEEPS):
        slip = unloaded[:2] - friction @ compliance[:2, :2].T - normal[:, None] * compliance[:2, 2]
        friction = law.project(np.column_stack([friction + step * (slip @ scaling), contact]))[:, :2]
    gaps: Array = unloaded[2] - friction @ compliance[2, :2] - normal * compliance[2, 2]
    return gaps
