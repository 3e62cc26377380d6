"""Conformance checks for plugins and for meeframe, and references for numerical tests.

There is one check for each kind of object; it raises AssertionError that says which property fails, for which input,
and why it matters. The names below are imported when they are first used.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from meeframe.testing.contact import check_conductivity_law as check_conductivity_law
    from meeframe.testing.contact import check_contact_law as check_contact_law
    from meeframe.testing.contact import check_solver as check_solver
    from meeframe.testing.element import check_element as check_element
    from meeframe.testing.formulation import check_formulation as check_formulation
    from meeframe.testing.formulation import check_indentation as check_indentation
    from meeframe.testing.fundamental import check_fundamental_solution as check_fundamental_solution
    from meeframe.testing.indenter import check_indenter as check_indenter

_MODULES = {
    "check_conductivity_law": "meeframe.testing.contact",
    "check_contact_law": "meeframe.testing.contact",
    "check_solver": "meeframe.testing.contact",
    "check_element": "meeframe.testing.element",
    "check_formulation": "meeframe.testing.formulation",
    "check_indentation": "meeframe.testing.formulation",
    "check_fundamental_solution": "meeframe.testing.fundamental",
    "check_indenter": "meeframe.testing.indenter",
}

__all__ = [*_MODULES]


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module 'meeframe.testing' has no attribute {name!r}")
    return getattr(import_module(_MODULES[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
