"""Contact problem restricted to the neighbourhood of the contact; all other nodes are open and without load."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from meeframe.common.memory import zeros
from meeframe.contact.conduction import Mask, depends_on_gap
from meeframe.contact.nested import is_uniform, restrict_problem
from meeframe.contact.problem import ContactProblem
from meeframe.fields import Indices
from meeframe.solvers.newton.residual import ContactResidual
from meeframe.system.capabilities import AnyArray, Restriction

MARGIN: Final = 2.0
"""Width of the margin around the contact, in spacings of nodes."""
MIN_ASPECT_RATIO: Final = 0.5
"""Smallest ratio of the other sides of the neighbourhood to the longest one.

Approximate inverses on slender neighbourhoods may be poor.
"""


@dataclass(frozen=True, eq=False)
class ContactNeighbourhood:
    """Equation of a problem on m of its n nodes alone, in the scales of the whole problem.

    Attributes
    ----------
    problem : ContactProblem
        Problem on all n nodes.
    nodes : Indices
        (m,), nodes of the neighbourhood.
    equation : ContactResidual
        Equation on these nodes.
    """

    problem: ContactProblem
    nodes: Indices
    equation: ContactResidual

    def scatter(self, values: AnyArray) -> AnyArray:
        """Return values (m, ...) of the neighbourhood on all nodes, zero outside it."""
        scattered = zeros((len(self.problem.gap), *values.shape[1:]), values.dtype.type)
        for column in np.ndindex(values.shape[1:]):
            if values[:, *column].any():
                scattered[self.nodes, *column] = values[:, *column]
        return scattered


def contact_neighbourhood(problem: ContactProblem, contact: Mask) -> ContactNeighbourhood | None:
    """Return the problem on a neighbourhood of the nodes (n,) in contact, or None.

    It includes a margin and all nodes that may be loaded while they are open. The result is None if the system cannot
    be restricted in this way, or if the law is not the same at all nodes.
    """
    if not contact.any() or not is_uniform(problem.contact_law, len(problem.gap)):
        return None
    if depends_on_gap(problem):
        contact = np.isfinite(problem.gap)
    elif problem.area_fraction is not None:
        contact = contact | (problem.area_fraction > 0.0)
    points, margin = problem.system.points, MARGIN * np.sqrt(problem.system.weights.max())
    lowest, highest = points[contact].min(axis=0), points[contact].max(axis=0)
    margin = margin + 0.5 * np.maximum(MIN_ASPECT_RATIO * (highest - lowest).max() - (highest - lowest), 0.0)
    near = ((points >= lowest - margin) & (points <= highest + margin)).all(axis=1)
    restriction = problem.system.capability(Restriction)
    subsystem = None if restriction is None else restriction.restrict(np.flatnonzero(near & np.isfinite(problem.gap)))
    if subsystem is None:
        return None
    nodes = subsystem.nodes
    if not all(resultant.mode[nodes].any() for resultant in problem.prescribed_resultants):
        return None
    return ContactNeighbourhood(
        problem, nodes, ContactResidual.of(restrict_problem(problem, subsystem.system, nodes), problem)
    )
