"""Fundamental solutions of the extended equilibrium equations."""

from meeframe.greens.isotropic import Isotropic
from meeframe.greens.line_integral import LineIntegral
from meeframe.greens.residue import Residue
from meeframe.greens.tabulated import Tabulated

__all__ = ["Isotropic", "LineIntegral", "Residue", "Tabulated"]
