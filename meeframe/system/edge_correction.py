"""Reduced systems with a contact edge between the nodes: nodes near it respond more to their own load."""

from meeframe.fields import Array
from meeframe.system.composed import ComposedSystem, Term, compose
from meeframe.system.reduced import ReducedSystem


def correct_edge(system: ReducedSystem, extra_compliance: Array) -> ComposedSystem:
    """Return a system with an addition (n, f, f) to its diagonal blocks; see `EdgeCorrection`.

    It has no coarser division, since its correction belongs to the nodes of this one.
    """
    return compose(system, (Term(system),), system.frames, system.offset, extra_compliance)
