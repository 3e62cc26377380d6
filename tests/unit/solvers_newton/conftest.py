"""Problems shared by the tests of Newton's method and of the accelerated iterations."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, final

import numpy as np
import pytest

from meeframe.core.contact import ContactProblem
from meeframe.core.dense_system import DenseSystem
from meeframe.core.fields import Array
from meeframe.core.formulation import ReducedSystem
from meeframe.core.law import ConductivityLaw, ContactLaw
from meeframe.laws import Insulating, StepConductivity
from meeframe.materials import library_material
from meeframe.testing.contact_cases import SphereCase
from meeframe.testing.matrix_free import MatrixFree

MATERIALS = {"transverse": library_material("batio3-cofe2o4"), "orthotropic": library_material("orthotropic-mee")}


@final
@dataclass(frozen=True)
class Growing(ConductivityLaw):
    """kappa (|p| / pressure)^exponent: no jump, one solution."""

    kappa: float
    pressure: float
    exponent: float

    def conductivity(self, normal_traction: Array, gap: Array, drop: Array) -> Array:
        return self.kappa * (np.maximum(-normal_traction, 0.0) / self.pressure) ** self.exponent


@pytest.fixture(scope="session")
def growing() -> type[ConductivityLaw]:
    return Growing


@pytest.fixture(scope="session")
def matrixless() -> Callable[[DenseSystem], ReducedSystem]:
    return MatrixFree.of


@pytest.fixture(scope="session")
def sphere() -> Callable[..., ContactProblem]:
    """Maker of sphere problems; kappa: electric and magnetic, in units of the inverse own response of a node."""

    def make(material: str, law: ContactLaw, kappa: tuple[float, float] = (0.0, 0.0), **options: Any) -> ContactProblem:
        medium = MATERIALS[material]
        plain = SphereCase(medium, law, Insulating(), Insulating(), **options)
        own = np.abs(np.diag(plain.problem().system.diagonal_blocks()[0]))[3:]
        laws = [StepConductivity(float(k / o)) if k else Insulating() for k, o in zip(kappa, own, strict=True)]
        return SphereCase(medium, law, *laws, **options).problem()

    return make
