"""Built-in contact and conductivity laws."""

from meeframe.laws.conductivity import Insulating, StepConductivity
from meeframe.laws.coulomb import IsotropicCoulomb, OrthotropicCoulomb
from meeframe.laws.signorini import Signorini

__all__ = ["Insulating", "IsotropicCoulomb", "OrthotropicCoulomb", "Signorini", "StepConductivity"]
