"""Relaxation of nodes around the stick-slip boundary before the first step of Newton's method on a finer grid.

Between the nodes of a coarser grid tractions are interpolated across that boundary, where they have a kink, and the
errors that projection by the law makes of it accumulate: a step that reduces friction at these nodes moves all others.
Newton's method finds the boundary node by node, in successive steps. Most of it depends on a few nodes around, whose
friction is found here by gradient steps with their responses to each other alone.
"""

from typing import Final

import numpy as np

from meeframe.fields import MECHANICAL
from meeframe.solvers._kernels.stencil_products import neighbours, stencil_products
from meeframe.solvers.newton.boundary_band import MAX_MERIT_GROWTH, BoundaryBand, slips
from meeframe.solvers.newton.residual import ResidualState

WIDTH: Final = 4
"""Half width of the relaxed band, in spacings from the boundary."""
MAX_STEPS: Final = 20
"""Largest number of gradient steps; a step costs a hundredth of a product on a fine grid."""
STEP_TOLERANCE: Final = 1e-2
"""Change of tractions, relative to the first one, below which the iteration ends."""
FIRST_LENGTH: Final = 0.3
"""Length of the first gradient step, relative to the inverse of a node's self-compliance."""


def smooth_slip_boundary(point: ResidualState) -> ResidualState:
    """Return a point with the friction relaxed around the stick-slip boundary.

    The result is the given point where there is no such boundary, where nodes lie on no lattice, or if relaxation does
    not help. The law is the same everywhere, as it is where grids are nested.

    Projected gradient steps with the lengths of Barzilai and Borwein, IMA J. Numer. Anal. 8 (1988) 141.
    """
    problem = point.equation.problem
    law = problem.contact_law
    if not {0, 1}.issubset(point.equation.loaded):
        return point
    band = BoundaryBand.of(point, (point.load[:, 2] < 0.0) & ~slips(point), WIDTH)
    if band is None:
        return point
    nodes, radius = band.nodes, len(band.stencil.responses) // 2
    neighbour_numbers = neighbours(band.number, band.positions, band.stencil.periodic, radius)
    responses = np.ascontiguousarray(band.stencil.responses[:, :, :2, :2]).reshape(-1, 2, 2)
    scaling = law.tangential_scaling()  # the law projects in its metric
    metric = np.linalg.pinv(scaling)
    traction, gap = point.load[nodes, MECHANICAL], np.ascontiguousarray(point.relative_displacement[nodes, :2])
    length = FIRST_LENGTH / float(responses[len(responses) // 2].diagonal().max())
    increment, min_size, change = np.empty_like(gap), np.inf, np.zeros((len(nodes) + 1, 2))
    for step in range(MAX_STEPS):
        trial = traction.copy()
        trial[:, :2] += length * gap @ scaling
        np.subtract(law.project(trial)[:, :2], traction[:, :2], out=change[:-1])
        size = float((change**2).sum())
        if step == 0:
            min_size = STEP_TOLERANCE**2 * size
        if size <= min_size:
            break
        stencil_products(neighbour_numbers, responses, change, increment)
        traction[:, :2] += change[:-1]
        gap -= increment
        work = float((change[:-1] * increment).sum())
        if not work > 0.0:  # local responses alone need not be positive definite
            break
        length = float(((change @ metric) * change).sum()) / work
    if min_size == 0.0:
        return point
    load = point.load.copy(order="K")
    load[nodes, :2] = traction[:, :2]
    relaxed = point.at_load(load, point.contact_fraction, point.biactive, point.motion)
    return relaxed if relaxed.merit < MAX_MERIT_GROWTH * point.merit else point
