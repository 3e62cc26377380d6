"""Conformance checks for plugins and for meeframe, and references for numerical tests.

There is one check for each kind of object; it raises AssertionError that says which property fails, for which input,
and why it matters. The tests of a plugin package also use `create`, `provider_of` and `solve_example`, and the
functions of meeframe that make materials, meshes and solutions. The names below are imported when they are first used.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from meeframe.elements.base import shape_functions as shape_functions
    from meeframe.laws.base import contact_conductivity as contact_conductivity
    from meeframe.material import library_material as library_material
    from meeframe.material import rotation_about as rotation_about
    from meeframe.mesh import block_mesh as block_mesh
    from meeframe.mesh import sphere_mesh as sphere_mesh
    from meeframe.solvers import solve as solve
    from meeframe.testing.contact import check_conductivity_law as check_conductivity_law
    from meeframe.testing.contact import check_contact_law as check_contact_law
    from meeframe.testing.contact import check_solver as check_solver
    from meeframe.testing.contact import check_wear_law as check_wear_law
    from meeframe.testing.element import check_element as check_element
    from meeframe.testing.formulation import check_formulation as check_formulation
    from meeframe.testing.formulation import check_indentation as check_indentation
    from meeframe.testing.fundamental import check_fundamental_solution as check_fundamental_solution
    from meeframe.testing.indenter import check_indenter as check_indenter
    from meeframe.testing.package_tests import create as create
    from meeframe.testing.package_tests import provider_of as provider_of
    from meeframe.testing.package_tests import solve_example as solve_example

_MODULES = {
    "check_conductivity_law": "meeframe.testing.contact",
    "check_contact_law": "meeframe.testing.contact",
    "check_solver": "meeframe.testing.contact",
    "check_wear_law": "meeframe.testing.contact",
    "check_element": "meeframe.testing.element",
    "check_formulation": "meeframe.testing.formulation",
    "check_indentation": "meeframe.testing.formulation",
    "check_fundamental_solution": "meeframe.testing.fundamental",
    "check_indenter": "meeframe.testing.indenter",
    "contact_conductivity": "meeframe.laws.base",
    "shape_functions": "meeframe.elements.base",
    "block_mesh": "meeframe.mesh",
    "sphere_mesh": "meeframe.mesh",
    "library_material": "meeframe.material",
    "rotation_about": "meeframe.material",
    "solve": "meeframe.solvers",
    "create": "meeframe.testing.package_tests",
    "provider_of": "meeframe.testing.package_tests",
    "solve_example": "meeframe.testing.package_tests",
}

__all__ = [*_MODULES]


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module 'meeframe.testing' has no attribute {name!r}")
    return getattr(import_module(_MODULES[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
