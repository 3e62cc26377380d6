"""Hooks through which everything that has a name in a case file is registered, built-in or not.

What the author of a plugin needs is here, to be imported in one line: contracts, records, quantities.
"""

from meeframe.core.body import Body
from meeframe.core.contact import ContactProblem, ContactState, Iterate, Solver
from meeframe.core.dense_system import DenseSystem
from meeframe.core.element import SurfaceElement
from meeframe.core.fields import Array
from meeframe.core.formulation import Formulation, NodalFields, Progress, ReducedSystem, silent
from meeframe.core.fundamental import FundamentalSolution, Kernel
from meeframe.core.indenter import Indenter
from meeframe.core.law import ConductivityLaw, ContactLaw
from meeframe.core.quantities import Quantity, check_quantities
from meeframe.plugin.hookspecs import Record, hookimpl

__all__ = [
    "Array",
    "Body",
    "ConductivityLaw",
    "ContactLaw",
    "ContactProblem",
    "ContactState",
    "DenseSystem",
    "Formulation",
    "FundamentalSolution",
    "Indenter",
    "Iterate",
    "Kernel",
    "NodalFields",
    "Progress",
    "Quantity",
    "Record",
    "ReducedSystem",
    "Solver",
    "SurfaceElement",
    "check_quantities",
    "hookimpl",
    "silent",
]
