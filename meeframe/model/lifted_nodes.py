"""Nodes without an admissible state because friction, whose limit jumps where contact begins, lifts them."""

from typing import Final

import numpy as np

from meeframe.contact.nested import is_uniform
from meeframe.contact.problem import contact_gap
from meeframe.contact.scales import problem_scales
from meeframe.fields import MECHANICAL, Array
from meeframe.laws.base import ContactLaw, augmented_traction, fixed_point_map
from meeframe.model.kinematics import Increment
from meeframe.results.records import StepResult

_CANDIDATES: Final = 4
"""Number of nodes that are examined, those that violate the law most."""
_PRESSURES: Final = np.logspace(-9, 3, 200)
"""Trial pressures in units of the characteristic pressure."""
_SWEEPS: Final = 200
"""Projection steps for the friction of one node, which converge as one minus the ratio of two compliances."""
_MARGIN: Final = 1e-6
"""Overlap and gap that count, in units of the closure under the characteristic pressure on the node alone."""


def lifted_node(increment: Increment, step: StepResult) -> int | None:
    """Return a node without any admissible state under the loads of the others in a result; None if none is found.

    Without load such a node overlaps the indenter; in contact, friction lifts it, whatever its pressure. Results with
    contact edges between nodes and laws other than projections without attraction are not examined.
    """
    problem, law = increment.problem, increment.problem.contact_law
    if step.area_fraction is not None or not is_uniform(law, len(problem.gap)):
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
        if unloaded[2] >= -_MARGIN * unit:
            continue
        if _gaps_in_contact(law, compliance, unloaded, scales.pressure).min() > _MARGIN * unit:
            return int(node)
    return None


def _gaps_in_contact(law: ContactLaw, compliance: Array, unloaded: Array, pressure: float) -> Array:
    """Return the normal gap of a node under each trial pressure and the friction that then satisfies the law.

    compliance: (3, 3) of the node; unloaded: (3,), its gap without load; pressure: characteristic one [Pa].
    """
    normal = -pressure * _PRESSURES
    friction = np.zeros((len(normal), 2))
    step = 1.0 / np.linalg.eigvalsh(compliance[:2, :2]).max()
    for _ in range(_SWEEPS):
        slip = unloaded[:2] - friction @ compliance[:2, :2].T - normal[:, None] * compliance[:2, 2]
        friction = law.project(np.column_stack([friction + step * slip, normal]))[:, :2]
    gaps: Array = unloaded[2] - friction @ compliance[2, :2] - normal * compliance[2, 2]
    return gaps
