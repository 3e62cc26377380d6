"""Built-in contact, conductivity and wear laws."""

from meeframe.laws.conductivity import Insulating, StepConductivity
from meeframe.laws.coulomb import IsotropicCoulomb, OrthotropicCoulomb
from meeframe.laws.signorini import Signorini
from meeframe.laws.wear import Archard

__all__ = ["Archard", "Insulating", "IsotropicCoulomb", "OrthotropicCoulomb", "Signorini", "StepConductivity"]
