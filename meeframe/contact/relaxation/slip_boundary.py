"""Relaxation of the nodes around the boundary between stick and slip.

Friction has a kink there. A step that corrects it at the nodes of the boundary moves all others, so that Newton's
method finds the boundary node by node. Here friction is found by gradient steps with the responses of the nodes nearby
to each other alone, at fixed pressures.
"""

from typing import Final

import numpy as np

from meeframe.contact._kernels.relaxation import tangential_response
from meeframe.contact.relaxation.lattice import Band, Start
from meeframe.fields import MECHANICAL, NORMAL, Array
from meeframe.laws.base import is_pure_projection

WIDTH: Final = 4
"""Half width of the band, in spacings from the boundary."""
MAX_STEPS: Final = 20
"""Largest number of gradient steps; a step costs a hundredth of a product on a fine grid."""
STEP_TOLERANCE: Final = 1e-2
"""Change of tractions, relative to the first one, below which the iteration ends."""
FIRST_LENGTH: Final = 0.3
"""Length of the first gradient step, relative to the inverse of a node's self-compliance."""


def relax_slip_boundary(start: Start, load: Array) -> Array | None:
    """Return the load (n, fields) with the friction relaxed around the boundary between stick and slip.

    None if there is no such boundary, if nodes form no lattice, or if nothing changes.

    Projected gradient steps with the lengths of Barzilai and Borwein, IMA J. Numer. Anal. 8 (1988) 141.
    """
    law = start.problem.contact_law
    if not is_pure_projection(law) or not load[:, :2].any():
        return None
    band = Band.around(start, (load[:, NORMAL] < 0.0) & ~start.slips, WIDTH)
    if band is None:
        return None
    lattice = band.number, band.positions, band.stencil.periodic
    responses = np.ascontiguousarray(band.stencil.responses[:, :, :2, :2])
    scaling = law.tangential_scaling()  # the law projects in its metric
    metric = np.linalg.pinv(scaling)
    traction = load[band.nodes, MECHANICAL]
    gap = np.ascontiguousarray(start.relative_displacement[band.nodes, :2])
    length = FIRST_LENGTH / float(responses[len(responses) // 2, len(responses) // 2].diagonal().max())
    response, least = np.empty_like(gap), 0.0
    for step in range(MAX_STEPS):
        trial = traction.copy()
        trial[:, :2] += length * gap @ scaling
        change = law.project(trial)[:, :2] - traction[:, :2]
        size = float((change**2).sum())
        if step == 0:
            least = STEP_TOLERANCE**2 * size
        if size <= least:
            break
        tangential_response(*lattice, responses, change, response)
        traction[:, :2] += change
        gap -= response
        work = float((change * response).sum())
        if not work > 0.0:  # local responses alone need not be positive definite
            break
        length = float(((change @ metric) * change).sum()) / work
    if least == 0.0:
        return None
    relaxed = load.copy(order="K")
    relaxed[band.nodes, :2] = traction[:, :2]
    return relaxed
