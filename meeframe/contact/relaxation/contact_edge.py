"""Relaxation of the nodes around the edge of a conducting contact.

The position of the edge between the nodes decides which of them are open, closed or biactive. Each node in turn gets
the load that satisfies its laws with all others fixed (projected Gauss-Seidel iteration).
"""

from typing import Final

import numpy as np

from meeframe.contact._kernels.relaxation import sweep_nodes
from meeframe.contact.conduction import depends_on_gap
from meeframe.contact.generated_heat import heat_moves_surface, thermal_channel
from meeframe.contact.relaxation.lattice import Band, Start
from meeframe.fields import MECHANICAL, NORMAL, Array
from meeframe.laws.base import contact_conductivity, is_pure_projection

WIDTH: Final = 3
"""Half width of the band, in spacings; farther from the edge, loads depend on those of many nodes.

A width of 2 takes a tenth more products, and a fifth more without friction, in sums over twelve grids.
"""
SWEEPS: Final = 6
"""Largest number of sweeps, whose direction alternates."""
WORK_TOLERANCE: Final = 1e-3
"""Work of the last sweep, relative to that of the greatest one."""
MAX_PRESSURE_RATIO: Final = 1e-3
"""Largest pressure of a node before, as a fraction of its new one, with which it counts as newly pressed."""
MIN_PRESSURE_RATIO: Final = 1e-9
"""Pressure, as a fraction of the largest one, at which conduction at the contact edge is tested."""
MIN_JUMP_RATIO: Final = 0.5
"""Smallest conductivity at that pressure, as a fraction of that at the largest one, that counts as a jump."""


def relax_contact_edge(start: Start) -> tuple[Array, Array] | None:
    """Return the load (n, fields) and the contact fractions (n,) after relaxation around the contact edge.

    None where the conduction does not jump at the edge, where laws depend on more than the load, where heat moves the
    surface, or where nodes form no lattice.
    """
    problem = start.problem
    law = problem.contact_law
    depends_on_more = depends_on_gap(problem) or thermal_channel(problem) is not None or not is_pure_projection(law)
    # the heat of a closed node may keep it closed: sweeps would choose among many solutions
    if depends_on_more or heat_moves_surface(problem) or not _jumps(start):
        return None
    band = Band.around(start, start.load[:, NORMAL] < 0.0, WIDTH)
    if band is None:
        return None
    nodes, stencil = band.nodes, band.stencil
    arrays = start.load, start.relative_displacement, start.closed, start.open
    values, relative_displacement, closed, open_ = (np.ascontiguousarray(array[nodes]) for array in arrays)
    slips, contact_fraction = start.slips[nodes], np.clip(start.contact_fraction[nodes], 0.0, 1.0)
    lattice = band.number, band.positions, stencil.periodic, stencil.responses
    state = values, relative_displacement, contact_fraction
    sweep_nodes(*lattice, closed, open_, slips, *state, SWEEPS, WORK_TOLERANCE)
    # nodes that are newly pressed slip in the direction of their trial traction
    newly_pressed = start.load[nodes, NORMAL] > MAX_PRESSURE_RATIO * values[:, NORMAL]
    values[newly_pressed, :2] = start.trial[nodes[newly_pressed], :2]
    values[:, MECHANICAL] = law.project(values[:, MECHANICAL])
    relaxed, fractions = start.load.copy(order="K"), start.contact_fraction.copy()
    relaxed[nodes], fractions[nodes] = values, contact_fraction
    return relaxed, fractions


def _jumps(start: Start) -> bool:
    """Return whether contact begins to conduct at once.

    Where the conductivity grows from zero with the pressure, it does not matter which of two neighbours is pressed.
    """
    largest = start.load[:, NORMAL].min(initial=0.0)
    pressures = largest * np.array([MIN_PRESSURE_RATIO, 1.0])
    for channel in start.problem.channels:
        if channel.is_conducting:
            least, most = contact_conductivity(channel.law, pressures)
            if least > 0.0 and least >= MIN_JUMP_RATIO * most:
                return True
    return False
