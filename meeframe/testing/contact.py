"""Conformance checks of contact, conductivity and wear laws and of solvers, one call each.

Each check raises AssertionError that names the property that fails and shows an offending value.
"""

from meeframe.testing.conductivity_laws import check_conductivity_law, check_growing_flux
from meeframe.testing.contact_laws import check_contact_law
from meeframe.testing.contact_solvers import check_solver, exact_pressure, rescaled
from meeframe.testing.law_properties import (
    check_associated,
    check_fading,
    check_homogeneous,
    check_isotropic,
    check_monotone,
    check_orthotropic,
)
from meeframe.testing.violations import violations
from meeframe.testing.wear_laws import check_wear_law

__all__ = [
    "check_associated",
    "check_conductivity_law",
    "check_contact_law",
    "check_fading",
    "check_growing_flux",
    "check_homogeneous",
    "check_isotropic",
    "check_monotone",
    "check_orthotropic",
    "check_solver",
    "check_wear_law",
    "exact_pressure",
    "rescaled",
    "violations",
]
