"""Hooks through which everything that has a name in a case file is registered, built-in or not.

What the modules of a plugin need is here, to be imported in one line: contracts, records, quantities, errors, and what
formulations and solvers make of bodies and laws. It is contract, as the docstrings of all this are, and is kept from
version to version; so is meeframe.testing for their tests. Other modules may change.
"""

from meeframe.common.errors import CaseError
from meeframe.contact.conduction import Switches, own_response, resistances, unloaded
from meeframe.contact.problem import ContactProblem, ContactState, Iterate, Solver, indenter_position, unbalance
from meeframe.elements.base import SurfaceElement
from meeframe.fields import Array, FieldScaling
from meeframe.fields.units import Quantity, check_quantities
from meeframe.greens.base import FundamentalSolution, Kernel
from meeframe.indenters.base import Indenter
from meeframe.laws.base import ConductivityLaw, ContactLaw, augmented_traction, contact_traction, fixed_point_map
from meeframe.mesh import find_contact_zone
from meeframe.mesh.body import Body, check_conditions
from meeframe.plugin.hookspecs import Record, hookimpl
from meeframe.system.dense import DenseSystem
from meeframe.system.reduced import Formulation, NodalFields, Progress, ReducedSystem, silent

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
    "find_contact_zone",
    "fixed_point_map",
    "hookimpl",
    "indenter_position",
    "own_response",
    "resistances",
    "silent",
    "unbalance",
    "unloaded",
]
