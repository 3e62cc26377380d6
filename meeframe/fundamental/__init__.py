"""Fundamental solutions of the extended equations of equilibrium."""

from meeframe.fundamental.isotropic import Isotropic
from meeframe.fundamental.line_integral import LineIntegral
from meeframe.fundamental.residue import Residue
from meeframe.fundamental.tabulated import Tabulated

__all__ = ["Isotropic", "LineIntegral", "Residue", "Tabulated"]
