"""Built-in contact and conductivity laws."""

from meeframe.laws.conductivity import StepConductivity
from meeframe.laws.coulomb import IsotropicCoulomb, OrthotropicCoulomb
from meeframe.laws.signorini import Signorini

__all__ = ["IsotropicCoulomb", "OrthotropicCoulomb", "Signorini", "StepConductivity"]
