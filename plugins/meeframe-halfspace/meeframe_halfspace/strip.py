"""Extra response of nodes at a contact edge to their own load, derived from the conducting strip.

A strip |x| < a at a constant potential carries Q/(pi sqrt(a^2 - x^2)) per unit of length, and the potential is
2 Q ln(2/a) if a line source has -2 ln r (Muskhelishvili, Singular Integral Equations (1953), section 88). On equally
spaced nodes the same charge and potential belong to a strip whose edge is some way beyond the outermost node. If that
node's own response grows, the edge moves inwards, as far as to where it is without that node: every place of an edge
between nodes has its own response. Lengths in spacings; responses to densities on lines.
"""

from functools import lru_cache
from typing import Final

import numpy as np
from scipy.linalg import lu_factor, lu_solve, toeplitz

from meeframe.plugin import Array

NODES: Final = 200
"""Across the strip: more of them change nothing in the fourth digit."""
STEPS: Final = 400
LEAST: Final = 0.02
"""Of a node's own response that is left of it in a larger one: that of a node hardly covered is kept finite."""


def edge_response(distance: Array) -> Array:
    """Return the extra response (n,) >= 0 of nodes of a line; distance: (n,) of the edge beyond the node.

    Zero beyond the farthest edge that a node has by itself, largest where it is no longer covered.
    """
    share = np.interp(distance, *_places())
    grown: Array = line_responses(1)[0] * (1.0 / np.maximum(share, LEAST) - 1.0)
    return grown


def edge_limits() -> tuple[float, float]:
    """Distances of the edge beyond a node from which on that node is not covered, and from which on it is wholly."""
    places = _places()[0]
    return float(places[0]), float(places[-1])


def line_responses(count: int) -> Array:
    """Response (count,) 0 .. count - 1 spacings from a line of nodes with a density that falls linearly to the next."""
    m = np.arange(count, dtype=float)
    responses: Array = _primitive(m + 1.0) - 2.0 * _primitive(m) + _primitive(m - 1.0)
    return responses


@lru_cache(maxsize=1)
def _places() -> tuple[Array, Array]:
    """Distances of the edge, rising, and share of the own response in the larger one, from 0 to 1."""
    share = np.linspace(1.0, 0.0, STEPS, endpoint=False)
    responses = line_responses(NODES)
    factor = lu_factor(toeplitz(responses))
    ends = np.zeros((NODES, 2))
    ends[[0, -1], [0, 1]] = 1.0
    inverse = lu_solve(factor, np.column_stack([ends, np.ones(NODES)]))
    alone, charge = inverse[:, 2], float(inverse[:, 2].sum())
    # both ends alike: one equation for the change of the solution by their larger response
    coupling = float(inverse[0, 0] + inverse[0, 1])
    grown = responses[0] * (1.0 / share - 1.0)
    change = -grown * alone[0] / (1.0 + grown * coupling)
    total = charge + change * 2.0 * alone[0]
    distance = 2.0 * np.exp(-0.5 / total) - (NODES - 1) / 2.0
    without = distance[0] - 1.0
    return np.append(without, distance[::-1]), np.append(0.0, share[::-1])


def _primitive(x: Array) -> Array:
    """Second primitive of -2 ln |x|."""
    size = np.abs(x)
    primitive: Array = x**2 * (1.5 - np.log(np.where(size > 0.0, size, 1.0)))
    return primitive
