"""A contact problem on the part of its zone around the contact: the others are open and bear nothing there."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from meeframe.contact.conduction import Mask, follows_gap
from meeframe.contact.nested import on_nodes, same_everywhere
from meeframe.contact.problem import ContactProblem, indenter_field
from meeframe.fields import Array, Indices
from meeframe.solvers.newton.residual import Equation, Point
from meeframe.system.capabilities import AnyArray, Restriction, apply_fields

MARGIN: Final = 2.0
"""Spacings of nodes around the contact that the part has besides."""
SLENDER: Final = 0.5
"""Of its longest side the others have at least as much: approximate inverses on slender parts may be poor ones."""


@dataclass(frozen=True, eq=False)
class ContactNeighbourhood:
    """The equation of a problem on m of its n nodes alone, in the scales of the whole. whole: the problem; kept: (m,)
    the nodes."""

    whole: ContactProblem
    kept: Indices
    equation: Equation

    def spread(self, values: AnyArray) -> AnyArray:
        """Values (m, ...) at the nodes that are kept, at all of them: zero at the others."""
        spread = np.zeros((*values.shape[:0:-1], len(self.whole.gap)), values.dtype).T
        spread[self.kept] = values
        return spread

    def has_contact_outside(self, point: Point) -> bool:
        """Whether the indenter overlaps the body beside the part, at a point of the equation there."""
        beside = np.isfinite(self.whole.gap)
        beside[self.kept] = False
        if not beside.any():
            return False
        # tractions that a law has without scaling are loads, too
        loaded, system = sorted({2, *np.flatnonzero(point.load.any(axis=0)).tolist()}), self.whole.system
        load = self.spread(point.load[:, loaded].astype(np.float32))
        moved: Array = apply_fields(system, load, loaded, (2,))[:, 0] + system.offset[:, 2]
        return bool((indenter_field(self.whole, 2, point.motion) < moved)[beside].any())


def kept_nodes(problem: ContactProblem, part: ContactNeighbourhood | None) -> Indices:
    """Nodes of a problem's zone that a part of it has; all of them without one."""
    return np.arange(len(problem.gap)) if part is None else part.kept


def has_parts(problem: ContactProblem) -> bool:
    """Whether there may be an inset of another contact: the law is the same at all nodes, and a node has a part."""
    restriction = problem.system.capability(Restriction)
    return (
        restriction is not None
        and same_everywhere(problem.contact_law, len(problem.gap))
        and restriction.restrict(np.arange(1)) is not None
    )


def inset(problem: ContactProblem, contact: Mask) -> ContactNeighbourhood | None:
    """The problem on a part of the zone that holds nodes (n,), some around them, and all that may be loaded while they
    are open; None if there is no such part, or if the law is not the same at all nodes."""
    if not contact.any() or not same_everywhere(problem.contact_law, len(problem.gap)):
        return None
    if follows_gap(problem):
        contact = np.isfinite(problem.gap)
    elif problem.area_fraction is not None:
        contact = contact | (problem.area_fraction > 0.0)
    points, reach = problem.system.points, MARGIN * np.sqrt(problem.system.weights.max())
    lowest, highest = points[contact].min(axis=0), points[contact].max(axis=0)
    reach = reach + 0.5 * np.maximum(SLENDER * (highest - lowest).max() - (highest - lowest), 0.0)
    near = ((points >= lowest - reach) & (points <= highest + reach)).all(axis=1)
    restriction = problem.system.capability(Restriction)
    part = None if restriction is None else restriction.restrict(np.flatnonzero(near & np.isfinite(problem.gap)))
    if part is None:
        return None
    kept = part.nodes
    if not all(freedom.mode[kept].any() for freedom in problem.prescribed_resultants):
        return None
    return ContactNeighbourhood(problem, kept, Equation.of(on_nodes(problem, part.system, kept), problem))
