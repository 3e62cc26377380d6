"""Problems shared by the tests of Newton's method and of the accelerated iterations."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, final

import numpy as np
import pytest

from meeframe.core.contact import ContactLaw, ContactProblem
from meeframe.core.dense_system import DenseSystem
from meeframe.core.fields import Array
from meeframe.core.formulation import NodalFields, ReducedSystem
from meeframe.laws import Insulating, StepConductivity
from meeframe.materials import library_material
from meeframe.testing.contact_cases import SphereCase

MATERIALS = {"transverse": library_material("batio3-cofe2o4"), "orthotropic": library_material("orthotropic-mee")}


@final
@dataclass(frozen=True, eq=False)
class Matrixless(ReducedSystem):
    """A dense system that does not show its matrix."""

    hidden: DenseSystem

    def apply(self, load: Array) -> Array:
        return self.hidden.apply(load)

    def diagonal_blocks(self) -> Array:
        return self.hidden.diagonal_blocks()

    def dense(self) -> None:
        return None

    def recover(self, load: Array) -> NodalFields:
        return self.hidden.recover(load)


@pytest.fixture(scope="session")
def matrixless() -> Callable[[DenseSystem], ReducedSystem]:
    def hide(system: DenseSystem) -> ReducedSystem:
        return Matrixless(system.points, system.frames, system.weights, system.cells, system.offset, system)

    return hide


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
