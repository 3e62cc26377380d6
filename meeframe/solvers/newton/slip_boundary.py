"""Nodes around the boundary between stick and slip, relaxed before the first step of Newton's method on a finer grid.

Between the nodes of a coarser grid tractions are interpolated across that boundary, where they have a kink, and what
the law makes of them there adds up: a step that cuts friction at these nodes moves all others. Newton's method finds
the boundary node by node, one step after the other. Most of it depends on a few nodes around, whose friction is found
here by gradient steps with their responses to each other alone.
"""

from typing import Final

import numpy as np

from meeframe.fields import MECHANICAL
from meeframe.solvers._kernels.stencil_products import neighbours, stencil_products
from meeframe.solvers.newton.boundary_band import ROUGHER, Ring, slips
from meeframe.solvers.newton.residual import Point

WIDTH: Final = 4
"""Spacings from the boundary on either side."""
STEPS: Final = 20
"""At most so many: a step costs a hundredth of a product on a fine grid."""
SETTLED: Final = 1e-2
"""Of the first change of tractions: a smaller one is the last."""
FIRST: Final = 0.3
"""Of the inverse of a node's own response: length of the first gradient step."""


def relaxed_slip(point: Point) -> Point:
    """A point with the friction relaxed around the boundary between stick and slip; the same where there is none, where
    nodes lie on no lattice, or if it does not help. The law is the same everywhere, as it is where grids are nested.

    Projected gradient steps with the lengths of Barzilai and Borwein, IMA J. Numer. Anal. 8 (1988) 141.
    """
    problem = point.equation.problem
    law = problem.contact_law
    if not {0, 1}.issubset(point.equation.loaded):
        return point
    ring = Ring.of(point, (point.load[:, 2] < 0.0) & ~slips(point), WIDTH)
    if ring is None:
        return point
    nodes, reach = ring.nodes, len(ring.stencil.responses) // 2
    around = neighbours(ring.number, ring.places, ring.stencil.periodic, reach)
    responses = np.ascontiguousarray(ring.stencil.responses[:, :, :2, :2]).reshape(-1, 2, 2)
    scaling = law.tangential_scaling()  # in its metric the law projects
    metric = np.linalg.pinv(scaling)
    traction, gap = point.load[nodes, MECHANICAL], np.ascontiguousarray(point.ahead[nodes, :2])
    length = FIRST / float(responses[len(responses) // 2].diagonal().max())
    moved, least, change = np.empty_like(gap), np.inf, np.zeros((len(nodes) + 1, 2))
    for step in range(STEPS):
        trial = traction.copy()
        trial[:, :2] += length * gap @ scaling
        np.subtract(law.project(trial)[:, :2], traction[:, :2], out=change[:-1])
        size = float((change**2).sum())
        if step == 0:
            least = SETTLED**2 * size
        if size <= least:
            break
        stencil_products(around, responses, change, moved)
        traction[:, :2] += change[:-1]
        gap -= moved
        work = float((change[:-1] * moved).sum())
        if not work > 0.0:  # responses of those around alone need not resist all changes
            break
        length = float(((change @ metric) * change).sum()) / work
    if least == 0.0:
        return point
    load = point.load.copy(order="K")
    load[nodes, :2] = traction[:, :2]
    relaxed = point.moved(load, point.contact_fraction, point.grazing, point.motion)
    return relaxed if relaxed.merit < ROUGHER * point.merit else point
