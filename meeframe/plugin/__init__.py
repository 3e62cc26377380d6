"""Hooks through which everything that has a name in a case file is registered, built-in or not.

What the modules of a plugin need is here, to be imported in one line: contracts, records, quantities, errors, and what
formulations and solvers make of bodies and laws. It is contract, as the docstrings of all this are, and is kept from
version to version; so is meeframe.testing for their tests. Other modules may change.
"""

from meeframe.core.body import Body, check_conditions
from meeframe.core.contact import ContactProblem, ContactState, Iterate, Solver, indenter_position, unbalance
from meeframe.core.dense_system import DenseSystem
from meeframe.core.element import SurfaceElement
from meeframe.core.errors import CaseError
from meeframe.core.fields import Array, FieldScaling
from meeframe.core.formulation import Formulation, NodalFields, Progress, ReducedSystem, silent
from meeframe.core.fundamental import FundamentalSolution, Kernel
from meeframe.core.indenter import Indenter
from meeframe.core.law import ConductivityLaw, ContactLaw, augmented_traction, contact_traction, lawful_traction
from meeframe.core.quantities import Quantity, check_quantities
from meeframe.geometry import zone_frames
from meeframe.plugin.hookspecs import Record, hookimpl
from meeframe.solvers.conduction import Switches, own_response, resistances, unloaded

__all__ = [
    "Array",
    "Body",
    "CaseError",
    "ConductivityLaw",
    "ContactLaw",
    "ContactProblem",
    "ContactState",
    "DenseSystem",
    "FieldScaling",
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
    "Switches",
    "augmented_traction",
    "check_conditions",
    "check_quantities",
    "contact_traction",
    "hookimpl",
    "indenter_position",
    "lawful_traction",
    "own_response",
    "resistances",
    "silent",
    "unbalance",
    "unloaded",
    "zone_frames",
]
