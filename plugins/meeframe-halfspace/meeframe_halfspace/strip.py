"""Additional response of a node at a contact edge to its load, from the conducting strip.

A strip |x| < a at a constant potential carries Q/(pi sqrt(a^2 - x^2)) per unit of length, and the potential is 2 Q
ln(2/a) if a line source has -2 ln r (Muskhelishvili, Singular Integral Equations (1953), section 88). On equally spaced
nodes the same charge and potential belong to a strip whose edge is some distance beyond the outermost node. If the
response of that node to its load increases, the edge moves inwards, as far as its position without that node: every
position of an edge between nodes corresponds to one response. Lengths are in spacings, responses are to densities on
lines.
"""

from functools import lru_cache
from typing import Final

import numpy as np
from scipy.linalg import lu_factor, lu_solve, toeplitz

from meeframe.plugin import Array

NODES: Final = 200
"""Nodes across the strip; more of them do not change the fourth digit."""
STEPS: Final = 400
MIN_FRACTION: Final = 0.02
"""Smallest ratio of a node's response and its increased one, so that a node that is hardly covered has a finite one."""


def edge_response(distance: Array) -> Array:
    """Return the increase of a node's response to its load, that of a line, (n,) >= 0.

    It is zero beyond the farthest edge of an unchanged node, and largest where the node is not covered.

    Parameters
    ----------
    distance
        Distances (n,) of the edge beyond the node.
    """
    fraction = np.interp(distance, *_edge_table())
    increase: Array = line_responses(1)[0] * (1.0 / np.maximum(fraction, MIN_FRACTION) - 1.0)
    return increase


def edge_limits() -> tuple[float, float]:
    """Return the distances of the edge beyond a node above which it begins to be covered, and is fully covered."""
    distances = _edge_table()[0]
    return float(distances[0]), float(distances[-1])


def line_responses(count: int) -> Array:
    """Return the responses (count,) at 0 .. count - 1 spacings from a line of nodes with a bilinear density."""
    m = np.arange(count, dtype=float)
    responses: Array = _primitive(m + 1.0) - 2.0 * _primitive(m) + _primitive(m - 1.0)
    return responses


@lru_cache(maxsize=1)
def _edge_table() -> tuple[Array, Array]:
    """Return distances of the edge, increasing, and ratios from 0 to 1 of a node's response and its increased one."""
    fraction = np.linspace(1.0, 0.0, STEPS, endpoint=False)
    responses = line_responses(NODES)
    factor = lu_factor(toeplitz(responses))
    ends = np.zeros((NODES, 2))
    ends[[0, -1], [0, 1]] = 1.0
    inverse = lu_solve(factor, np.column_stack([ends, np.ones(NODES)]))
    uniform, charge = inverse[:, 2], float(inverse[:, 2].sum())
    # by symmetry, one equation for the change of the solution due to the larger response of both ends
    coupling = float(inverse[0, 0] + inverse[0, 1])
    increase = responses[0] * (1.0 / fraction - 1.0)
    change = -increase * uniform[0] / (1.0 + increase * coupling)
    total = charge + change * 2.0 * uniform[0]
    distance = 2.0 * np.exp(-0.5 / total) - (NODES - 1) / 2.0
    uncovered = distance[0] - 1.0
    return np.append(uncovered, distance[::-1]), np.append(0.0, fraction[::-1])


def _primitive(x: Array) -> Array:
    """Return the second primitive of -2 ln |x|."""
    size = np.abs(x)
    primitive: Array = x**2 * (1.5 - np.log(np.where(size > 0.0, size, 1.0)))
    return primitive
