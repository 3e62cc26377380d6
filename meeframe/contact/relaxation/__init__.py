"""Relaxation of a start from a coarser grid at the nodes that the coarser grid does not resolve.

Where contact ends, and where stick ends, a coarser grid places the boundary between nodes of the finer one, and
interpolation across it violates the laws at the nodes on both sides. Newton's method would find their state in several
steps of many products each, although most of it depends on a few nodes nearby. On a lattice, the response of a node to
the load of another depends on their offset alone, so that these nodes are relaxed among themselves at little cost.
"""

from meeframe.contact.relaxation.contact_edge import relax_contact_edge
from meeframe.contact.relaxation.lattice import Start
from meeframe.contact.relaxation.slip_boundary import relax_slip_boundary
from meeframe.fields import Array

__all__ = ["Start", "relax", "relax_contact_edge"]


def relax(start: Start) -> tuple[Array, Array] | None:
    """Return the load (n, fields) and contact fractions (n,) relaxed at both boundaries; None if neither changes."""
    edge_relaxed = relax_contact_edge(start)
    load, contact_fraction = (start.load, start.contact_fraction) if edge_relaxed is None else edge_relaxed
    slip_relaxed = relax_slip_boundary(start, load)
    if slip_relaxed is not None:
        return slip_relaxed, contact_fraction
    return edge_relaxed
